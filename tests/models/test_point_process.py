"""Matern II against its known intensity and its hard core."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from echoset.models.errors import ParameterError
from echoset.models.point_process import ball, matern_ii, parent_intensity


@pytest.mark.parametrize("d", [2, 3])
def test_mean_number_and_hard_core(d):
    lower, upper, radius, runs = np.zeros(d), np.array([30.0, 20.0, 10.0])[:d], 4.0, 400
    retained = 0.6 / ball(radius, d)
    rng = np.random.default_rng(3)
    draws = [matern_ii(lower, upper, radius, retained, rng) for _ in range(runs)]
    count = np.array([len(x) for x in draws])
    mean = retained * np.prod(upper - lower)
    assert abs(count.mean() - mean) < 4.5 * count.std(ddof=1) / np.sqrt(runs)
    assert min(pdist(x).min() for x in draws if len(x) > 1) > radius
    assert all(((x >= lower) & (x <= upper)).all() for x in draws)


def test_borders_are_as_full_as_the_middle():
    lower, upper, runs = np.zeros(3), np.full(3, 12.0), 1500
    rng = np.random.default_rng(5)
    retained = 0.7 / ball(3.0, 3)
    x = np.concatenate([matern_ii(lower, upper, 3.0, retained, rng) for _ in range(runs)])
    edge = (np.abs(x - 6) > 4).any(1).sum() / runs
    expected = retained * (12.0**3 - 8.0**3)
    # Repulsion makes counts less spread than Poisson's.
    assert abs(edge - expected) < 4.5 * np.sqrt(expected / runs)


def test_parent_intensity_inverts_the_retained_one():
    V = 4 / 3 * np.pi * 6.0**3
    parents = parent_intensity(9.6e-4, 6.0)
    assert (1 - np.exp(-parents * V)) / V == pytest.approx(9.6e-4)
    assert parent_intensity(0.3, 0.0) == 0.3
    with pytest.raises(ParameterError, match="below one per ball"):
        parent_intensity(1.2 / V, 6.0)

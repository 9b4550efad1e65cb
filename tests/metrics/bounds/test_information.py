"""The information of a link against adaptive quadrature, and what it costs."""

from __future__ import annotations

import tracemalloc
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad

from echoset.metrics.bounds import pcrlb
from echoset.metrics.bounds.information import information


def integrated(
    length: np.ndarray, std: np.ndarray, weight: np.ndarray, slope: np.ndarray, background: float
) -> float:
    """The information about one variable by QUADPACK, piece by piece between all scales."""

    def integrand(z: float) -> float:
        x = (z - length) / std
        peaks = weight * np.exp(-0.5 * x**2) / (np.sqrt(2 * np.pi) * std)
        return float((slope * peaks * x / std).sum() ** 2 / (background + peaks.sum() + 1e-300))

    steps = np.array([-30, -8, -4, -2, -1, 0, 1, 2, 4, 8, 30])
    ends = np.unique(length + steps[:, None] * std)
    pieces = pairwise(ends)
    return sum(quad(integrand, a, b, epsabs=0, epsrel=1e-10, limit=200)[0] for a, b in pieces)


@pytest.mark.parametrize("background", [0.0, 0.25, 40.0])
@pytest.mark.parametrize(
    ("length", "std"),
    [
        ([2.0, 2.1, 2.4], [0.02, 0.03, 0.05]),
        ([2.0, 2.3], [1e-3, 1.0]),
        ([1.0, 9.0, 900.0], [0.01, 0.1, 9.0]),
        ([1.0, 5000.0], [0.004, 300.0]),
    ],
)
def test_it_is_the_integral_however_unlike_the_paths(
    length: list[float], std: list[float], background: float
) -> None:
    d, s = np.array(length), np.array(std)
    w, slope = np.linspace(1.0, 2.5, len(d)), np.linspace(1.0, -0.5, len(d))
    J = information(d, s, w, slope[:, None], background)
    assert J.item() == pytest.approx(integrated(d, s, w, slope, background), rel=1e-6)


def test_a_body_far_away_takes_little_memory() -> None:
    paths = np.array([1.0, 1e6]), np.array([1e-3, 1e3]), np.ones(2), np.eye(2)
    tracemalloc.start()
    J = information(*paths, 0.25)
    state = (2e5, 1.0, 0.0, 0.0, 2e5, np.pi, 0.3, 0.2, 0.1)
    own = pcrlb.link_information(state, None, (0.5, 1.0, 0.0), pcrlb.Params())
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 2e8
    assert np.isfinite(J).all()
    assert np.isfinite(own).all()

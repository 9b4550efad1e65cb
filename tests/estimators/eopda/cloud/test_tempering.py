"""The tempered sampler and resampling."""

from __future__ import annotations

import numpy as np
import pytest

from echoset.estimators.eopda.cloud.resampling import effective_sample_size, normalise, systematic
from echoset.estimators.eopda.cloud.tempering import temper
from echoset.models.errors import EstimatorError


def normal(x):
    """Log density of standard normal variables, but for its factor."""
    return -0.5 * (x**2).sum(0)


def test_narrow_posterior_is_sampled():
    """A Gaussian likelihood a hundred times narrower than the prior has a closed-form posterior."""
    y, s = np.array([1.5, -0.5]), np.array([0.01, 0.02])
    rng = np.random.default_rng(1)
    x, log_z = temper(
        lambda x: normal(x) - 0.5 * (((x[:2].T - y) / s) ** 2).sum(1),
        normal,
        rng.normal(size=(3, 4000)),
        rng,
    )
    # the integral of the likelihood over the prior is that of N(y; 0, 1 + s^2), but for its factor
    exact = (-0.5 * y**2 / (1 + s**2) + np.log(s) - 0.5 * np.log(1 + s**2)).sum()
    assert abs(log_z - exact) < 0.3
    gain = 1 / (1 + s**2)
    # moves decorrelate what resampling copied: a quarter of the draws counts as independent
    n = len(x[0]) / 4
    assert (np.abs(x[:2].mean(1) - gain * y) < 4.5 * s / np.sqrt(n)).all()
    assert (np.abs(x[:2].var(1) / (gain * s**2) - 1) < 4.5 * np.sqrt(2 / n)).all()
    assert abs(x[2].mean()) < 4.5 / np.sqrt(n) and abs(x[2].var() - 1) < 4.5 * np.sqrt(2 / n)


def test_two_modes_keep_their_masses():
    def log_posterior(x):
        peaks = np.logaddexp(-0.5 * ((x[0] - 1) / 0.05) ** 2, -0.5 * ((x[0] + 1) / 0.05) ** 2)
        return normal(x) + peaks

    def upper(k):
        rng = np.random.default_rng(k)
        return (temper(log_posterior, normal, rng.normal(size=(1, 1000)), rng)[0] > 0).mean()

    share = [upper(k) for k in range(20)]
    assert abs(np.mean(share) - 0.5) < 4.5 * np.std(share) / np.sqrt(20)
    assert min(share) > 0.2 and max(share) < 0.8


def test_jumps_keep_the_masses_of_modes():
    """Modes of masses 1 and 3; jumps take one to the other and stretch it thrice."""
    rng = np.random.default_rng(3)

    def log_density(x):
        return np.logaddexp(-0.5 * ((x[0] - 1) / 0.01) ** 2, -0.5 * ((x[0] + 3) / 0.03) ** 2)

    def jump(x, _rng):
        return np.where(x > 0, -3 * x, -x / 3), np.log(np.where(x[0] > 0, 3.0, 1 / 3))

    n = 4000
    x = np.where(
        rng.random(n) < 0.25, 1 + 0.01 * rng.normal(size=n), -3 + 0.03 * rng.normal(size=n)
    )
    y, _ = temper(log_density, log_density, x[None], rng, jump)
    assert abs((y < 0).mean() - 0.75) < 4.5 * np.sqrt(0.75 * 0.25 / n)
    assert ((y[0] < 0) != (x < 0)).mean() > 0.3


def test_systematic_resampling_is_within_one_of_the_expected_count():
    rng = np.random.default_rng(2)
    w = rng.dirichlet(np.ones(50))
    for u in (0.0, 0.3, 1 - 2**-53):
        index = systematic(w, u, 400)
        assert len(index) == 400
        assert np.abs(np.bincount(index, minlength=50) - 400 * w).max() <= 1 + 1e-9


def test_weights():
    w = normalise(np.log([1.0, 3.0]) - 1000.0)
    assert np.allclose(w, [0.25, 0.75])
    assert np.isclose(effective_sample_size(w), 1.6)


@pytest.mark.parametrize("bad", [[-np.inf, -np.inf], [np.nan, 0.0], [np.inf, 0.0]])
def test_vanishing_and_broken_weights_are_errors(bad):
    with pytest.raises(EstimatorError):
        normalise(np.array(bad))

"""The bound in hindsight against the inverse of the whole information matrix."""

from __future__ import annotations

import numpy as np
import pytest

from echoset.metrics.bounds import pcrlb, pcrlb_smooth
from echoset.metrics.bounds.information import covariance_bounds
from echoset.metrics.bounds.smoothed import smoothed_bounds
from echoset.simulate import uwb


def model(n, d, rng):
    """Prior, F, Q and the information of measurements, some of which see nothing."""
    F = np.eye(d) + 0.2 * rng.normal(size=(n, d, d))
    B, H = 0.3 * rng.normal(size=(n, d, d)), rng.normal(size=(n, 2, d))
    H[n // 3 : n // 2] = 0.0
    Q = B @ B.swapaxes(1, 2) + 0.01 * np.eye(d)
    Q[0], F[0] = 0.0, np.eye(d)
    return np.diag(rng.uniform(0.5, 2.0, d)), F, Q, H.swapaxes(1, 2) @ H


def test_diagonal_blocks_of_the_dense_inverse():
    n, d = 12, 4
    P0, F, Q, J_z = model(n, d, np.random.default_rng(1))
    J = np.zeros((n, d, n, d))
    J[0, :, 0] += np.linalg.inv(P0)
    for k in range(n):
        J[k, :, k] += J_z[k]
        if k:
            gain = np.hstack((-F[k], np.eye(d)))
            pair = gain.T @ np.linalg.solve(Q[k], gain)
            J[k - 1 : k + 1, :, k - 1 : k + 1] += pair.reshape(2, d, 2, d)
    dense = np.linalg.inv(J.reshape(n * d, n * d)).reshape(n, d, n, d)
    found = smoothed_bounds(P0, F, Q, J_z)
    for k in range(n):
        np.testing.assert_allclose(found[k], dense[k, :, k], rtol=0, atol=1e-10)


def test_hindsight_never_knows_less_and_at_the_end_the_same():
    P0, F, Q, J_z = model(20, 3, np.random.default_rng(2))
    B = np.random.default_rng(3).normal(size=(20, 3, 1))
    for noise in (Q, B @ B.swapaxes(1, 2), 0 * Q):
        then, later = covariance_bounds(P0, F, noise, J_z), smoothed_bounds(P0, F, noise, J_z)
        assert np.linalg.eigvalsh(then - later).min() > -1e-9
        np.testing.assert_array_equal(later[-1], then[-1])


@pytest.fixture(scope="module")
def recording():
    params = uwb.Params(steps=12, blocked=((5, 8, 1), (5, 8, 2), (5, 8, 3)))
    return uwb.simulate(params, np.random.default_rng(1), "scene")


def test_metric_beside_the_bound_of_filters(recording):
    then, later = (m.score(None, recording, pcrlb.Params()) for m in (pcrlb, pcrlb_smooth))
    for part in ("device", "centre"):
        a = then.where(metric="pcrlb", part=part, timed=True).value
        b = later.where(metric="pcrlb-smooth", part=part, timed=True).value
        assert len(b) == 12 and (b <= a + 1e-9).all() and b[-1] == a[-1]
        assert b[5:8].max() < a[5:8].max()
    assert len(later.where(metric="pcrlb-smooth-valid", timed=True)) == 12

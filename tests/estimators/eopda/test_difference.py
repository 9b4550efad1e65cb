"""Differences of distance: the joint Gaussian, the Kalman filter, and what filters make of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from echoset.estimators.eopda.kernels.compiled import difference as compiled
from echoset.estimators.eopda.kernels.difference import difference
from echoset.estimators.run import Estimation
from echoset.simulate.uwb_walk import Params, simulate

ANCHORS = np.array([[0.0, 0.0, 2.0], [5.0, 0.0, 1.0], [5.0, 5.0, 2.5], [0.0, 5.0, 0.0]])
REFERENCE = np.array([0, 0, 0, 1])
RX = np.array([1, 2, 3, 3])
OFFSET = np.array([0, 1, 2, 3, 4])
VARIANCE = np.full(4, 0.02)


def joint(correlation: float) -> np.ndarray:
    """Covariance (4, 4) of the noise: differences from one anchor share its part."""
    same = REFERENCE[:, None] == REFERENCE
    return 0.02 * np.where(np.eye(4) == 1, 1.0, correlation * same)


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("biased", [False, True])
def test_the_likelihood_is_that_of_the_joint_gaussian(correlation: float, biased: bool) -> None:
    rng = np.random.default_rng(1)
    n, D = 6, 5 if biased else 0
    device, height = rng.uniform(1, 4, (2, n)), rng.uniform(0, 1, n)
    theta = 0.1 * rng.normal(size=(n, D))
    A = 0.1 * rng.normal(size=(n, D, D))
    P = A @ A.swapaxes(1, 2) + 1e-3 * np.eye(D)
    p = np.column_stack((device.T, height))
    d = np.linalg.norm(p[:, None] - ANCHORS, axis=2)
    z = d[0, RX] - d[0, REFERENCE] + 0.1 * rng.normal(size=4)
    links = ANCHORS, REFERENCE, RX, OFFSET, z, VARIANCE, correlation
    log_l, m, C = difference(device, height, *links, theta, P, 1e-290, 1.0)
    for k in range(n):
        delta = d[k, RX] - d[k, REFERENCE]
        H = np.zeros((4, D))
        if biased:
            H[:, 0] = delta
            H[np.arange(4), 1 + RX] += 1.0
            H[np.arange(4), 1 + REFERENCE] -= 1.0
        S = joint(correlation) + H @ P[k] @ H.T
        nu = z - delta - H @ theta[k]
        square = nu @ np.linalg.solve(S, nu)
        # a Gaussian is zero beyond eight standard deviations
        if square < 60:
            expected = -0.5 * (square + np.linalg.slogdet(2 * np.pi * S)[1])
            assert log_l[k] == pytest.approx(expected, rel=1e-9)
            K = P[k] @ H.T @ np.linalg.inv(S)
            np.testing.assert_allclose(m[k], theta[k] + K @ nu, atol=1e-10)
            np.testing.assert_allclose(C[k], P[k] - K @ H @ P[k], atol=1e-12)


@pytest.mark.parametrize("floor", [1e-3, 0.5])
@pytest.mark.parametrize("biased", [False, True])
def test_twins_are_equal(biased: bool, floor: float) -> None:
    rng = np.random.default_rng(2)
    n, D = 50, 5 if biased else 0
    device, height = rng.uniform(1, 4, (2, n)), rng.uniform(0, 1, n)
    A = 0.1 * rng.normal(size=(n, D, D))
    belief = 0.1 * rng.normal(size=(n, D)), A @ A.swapaxes(1, 2)
    # of one reference none, two and one difference, of another two
    offset, z = np.array([0, 0, 2, 3, 5]), np.array([0.3, -0.2, 0.5, 0.9, -1.4])
    links = ANCHORS, REFERENCE, RX, offset, z, rng.uniform(0.01, 0.1, 5), 0.5
    for a, b in zip(
        difference(device, height, *links, *belief, floor, 0.9),
        compiled.difference(device, height, *links, *belief, floor, 0.9),
        strict=True,
    ):
        np.testing.assert_allclose(a, b, rtol=1e-6, atol=1e-9)


WALK = Params(
    steps=60, anchors=4, ring=5.0, size=2.0, step=0.25, dt=0.25, noise="gaussian", sigma=0.05,
    differences=True,
)  # fmt: skip


@pytest.mark.parametrize("estimator", ["range-ls", "position", "eopda-geo"])
def test_a_tag_is_found_by_differences_alone(estimator: str) -> None:
    record = simulate(WALK, np.random.default_rng(4), "walk")
    record = replace(record, streams={"uwb": record.streams["uwb"]})
    # corners are turned at once
    settings: dict = {"range_bias_std": 0.0, "acceleration_std": 8.0}
    if estimator != "range-ls":
        settings |= {"particles": 1500}
    if estimator != "eopda-geo":
        settings |= {"learn": []}
    run = Estimation(estimator, (("settings", settings),), 1).on(record.setup(), "walk")
    out = list(run.steps(record.scans()))
    found = np.array([e.objects.columns("device_x", "device_y")[0] for e in out])
    true = record.truth.objects.columns("device_x", "device_y")
    # differences of 0.07 m at a dilution of about 1.2
    assert np.sqrt(((found - true)[5:] ** 2).sum(1).mean()) < 0.15


def test_differences_taken_for_independent_cost_precision() -> None:
    errors = {0.5: [], 0.0: []}
    for seed in range(8):
        record = simulate(replace(WALK, anchors=6, ring=8.0), np.random.default_rng(seed), "walk")
        record = replace(record, streams={"uwb": record.streams["uwb"]})
        true = record.truth.objects.columns("device_x", "device_y")
        for correlation, found in errors.items():
            settings = {"learn": [], "range_bias_std": 0.0, "tdoa_correlation": correlation}
            run = Estimation("range-ls", (("settings", settings),), 1).on(record.setup(), "walk")
            out = list(run.steps(record.scans()))
            p = np.array([e.objects.columns("device_x", "device_y")[0] for e in out])
            found.append(((p - true) ** 2).sum(1).mean())
    apart = np.array(errors[0.0]) - np.array(errors[0.5])
    assert apart.mean() > 2 * apart.std(ddof=1) / np.sqrt(len(apart))
    assert np.sqrt(np.mean(errors[0.0]) / np.mean(errors[0.5])) < 2.0

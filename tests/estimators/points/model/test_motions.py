"""Filters with other motions than constant velocity, against a Kalman filter of one target."""

import numpy as np
import pytest
from scipy.linalg import expm

from echoset.estimators.points import mbm, phd, pmb
from echoset.estimators.points.model.targets import TargetParams, within
from echoset.models.motion import (
    backwards,
    constant_velocity,
    coordinated_turn,
    random_walk,
    white_acceleration,
)

FILTERS = pytest.mark.parametrize(
    ("module", "more"), [(phd, {}), (mbm, {}), (mbm, {"poisson": True}), (pmb, {})]
)
BIRTH = (1.0, 50.0, 50.0, 3.0, -1.0, 3.0, 3.0, 1.0, 1.0)
BASE = {
    "p_detect": 1.0 - 1e-12, "clutter_rate": 1e-12, "p_survive": 1.0, "std_position": 1.0,
    "clutter_region": (-500.0, 500.0, -500.0, 500.0), "birth": "components",
    "birth_components": (BIRTH,), "time_unit": 1e9, "gate": 1e9, "acceleration_density": 0.1,
}  # fmt: skip
MOTIONS = pytest.mark.parametrize(
    "motion",
    [
        {},
        {"motion": "ca", "jerk_density": 0.2, "birth_std_acceleration": 0.7},
        {"motion": "ct", "turn_rate": 0.2},
        {"motion": "random-walk", "diffusion": 0.5},
    ],
    ids=["cv", "ca", "ct", "random-walk"],
)


def model(motion, dt):
    """F and Q by formulas of their own."""
    if motion.get("motion") == "random-walk":
        d = motion["diffusion"]
        return np.diag([1.0, 1.0, 0.0, 0.0]), np.diag([d * dt, d * dt, d / dt, d / dt])
    if motion.get("motion") == "ca":
        # Van Loan: the noise of a chain of integrals, by one exponential.
        A, W = np.zeros((6, 6)), np.zeros((6, 6))
        A[:2, 2:4] = A[2:4, 4:] = np.eye(2)
        W[4:, 4:] = motion["jerk_density"] * np.eye(2)
        both = expm(dt * np.block([[-A, W], [np.zeros((6, 6)), A.T]]))
        F = both[6:, 6:].T
        return F, F @ both[:6, 6:]
    F = coordinated_turn(dt, motion.get("turn_rate", 0.0))
    return F, 0.1 * white_acceleration(dt)


def prior(motion):
    """Mean and covariance of a target that appears."""
    more = [motion["birth_std_acceleration"]] * 2 if motion.get("motion") == "ca" else []
    return np.array([*BIRTH[1:5], *(0.0 for _ in more)]), np.diag(np.square([*BIRTH[5:], *more]))


def kalman(Z, motion, dt):
    m, P = prior(motion)
    H, found = np.eye(2, len(m)), []
    for k, z in enumerate(Z):
        if k:
            F, Q = model(motion, dt)
            m, P = F @ m, F @ P @ F.T + Q
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.eye(2))
        m, P = m + K @ (z - H @ m), P - K @ H @ P
        found.append((m, P))
    return found


@MOTIONS
@FILTERS
def test_one_target_is_the_kalman_filter(make_recording, module, more, motion):
    rng = np.random.default_rng(1)
    Z = 50 + rng.normal(size=(8, 2))
    recording = make_recording(Z[:, None], dt=0.7)
    params = module.Params(**BASE, **more, **motion)
    steps = list(module.estimate(recording.setup(), recording.scans(), params, rng))
    for step, (m, P) in list(zip(steps, kalman(Z, motion, 0.7), strict=True))[1:]:
        best = int(np.argmax(step.objects.existence))
        np.testing.assert_allclose(step.objects.state[best], m, atol=1e-6)
        np.testing.assert_allclose(step.objects.covariance[best], P, atol=1e-6)


@MOTIONS
@pytest.mark.parametrize("module", [mbm, pmb])
@pytest.mark.parametrize("how", [{"smooth": "whole"}, {"lag": 100.0, "retrodict": 5.0}])
def test_smoothed_too(make_recording, module, motion, how):
    """The batch of all states by least squares."""
    if module is pmb and "lag" in how:
        pytest.skip("pmb waits by smooth alone")
    rng = np.random.default_rng(2)
    Z = 50 + rng.normal(size=(6, 2))
    recording = make_recording(Z[:, None], dt=0.7)
    params = module.Params(**BASE, **motion, **how)
    steps = list(module.estimate(recording.setup(), recording.scans(), params, rng))
    n, (F, Q) = len(Z), model(motion, 0.7)
    m, P = prior(motion)
    d = len(m)
    A, b, first = np.zeros((d * n, d * n)), np.zeros(d * n), np.linalg.inv(P)
    A[:d, :d] += first
    b[:d] += first @ m
    H, W = np.eye(2, d), np.linalg.inv(Q)
    for k in range(n):
        here = slice(d * k, d * k + d)
        A[here, here] += H.T @ H
        b[here] += H.T @ Z[k]
        if k:
            G = np.zeros((d, d * n))
            G[:, d * k - d : d * k], G[:, here] = -F, np.eye(d)
            A += G.T @ W @ G
    x = np.linalg.solve(A, b).reshape(n, d)
    for step, m in list(zip(steps, x, strict=True))[1:]:
        best = int(np.argmax(step.objects.existence))
        np.testing.assert_allclose(step.objects.state[best], m, atol=1e-5)


def test_a_circle_is_followed_where_a_line_is_lost(make_recording):
    rng = np.random.default_rng(3)
    t = np.arange(30)
    circle = 50 + 20 * np.stack((np.cos(0.3 * t), np.sin(0.3 * t)), 1)
    recording = make_recording((circle + rng.normal(size=(30, 2)))[:, None])
    error = {}
    for name, motion in (("cv", {}), ("ct", {"motion": "ct", "turn_rate": 0.3})):
        params = pmb.Params(
            p_detect=0.99, clutter_rate=0.1, clutter_region=(0.0, 100.0, 0.0, 100.0),
            std_position=1.0, birth_std_velocity=(8.0, 8.0), acceleration_density=0.05, **motion,
        )  # fmt: skip
        last = list(pmb.estimate(recording.setup(), recording.scans(), params, rng))[10:]
        near = [
            np.hypot(*(step.objects.state[:, :2] - true).T).min(initial=5.0)
            for step, true in zip(last, circle[10:], strict=True)
        ]
        error[name] = np.sqrt(np.mean(np.square(near)))
    # The detections alone have sqrt(2).
    assert error["ct"] < 1.0 and error["ct"] < error["cv"] / 2


@MOTIONS
def test_back_and_forth_is_where_it_began(motion):
    move = within(TargetParams(**{"acceleration_density": 0.1, **motion}))
    F, Q = move(0.4)
    back, Q_back = move(-0.4)
    kept = np.diag([1.0, 1.0, 0.0, 0.0]) if "diffusion" in motion else np.eye(len(F))
    np.testing.assert_allclose(back @ F, kept, atol=1e-12)
    np.linalg.cholesky(Q_back)
    assert (np.linalg.eigvalsh(Q) > 0).all()


def test_a_random_walk_without_time_and_what_it_leaves():
    F, Q = random_walk(0.0, 0.5)
    assert np.isfinite(Q).all() and np.diag(F).tolist() == [1, 1, 0, 0]
    np.testing.assert_array_equal(backwards(F), F)
    G, _ = constant_velocity(0.3)
    np.testing.assert_array_equal(backwards(G), np.linalg.inv(G))

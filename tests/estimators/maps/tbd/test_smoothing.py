"""The way back against least squares over all times at once, and over simulated maps."""

from dataclasses import replace

import numpy as np
import pytest

from echoset.campaign.scenarios import find
from echoset.estimators.maps.tbd import filter as tbd
from echoset.estimators.maps.tbd.params import Params
from echoset.estimators.maps.tbd.smoothing import Trail, back
from echoset.estimators.maps.tbd.targets import DIM, Targets, predict
from echoset.models.parameters import resolve
from echoset.models.random import generator
from echoset.simulate import jsc

PARAMS = Params()
DT = 0.4


def target(m, P, label=3, kind=1):
    kinds = np.array([kind])
    return Targets(
        m[None], P[None], kinds, np.array([2.0]), np.array([1.0]), np.array([label]),
        np.array([5]),
    )  # fmt: skip


def law():
    """Motion over DT: F, the mean that is added, and Q, by motion from known states."""
    zero = target(np.zeros(7), np.zeros((7, 7)))
    after = predict(zero, PARAMS, DT)
    F = np.stack(
        [predict(target(e, np.zeros((7, 7))), PARAMS, DT).m[0] - after.m[0] for e in np.eye(7)], 1
    )
    return F, after.m[0], after.P[0]


def test_means_and_covariances_are_those_of_least_squares_over_all_times():
    """Five times, the whole state measured at each: the joint Gaussian solved at once."""
    rng, n = np.random.default_rng(3), 5
    F, b, Q = law()
    assert b[5] == pytest.approx((1 - F[5, 5]) * DIM)
    R = np.diag([0.1, 0.2, 0.5, 0.4, 0.1, 0.3, 0.1]) ** 2
    z = rng.normal(size=(n, 7))
    z[:, 4] *= 0.1
    P = np.diag([1.0, 1.0, 2.0, 2.0, 0.5, 0.3, 0.2]) ** 2
    x, trails = target(np.zeros(7), P), []
    for k in range(n):
        if k:
            x = predict(x, PARAMS, DT)
        gain = x.P[0] @ np.linalg.inv(x.P[0] + R)
        m = x.m[0] + gain @ (z[k] - x.m[0])
        x = replace(x, m=m[None], P=(x.P[0] - gain @ x.P[0])[None])
        trails.append(Trail(int(k * DT * 1e9), x))
    rows = [np.kron(np.eye(n)[0], np.linalg.cholesky(np.linalg.inv(P)).T)]
    right = [np.zeros(7)]
    for k in range(n):
        W = np.linalg.cholesky(np.linalg.inv(R)).T
        rows.append(np.kron(np.eye(n)[k], W))
        right.append(W @ z[k])
        if k:
            W = np.linalg.cholesky(np.linalg.inv(Q)).T
            rows.append(np.kron(np.eye(n)[k], W) - np.kron(np.eye(n)[k - 1], W @ F))
            right.append(W @ b)
    A = np.concatenate(rows)
    mean = np.linalg.lstsq(A, np.concatenate(right), rcond=None)[0].reshape(n, 7)
    joint = np.linalg.inv(A.T @ A)
    later = None
    for k in range(n - 1, -1, -1):
        later = back(later, trails[k], PARAMS)
        np.testing.assert_allclose(later.targets.m[0], mean[k], atol=1e-8)
        block = joint[7 * k : 7 * k + 7, 7 * k : 7 * k + 7]
        np.testing.assert_allclose(later.targets.P[0], block, atol=1e-8)


def test_what_exists_later_existed_and_a_class_is_the_last():
    P = np.eye(7) * 0.1
    now, then = target(np.zeros(7), P), target(np.zeros(7), P)
    other = target(np.ones(7), P, label=4)
    now = replace(now, exists=np.array([-3.0])).join(other)
    then = replace(then, exists=np.array([4.0]), vehicle=np.array([-2.0]))
    found = back(Trail(int(DT * 1e9), then), Trail(0, now), PARAMS).targets
    assert found.exists.tolist() == [4.0, 2.0] and found.vehicle.tolist() == [-2.0, 1.0]
    np.testing.assert_array_equal(found.m[1], other.m[0])


def test_another_body_moves_on_as_one_target():
    """Heading, brightness, size of a pedestrian say nothing of the vehicle that it was."""
    P = np.diag([0.1, 0.1, 1.0, 1.0, 0.1, 0.1, 0.1])
    now, then = target(np.zeros(7), P), target(np.full(7, 0.3), P * 0.1, kind=0)
    found = back(Trail(int(DT * 1e9), then), Trail(0, now), PARAMS).targets
    assert (found.m[0, :4] != 0).all() and not found.m[0, 4:].any()
    np.testing.assert_array_equal(found.P[0, 4:, 4:], P[4:, 4:])


def test_smoothed_maps():
    """Of 16 scans all eight are shown from the first on, nearer than the filter has them."""
    params = resolve(jsc.Params, *find("jsc-6bs").layers, ("here", {"scans": 16}))
    recording = jsc.simulate(params, generator(1, "tbd", "r"), "r")
    o = recording.truth.objects
    errors = {}
    for smooth in ("none", "whole", "0.2s"):
        steps = tbd.estimate(recording.setup(), recording.scans(), Params(smooth=smooth), None)
        off, shown, times = [], [], []
        for k, step in enumerate(steps):
            state = o.state[o.row_offset[k] : o.row_offset[k + 1], :2]
            d = np.hypot(*(step.objects.state[:, None, :2] - state).T)
            off.append(np.minimum(d.min(1), 1.0).mean() if d.size else 1.0)
            shown.append(len(step.objects.label))
            times.append(int(step.objects.time_ns[0]))
        errors[smooth] = np.mean(off)
        assert times == o.time_ns.tolist()
        if smooth == "whole":
            assert shown == [8] * 16
    assert errors["whole"] < errors["none"] and errors["0.2s"] < errors["none"]

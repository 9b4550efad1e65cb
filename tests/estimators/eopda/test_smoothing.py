"""The way back of the UWB filters against conditioning of whole trajectories, and by its errors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from echoset.estimators.eopda import geo, position
from echoset.estimators.eopda.cloud.images import images
from echoset.estimators.eopda.filter import predict
from echoset.estimators.eopda.odometry import Increment
from echoset.estimators.eopda.smoothing import Record, back, record, smoother, transition
from echoset.estimators.eopda.state import Belief, Height, State, Step
from echoset.estimators.run import Estimation
from echoset.models.records import Meta, Recording, Sensor, Stream
from echoset.simulate import uwb_walk

STEP = 0.1
BOUND = 13.8
"""99.9 % of a chi-square of two degrees of freedom."""
ONE, ANY = np.ones(1), np.zeros(0)
HEIGHT = Height(1.0, 0.5, 0.0, np.inf)
BODY = geo.Params(
    max_range=20.0,
    acceleration_std=1.5,
    bias_distance_std=0.02,
    bias_angle_std=0.03,
    axes_std=0.01,
    width_std=0.02,
    range_bias_std=0.3,
    range_bias_walk=0.05,
    range_scale_std=0.02,
)


def conditioned(m0, P0, F, Q, H, R, Z):
    """Means and covariances of all states given all measurements, by one large Gaussian."""
    n, d = len(F), len(m0)
    means, C = [m0], np.zeros((n * d, n * d))
    C[:d, :d] = P0
    for k in range(1, n):
        means.append(F[k] @ means[-1])
        old, new = slice(0, k * d), slice(k * d, (k + 1) * d)
        C[new, old] = F[k] @ C[(k - 1) * d : k * d, old]
        C[old, new] = C[new, old].T
        C[new, new] = F[k] @ C[(k - 1) * d : k * d, (k - 1) * d : k * d] @ F[k].T + Q[k]
    m, rows = np.concatenate(means), Z.shape[1]
    B = np.zeros((n * rows, n * d))
    for k in range(n):
        B[k * rows : (k + 1) * rows, k * d : (k + 1) * d] = H[k]
    K = np.linalg.solve(B @ C @ B.T + np.kron(np.eye(n), R), B @ C).T
    m, C = m + K @ (Z.ravel() - B @ m), C - K @ B @ C
    return m.reshape(n, d), np.stack([C[k : k + d, k : k + d] for k in range(0, n * d, d)])


def filtered(m, P, F, Q, H, R, Z):
    """Means and covariances of the Kalman filter."""
    for k, z in enumerate(Z):
        if k:
            m, P = F[k] @ m, F[k] @ P @ F[k].T + Q[k]
        K = P @ H[k].T @ np.linalg.inv(H[k] @ P @ H[k].T + R)
        left = np.eye(len(m)) - K @ H[k]
        m, P = m + K @ (z - H[k] @ m), left @ P @ left.T + K @ R @ K.T
        yield m, P


def motion(dt, std):
    """Constant velocity over ``dt``, the acceleration constant within it."""
    F, G = np.eye(4), np.zeros((4, 2))
    F[0, 2] = F[1, 3] = dt
    G[[0, 1], [0, 1]], G[[2, 3], [0, 1]] = dt**2 / 2, dt
    return F, std**2 * STEP / dt * G @ G.T


def test_gaussian_clouds_give_the_smoother():
    """A body with offset, extent, height, scale and two anchors' offsets: 12 variables."""
    rng = np.random.default_rng(2)
    dt, d = np.array([0.0, 0.1, 0.1, 0.25, 0.1, 2.0, 0.1, 0.1]), 12
    F, Q = np.tile(np.eye(d), (8, 1, 1)), np.zeros((8, d, d))
    for k in range(1, 8):
        F[k, :4, :4], Q[k, :4, :4] = motion(dt[k], BODY.acceleration_std)
        walks = np.array([0.02, 0.03, 0.01, 0.02]) ** 2 * dt[k] / STEP
        Q[k, range(4, 8), range(4, 8)] = walks
        Q[k, 8, 8] = BODY.height_walk**2 * dt[k]
        Q[k, [10, 11], [10, 11]] = 0.05**2 * dt[k]
    m0 = np.array([1.0, 2.0, 0.3, 0.1, 0.3, 0.2, 0.4, 0.1, 1.0, 0.0, 0.1, 0.2])
    root = 0.1 * rng.normal(size=(d, d))
    P0 = root @ root.T + 1e-3 * np.eye(d)
    H, R = rng.normal(size=(8, 3, d)), 0.05**2 * np.eye(3)
    Z = np.einsum("kij,j->ki", H, m0) + 0.2 * rng.normal(size=(8, 3))
    first = Belief(HEIGHT, np.zeros(3), np.zeros((3, 3)))
    times = np.rint(np.cumsum(dt) * 1e9).astype(int).tolist()
    records = [
        Record(t, ONE, m[None], P[None], None, t, None)
        for t, (m, P) in zip(times, filtered(m0, P0, F, Q, H, R, Z), strict=True)
    ]
    expected = conditioned(m0, P0, F, Q, H, R, Z)
    later = None
    for k in reversed(range(8)):
        later = back(later, records[k], geo.CIRCLE, BODY, first)
        np.testing.assert_allclose(later.now.m[0], expected[0][k], rtol=0, atol=1e-7)
        np.testing.assert_allclose(later.now.P[0], expected[1][k], rtol=0, atol=1e-7)


def test_what_is_shown_has_the_moments():
    rng = np.random.default_rng(3)
    root = 0.02 * rng.normal(size=(7, 7))
    root[4:6] = 0.0
    m = np.array([1.0, 2.0, 0.3, 0.1, 0.0, 0.0, 1.0])
    params, first = position.Params(max_range=9.0, range_bias_std=0.0), Belief(HEIGHT, *2 * [ANY])
    way = smoother(position.DEVICE.target, params, first, rng)
    _, show = way(None, Record(0, ONE, m[None], (root @ root.T)[None], None, 0, None))
    shown = show()
    assert shown.state_names == ("x", "y", "vx", "vy", "height", "device_x", "device_y")
    np.testing.assert_allclose(shown.state[0], [1, 2, 0.3, 0.1, 1, 1, 2], rtol=0, atol=1e-9)
    kept = [0, 1, 2, 3, 6, 0, 1]
    P = (root @ root.T)[np.ix_(kept, kept)]
    np.testing.assert_allclose(shown.covariance[0], P, rtol=0, atol=1e-9)


def particles(n, rng, heading=False):
    """A cloud of bodies with two anchors' offsets."""
    y = np.zeros((9, n))
    y[:4] = np.array([[1.0], [2.0], [0.5], [-0.4]]) + 0.2 * rng.normal(size=(4, n))
    y[4:6] = np.array([[0.4], [3.1]]) + np.array([[0.02], [0.3]]) * rng.normal(size=(2, n))
    y[6:8] = 0.3 + 0.02 * rng.normal(size=(2, n))
    y[8] = 1.0 + 0.1 * rng.normal(size=n)
    h = 0.7 + 0.5 * y[0] + 0.3 * rng.normal(size=n) if heading else np.zeros(0)
    mean = 0.1 * rng.normal(size=(n, 3)) + y[0, :, None]
    return State(y, np.full(n, 1 / n), mean, np.tile(0.01 * np.eye(3), (n, 1, 1)), 0.0, h)


def test_moments_of_a_cloud_that_is_cut_at_half_a_turn():
    rng = np.random.default_rng(4)
    state = particles(20_000, rng)
    turned = np.angle(np.exp(1j * state.y))
    folded = replace(state, y=np.where(np.arange(9)[:, None] == 5, turned, state.y), hidden=0.4)
    found = record(Step(5, folded, 0.0, 0.0, False, 5), geo.CIRCLE, BODY)
    x = np.vstack((state.y, state.mean.T))
    P = np.cov(x, ddof=0) + np.diag([0.0] * 9 + [0.01] * 3)
    P[4, 4] += 0.02**2 * 4
    P[5, 5] += 0.03**2 * 4
    np.testing.assert_allclose(found.m[0], x.mean(1), rtol=0, atol=1e-3)
    np.testing.assert_allclose(found.P[0], P, rtol=0, atol=1e-3)


MOVED = Increment(
    np.array([0.3, 0.05]), 0.2, np.diag([0.02, 0.03, 0.04]) ** 2 + 1e-5, 0.9, np.nan, np.inf
)


@pytest.mark.parametrize("moved", [None, MOVED])
def test_a_step_ahead_is_that_of_the_filter(moved):
    """Moments of the particles before and after the filter's own prediction.

    A velocity that odometry tells is left out: what it says of before is said by the position.
    """
    n, dt, rng = 200_000, 0.3, np.random.default_rng(5)
    old = particles(n, rng, heading=True)
    new = predict(old, dt, geo.CIRCLE, BODY, rng, HEIGHT, moved)
    new = replace(new, y=new.y.copy())
    # the filter lets the offset walk when it is seen
    new.y[4] += 0.02 * np.sqrt(3) * rng.normal(size=n)
    new.y[5] += 0.03 * np.sqrt(3) * rng.normal(size=n)
    a, b = (np.vstack((s.y, s.heading, s.mean.T)) for s in (old, new))
    b[11:] += 0.05 * np.sqrt(dt) * rng.normal(size=(2, n))
    m, P = a.mean(1), np.cov(a, ddof=0)
    ahead, A, Q = transition(m, P, dt, 9, True, moved, geo.CIRCLE, BODY)
    both = np.cov(np.vstack((a, b)), ddof=0)
    std = np.sqrt(np.diag(both))
    np.testing.assert_allclose(ahead, b.mean(1), rtol=0, atol=5 * std.max() / np.sqrt(n))
    limit, kept = 6 / np.sqrt(n), [0, 1, *([] if moved else [2, 3]), *range(4, 13)]
    scaled = (both[13:, 13:] - A @ P @ A.T - Q) / np.outer(std[13:], std[13:])
    assert np.abs(scaled[np.ix_(kept, kept)]).max() < limit
    scaled = (both[13:, :13] - A @ P) / np.outer(std[13:], std[:13])
    assert np.abs(scaled[kept]).max() < limit


def ranging(p, t, anchors, sigma, rng) -> Recording:
    """A range to each anchor (J, 2) from ``p`` (n, 2) at ``t`` (n,)."""
    n, J = len(t), len(anchors)
    rx = np.tile(np.arange(J), n)
    z = np.linalg.norm(np.repeat(p, J, 0) - anchors[rx], axis=1) + sigma * rng.normal(size=n * J)
    sensors = {f"A{j}": Sensor.static("anchor", a) for j, a in enumerate(anchors)}
    scan = {"mode": np.zeros(n * J, "u1"), "tx": np.full(n * J, J, "i4"), "rx": rx.astype("i4")}
    time_ns = np.repeat(np.rint(t * 1e9).astype(np.int64), J)
    rows = {"distance": z, "std": np.full(n * J, sigma)}
    stream = Stream("uwb", (*sensors, "D"), {}, time_ns, np.arange(n * J + 1), scan, rows)
    return Recording(Meta("tag"), sensors | {"D": Sensor.device()}, {"uwb": stream})


def run(record, seed=1, **settings):
    """Motion (n, 4), its covariance, and what is stated per step."""
    settings = {"learn": [], "range_bias_std": 0.0, "particles": 2000} | settings
    asked = Estimation("position", (("settings", settings),), seed).on(record.setup(), "tag")
    out = list(asked.steps(record.scans()))
    x = np.concatenate([e.objects.columns("x", "y", "vx", "vy") for e in out])
    P = np.concatenate([e.objects.covariance[:, :4, :4] for e in out])
    return x, P, {k: np.concatenate([e.steps[k] for e in out]) for k in out[0].steps}


def test_far_anchors_give_the_smoother():
    """Ranges are linear in the position then: the exact smoother, within the particles' error."""
    n, far, sigma, rng = 40, 1e4, 0.1, np.random.default_rng(7)
    t = np.arange(n) * 0.1
    p = np.stack((0.3 * t, 0.2 * np.sin(t)), 1)
    tag = ranging(p, t, np.array([[far, 0.0], [0.0, far]]), sigma, rng)
    settings = {"particles": 6000, "acceleration_std": 1.0, "mean_clutter": 0.0,
                "area": [-3.0, -3.0, 3.0, 3.0], "max_range": 2 * far}  # fmt: skip
    x, P, _ = run(tag, **settings, smooth="whole")
    F, Q = motion(0.1, 1.0)
    H = np.tile(-np.eye(2, 4), (n, 1, 1))
    Z = tag.streams["uwb"].rows["distance"].reshape(n, 2) - far
    m0, P0 = np.zeros(4), np.diag([3.0, 3.0, 1.0, 1.0])
    m, V = conditioned(m0, P0, *(np.tile(a, (n, 1, 1)) for a in (F, Q)), H, sigma**2 * np.eye(2), Z)
    std = np.sqrt(np.diagonal(V, axis1=1, axis2=2))
    # particles are resampled at each step: what they know of a mean is worth some hundred draws
    assert np.sqrt((((x - m) / std) ** 2).mean()) < 0.1
    own = np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    np.testing.assert_allclose((own / std).mean(0), 1.0, rtol=0, atol=0.05)


CORNERS = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 5.0], [0.0, 5.0]])


def nees(x, P, p):
    e = x[:, :2] - p
    return np.einsum("ni,nij,nj->n", e, np.linalg.inv(P[:, :2, :2]), e)


def one_at_a_time(tag):
    """Of each time's ranges one, the anchors in turn."""
    uwb = tag.streams["uwb"]
    n, J = len(np.unique(uwb.time_ns)), len(uwb.nodes) - 1
    keep = np.flatnonzero(uwb.scan["rx"] == np.repeat(np.arange(n) % J, J))
    rows, scan = ({k: v[keep] for k, v in c.items()} for c in (uwb.rows, uwb.scan))
    one = replace(uwb, time_ns=uwb.time_ns[keep], row_offset=np.arange(n + 1), scan=scan, rows=rows)
    return replace(tag, streams={"uwb": one})


@pytest.mark.parametrize("seed", range(4))
def test_what_was_believed_while_it_was_lost_is_forgotten(seed):
    """A tag that is carried off within no time: found by the filter after a while."""
    rng = np.random.default_rng(seed)
    t = np.arange(160) * 0.05
    p = np.stack((1 + 0.3 * t, 12 + 0.2 * t), 1)
    p[80:] += (14.0, -9.0)
    tag = one_at_a_time(ranging(p, t, 4 * CORNERS, 0.1, rng))
    x, P, steps = run(tag, seed, smooth="whole", max_range=40.0)
    (found,) = np.flatnonzero(steps["sought_anew"])
    y, V, _ = run(tag, seed, max_range=40.0)
    assert (nees(y, V, p)[80:found] > BOUND).all() and found > 81
    assert (nees(x, P, p) > BOUND).sum() <= 1


def test_pauses_and_starts_are_crossed():
    """Two pauses: after each the filter starts anew, from several events where one is not enough"""
    rng = np.random.default_rng(3)
    t = np.concatenate([start + np.arange(60) * 0.05 for start in (0.0, 30.0, 300.0)])
    p = np.stack((3 + 2 * np.cos(0.35 * t), 2.5 + 1.6 * np.sin(0.5 * t)), 1)
    tag = ranging(p, t, CORNERS, 0.1, rng)
    tag = one_at_a_time(tag)
    errors = {}
    for smooth in ("none", "whole"):
        x, P, _ = run(tag, smooth=smooth)
        assert (nees(x, P, p) > BOUND).mean() <= 0.05
        errors[smooth] = np.sqrt(((x[:, :2] - p) ** 2).mean())
    assert errors["whole"] < 0.8 * errors["none"]


def test_the_filter_is_the_same_and_a_long_lag_is_the_whole():
    rng = np.random.default_rng(1)
    t = np.arange(30) * 0.1
    p = np.stack((1 + 0.3 * t, 1 + 0.2 * t), 1)
    tag = ranging(p, t, CORNERS, 0.1, rng)
    found = {s: run(tag, smooth=s) for s in ("none", "whole", "9s", "0.5s")}
    for name in ("evidence", "effective_sample_size"):
        assert len({found[s][2][name].tobytes() for s in found}) == 1
    assert (found["9s"][0] == found["whole"][0]).all()
    last = found["none"][0][-1], found["whole"][0][-1], found["0.5s"][0][-1]
    np.testing.assert_allclose(last[1], last[0], rtol=0, atol=1e-9)
    assert (last[1] == last[2]).all()


def test_what_comes_later_chooses_among_images():
    """Two anchors, and a third that is heard in the end: the mirror image goes, from the start."""
    rng = np.random.default_rng(6)
    t = np.arange(60) * 0.1
    p = np.stack((1 + 0.6 * t, 2 + np.sin(t)), 1)
    tag = ranging(p, t, CORNERS[[0, 1, 2]], 0.1, rng)
    uwb = tag.streams["uwb"]
    keep = np.flatnonzero((uwb.scan["rx"] < 2) | (uwb.time_ns > 5e9))
    rows, scan = ({k: v[keep] for k, v in c.items()} for c in (uwb.rows, uwb.scan))
    uwb = replace(
        uwb, time_ns=uwb.time_ns[keep], row_offset=np.arange(len(keep) + 1), scan=scan, rows=rows
    )
    tag = replace(tag, streams={"uwb": uwb})
    x, P, _ = run(tag, max_range=10.0)
    assert (P[10:40, 1, 1] > 1.0).all()
    x, P, _ = run(tag, max_range=10.0, smooth="whole")
    assert (nees(x, P, p) > BOUND).mean() <= 0.05
    assert np.sqrt(((x[:, :2] - p) ** 2).sum(1).mean()) < 0.1 and P[10:, 1, 1].max() < 0.1


def test_images():
    rng = np.random.default_rng(8)
    w = rng.uniform(0.5, 1.5, 3000)
    p = rng.normal(size=(2, 3000)) * [[2.0], [0.3]]
    assert [len(own) for own in images(p, w)] == [3000]
    assert [len(own) for own in images(np.zeros((2, 5)), np.ones(5))] == [5]
    for share in (0.5, 0.05):
        other = rng.random(3000) < share
        found = images(p + np.where(other, 1.0, 0.0) * [[0.0], [40.0]], w)
        assert sorted(map(len, found)) == sorted([other.sum(), (~other).sum()])
    copies = np.where(np.arange(3000) < 300, p[:, :1] + 40.0, p)
    assert [len(own) for own in images(copies, w)] == [3000]
    which = rng.integers(0, 4, 3000)
    corners = np.array([[0, 0, 30, 30], [0, 40, 0, 40]])
    found = images(p + corners[:, which], w)
    assert sorted(len(set(which[own])) for own in found) == [1, 1, 1, 1]


def paused(data, at, pause):
    """The stream with a pause [ns] after a time."""
    return replace(data, time_ns=np.where(data.time_ns > at, data.time_ns + pause, data.time_ns))


def test_wheels_are_followed_back_to_a_start():
    """The velocity of a start is not that of the odometry, which tells the way back all the same.

    The robot stands still for a minute in which it sees nothing, and starts anew then.
    """
    errors = {"none": [], "whole": []}
    for seed in (2, 3):
        rec = uwb_walk.simulate(uwb_walk.Params(steps=60), np.random.default_rng(seed), "walk")
        p = rec.truth.objects.columns("x", "y")
        streams = {k: paused(s, 30 * 10**9, 60 * 10**9) for k, s in rec.streams.items()}
        rec = replace(rec, streams=streams)
        for smooth, found in errors.items():
            x, *_ = run(rec, particles=1500, smooth=smooth)
            found.append(np.hypot(*(x[:, :2] - p).T))
    for part in (slice(0, 31), slice(31, 60)):
        then, later = (np.sqrt((np.array(found)[:, part] ** 2).mean()) for found in errors.values())
        assert later < 0.8 * then

"""Smoothed trails against least squares over whole trajectories."""

from dataclasses import replace

import numpy as np
import pytest

from echoset.estimators.points import pmb
from echoset.estimators.points.kernels.smoothing import existed, rts
from echoset.estimators.points.trails import Trail, back
from echoset.models.motion import constant_velocity, white_acceleration

N, SIGMA = 12, 1.0
BIRTH = (1.0, 50.0, 50.0, 1.0, -1.0, 3.0, 3.0, 1.0, 1.0)
BASE = {
    "p_detect": 1.0,
    "clutter_rate": 0.0,
    "clutter_region": (-500.0, 500.0, -500.0, 500.0),
    "std_position": SIGMA,
    "p_survive": 1.0,
    "birth": "components",
    "gate": 1e9,
    "acceleration_density": 0.3,
}


def batch(Z, m0, P0, density, seen=None):
    """Means and covariances of all states by one linear system, the joint Gaussian of them.

    ``seen`` are the times of the positions Z; None: all.
    """
    n = len(Z) if seen is None else seen[-1] + 1
    F, _ = constant_velocity(1.0)
    Q = density * white_acceleration(1.0)
    J, h = np.zeros((4 * n, 4 * n)), np.zeros(4 * n)
    J[:4, :4] += np.linalg.inv(P0)
    h[:4] += np.linalg.solve(P0, m0)
    for k in range(1, n):
        A = np.zeros((4, 4 * n))
        A[:, 4 * k - 4 : 4 * k], A[:, 4 * k : 4 * k + 4] = -F, np.eye(4)
        J += A.T @ np.linalg.solve(Q, A)
    for k, z in zip(range(n) if seen is None else seen, Z, strict=True):
        J[4 * k : 4 * k + 2, 4 * k : 4 * k + 2] += np.eye(2) / SIGMA**2
        h[4 * k : 4 * k + 2] += np.ravel(z) / SIGMA**2
    C = np.linalg.inv(J)
    x = (C @ h).reshape(n, 4)
    return x, np.array([C[4 * k : 4 * k + 4, 4 * k : 4 * k + 4] for k in range(n)])


def path(rng, n=N):
    x, F = np.array(BIRTH[1:5]), constant_velocity(1.0)[0]
    L = np.linalg.cholesky(0.3 * white_acceleration(1.0))
    for _ in range(n):
        yield x.copy()
        x = F @ x + L @ rng.normal(size=4)


def run(recording, births=(BIRTH,), **changes):
    params = pmb.Params(**{**BASE, "birth_components": births, **changes})
    return list(pmb.estimate(recording.setup(), recording.scans(), params, None))


def test_one_target_without_clutter_is_the_smoother(make_recording):
    rng = np.random.default_rng(1)
    Z = [x[None, :2] + SIGMA * rng.normal(size=(1, 2)) for x in path(rng)]
    # Births that come again at every scan would be there, too: only the first has weight.
    found = run(make_recording(Z), smooth="whole")
    x, P = batch(Z, np.array(BIRTH[1:5]), np.diag(np.square(BIRTH[5:])), 0.3)
    for k, one in enumerate(found):
        best = one.objects.existence.argmax()
        np.testing.assert_allclose(one.objects.state[best], x[k], atol=1e-6)
        np.testing.assert_allclose(one.objects.covariance[best], P[k], atol=1e-6)


def test_a_step_back_is_the_smoother():
    """Filtered by hand, step by step back: the joint Gaussian to 1e-9."""
    rng = np.random.default_rng(2)
    Z = np.array([x[:2] + SIGMA * rng.normal(size=2) for x in path(rng)])
    F, Q, H = constant_velocity(1.0)[0], 0.3 * white_acceleration(1.0), np.eye(2, 4)
    m, P = np.array(BIRTH[1:5]), np.diag(np.square(BIRTH[5:]))
    trails = []
    for k, z in enumerate(Z):
        if k:
            m, P = F @ m, F @ P @ F.T + Q
        K = P @ H.T @ np.linalg.inv(H @ P @ H.T + np.eye(2))
        m, P = m + K @ (z - H @ m), P - K @ H @ P
        trails.append(
            Trail(k, np.array([7]), np.array([0.2 + 0.05 * k]), m[None], P[None], F, Q, 1.0)
        )
    x, C = batch(Z, np.array(BIRTH[1:5]), np.diag(np.square(BIRTH[5:])), 0.3)
    later = None
    for k in range(N - 1, -1, -1):
        later = back(later, trails[k])
        np.testing.assert_allclose(later.m[0], x[k], atol=1e-9)
        np.testing.assert_allclose(later.P[0], C[k], atol=1e-9)
        assert later.r[0] == pytest.approx(0.2 + 0.05 * (N - 1))


def test_existence_is_that_of_the_chain_by_enumeration():
    """All ends of a target that has been there or not, with likelihoods of what is seen of it."""
    rng = np.random.default_rng(7)
    n, stay, r0 = 6, 0.8, 0.6
    ratio = np.exp(rng.normal(0, 2, n))  # of what is seen at a time, there against not there
    # Dead from the step k on; from 0 on: never there.
    law = np.array([1 - r0] + [r0 * stay ** (k - 1) * (1 - stay) for k in range(1, n)]
                   + [r0 * stay ** (n - 1)])  # fmt: skip
    law = law * np.cumprod(np.append(1.0, ratio))
    law /= law.sum()
    exact = [law[k + 1 :].sum() for k in range(n)]
    r, filtered = r0, []
    for k in range(n):
        r = r * stay if k else r
        r = r * ratio[k] / (1 - r + r * ratio[k])
        filtered.append(r)
    found = np.array([filtered[-1]])
    for k in range(n - 1, -1, -1):
        if k < n - 1:
            found = existed(np.array([filtered[k]]), found, stay)
        assert found[0] == pytest.approx(exact[k], rel=1e-12)


def test_trails_are_paired_by_label_and_begin_and_end():
    rng = np.random.default_rng(3)
    F, Q = constant_velocity(1.0)[0], white_acceleration(1.0)

    def trail(time_ns, label, r):
        n = len(label)
        m, P = rng.normal(size=(n, 4)), np.tile(2 * np.eye(4), (n, 1, 1))
        label = np.array(label, np.int64)
        classes = {int(l): np.array([float(time_ns), int(l)]) for l in label}
        return Trail(time_ns, label, np.array(r), m, P, F, Q, 0.9, classes)

    now, later = trail(0, [2, 5, 9], [0.9, 0.1, 0.4]), trail(1, [3, 5, 9, 11], [0.3, 0.7, 0.2, 0.9])
    found = back(later, now)
    assert found.label.tolist() == [2, 5, 9]
    # Died in between, given that it is not there later: 0.09 of 0.19, 0.01 of 0.91, 0.04 of 0.64.
    np.testing.assert_allclose(
        found.r, [0.09 / 0.19, 0.7 + 0.3 * 0.01 / 0.91, 0.2 + 0.8 * 0.04 / 0.64]
    )
    np.testing.assert_array_equal(found.m[0], now.m[0])
    m, P = rts(now.m[1:], now.P[1:], later.m[1:3], later.P[1:3], F, Q)
    np.testing.assert_array_equal(found.m[1:], m)
    np.testing.assert_array_equal(found.P[1:], P)
    assert {l: int(p[0]) for l, p in found.classes.items()} == {2: 0, 5: 1, 9: 1}
    assert back(None, now) is now
    empty = replace(now, label=now.label[:0], r=now.r[:0], m=now.m[:0], P=now.P[:0], classes={})
    assert not len(back(later, empty).label)
    np.testing.assert_array_equal(back(empty, now).m, now.m)


def test_a_trail_reaches_back_to_its_first_detection_and_bridges_misses(make_recording):
    """Among clutter, from births anywhere: what is late and has gaps when filtered is whole."""
    rng = np.random.default_rng(4)
    x = list(path(rng, 20))
    Z = [x[k][None, :2] + rng.normal(size=(1, 2)) if k not in (8, 9, 10) else [] for k in range(20)]
    scene = {
        "p_detect": 0.7, "clutter_rate": 20.0, "birth": "detections", "births": (),
        "clutter_region": (0.0, 100.0, 0.0, 100.0), "p_survive": 0.95,
    }  # fmt: skip
    filtered = run(make_recording(Z), **scene)
    found = run(make_recording(Z), **scene, smooth="whole")
    assert {len(one.objects.label) for one in filtered} == {0, 1}
    assert [one.objects.label.tolist() for one in found] == [found[0].objects.label.tolist()] * 20
    assert len(found[0].objects.label) == 1
    error = np.array([one.objects.state[0, :2] - x[k][:2] for k, one in enumerate(found)])
    assert np.sqrt((error**2).sum(1).mean()) < 1.4


def test_a_lag_as_long_as_the_recording_is_the_whole(make_recording):
    rng = np.random.default_rng(5)
    Z = [x[None, :2] + rng.normal(size=(3, 2)) * [[1], [30], [30]] for x in path(rng)]
    scene = {"clutter_rate": 2.0, "p_detect": 0.9, "p_survive": 0.99}
    whole, lag, none, short = (
        run(make_recording(Z), **scene, smooth=s, extract_smoothed=0.5)
        for s in ("whole", "60s", "none", "0s")
    )
    for a, b in zip(whole, lag, strict=True):
        np.testing.assert_array_equal(a.objects.state, b.objects.state)
    for a, b in zip(none, short, strict=True):
        np.testing.assert_array_equal(a.objects.state, b.objects.state)
        assert a.steps["cardinality_mean"] == b.steps["cardinality_mean"]

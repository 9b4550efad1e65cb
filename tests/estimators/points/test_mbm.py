"""MBM filter against an enumeration of all associations, the Kalman filter and closed forms."""

import dataclasses
import logging

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from echoset.estimators.points import mbm
from echoset.estimators.points.context import Context
from echoset.estimators.points.kernels import bernoulli
from echoset.estimators.points.kernels.compiled import bernoulli as compiled
from echoset.estimators.points.kernels.smoothing import Epoch, smooth
from echoset.models.checks import check_objects, check_steps
from echoset.models.errors import InputError, ParameterError
from echoset.models.geometry.poses import yaw_quaternion
from echoset.models.parameters import resolve
from echoset.models.records import Sensor

BIRTHS = (
    (0.1, 40.0, 50.0, 0.0, 0.0, 20.0, 20.0, 3.0, 3.0),
    (0.2, 60.0, 50.0, 0.0, 0.0, 10.0, 20.0, 2.0, 3.0),
)
BASE = {
    "p_detect": 0.9,
    "clutter_rate": 5.0,
    "clutter_region": (0.0, 100.0, 0.0, 100.0),
    "std_position": 1.0,
    "birth": "components",
    "birth_components": BIRTHS,
    "poisson": False,
}
EXACT = {
    "gate": 1e9,
    "min_existence": 0.0,
    "min_weight": 1e-200,
    "max_hypotheses": 100_000,
    "merge_distance": 0.0,
    "group_dependence": None,
}
CROSSING = [
    [[40.0, 50.0], [61.0, 49.0], [80.0, 20.0]],
    [[42.0, 50.5], [58.0, 49.5]],
    [],
    [[47.0, 50.0]],
]


def run(recording, **changes):
    params = mbm.Params(**{**BASE, **changes})
    rng = np.random.default_rng(0)
    found = list(mbm.estimate(recording.setup(), recording.scans(), params, rng))
    for one in found:
        check_objects(one.objects, "objects")
        check_steps(one.steps, 1)
    return found


def states(recording, params):
    """The filter's state after every scan."""
    context, state = Context.of(recording.setup(), params), mbm.init()
    for scan in recording.scans():
        state, _ = mbm.step(state, [scan], context)
        yield state


def associations(tracks, detections):
    """All maps from tracks to different detections or to None."""
    if not tracks:
        yield {}
        return
    for rest in associations(tracks[1:], detections):
        yield {tracks[0]: None, **rest}
        for z in detections:
            if z not in rest.values():
                yield {tracks[0]: z, **rest}


def enumeration(scans, params):
    """Every global hypothesis: weight, and (r, m, P) by the history of each track.

    A track is known by when and how it began and by all that it was given; undetected targets of
    the Poisson part are (w, m, P).
    """
    I, H = np.eye(2), np.eye(2, 4)
    F = np.block([[I, I], [0 * I, I]])
    G = np.vstack((0.5 * I, I))
    Q, R = params.std_acceleration**2 * G @ G.T, params.std_position**2 * I
    x0, x1, y0, y1 = params.clutter_region
    kappa = params.clutter_rate / ((x1 - x0) * (y1 - y0))
    p_d, p_s = params.p_detect, params.p_survive

    def updated(m, P, z):
        S = H @ P @ H.T + R
        K = P @ H.T @ np.linalg.inv(S)
        return multivariate_normal.pdf(z, H @ m, S), m + K @ (z - H @ m), P - K @ S @ K.T

    hypotheses, undetected = [(1.0, {})], []
    for k, Z in enumerate(scans):
        A, N = (F, Q) if k else (np.eye(4), 0 * Q)
        new = [(c[0], np.array(c[1:5]), np.diag(np.square(c[5:]))) for c in params.birth_components]
        hypotheses = [
            (w, {h: (p_s * r, A @ m, A @ P @ A.T + N) for h, (r, m, P) in tracks.items()})
            for w, tracks in hypotheses
        ]
        undetected = [(p_s * w, A @ m, A @ P @ A.T + N) for w, m, P in undetected]
        if params.poisson:
            undetected += new
        else:
            for _, tracks in hypotheses:
                tracks.update({((k, b),): c for b, c in enumerate(new)})
        first = []
        for z in Z:
            parts = [
                (p_d * w * q, a, A) for w, m, P in undetected for q, a, A in [updated(m, P, z)]
            ]
            e = sum(p[0] for p in parts)
            if e:
                m = sum(p[0] * p[1] for p in parts) / e
                P = sum(p[0] * (p[2] + np.outer(p[1] - m, p[1] - m)) for p in parts) / e
                first.append((e, m, P))
            else:
                first.append((0.0, None, None))
        children = []
        for w, tracks in hypotheses:
            for given in associations(list(tracks), list(range(len(Z)))):
                weight, after = w, {}
                for h, (r, m, P) in tracks.items():
                    i = given[h]
                    if i is None:
                        weight *= 1 - r * p_d
                        after[(*h, None)] = (r * (1 - p_d) / (1 - r * p_d), m, P)
                    else:
                        q, m, P = updated(m, P, Z[i])
                        weight *= r * p_d * q
                        after[(*h, i)] = (1.0, m, P)
                for i in set(range(len(Z))) - set(given.values()):
                    e, m, P = first[i]
                    weight *= kappa + e
                    if e:
                        after[((k, i),)] = (e / (kappa + e), m, P)
                children.append((weight, after))
        total = sum(w for w, _ in children)
        hypotheses = [(w / total, after) for w, after in children]
        undetected = [((1 - p_d) * w, m, P) for w, m, P in undetected]
        yield hypotheses


@pytest.mark.parametrize(("poisson", "steps"), [(False, 3), (True, 4)])
def test_equals_full_enumeration(make_recording, poisson, steps):
    params = mbm.Params(**{**BASE, **EXACT, "poisson": poisson})
    scans = [np.array(Z).reshape(-1, 2) for Z in CROSSING[:steps]]
    expected = enumeration(scans, params)
    for state, hypotheses in zip(states(make_recording(scans), params), expected, strict=True):
        mixture, a = state.mixture, state.mixture.local
        hypotheses.sort(key=lambda h: -h[0])
        w = np.array([w for w, _ in hypotheses])
        assert mixture.w.shape == (len(w), 1) and (np.diff(w) < -1e-8 * w[1:]).all()
        assert np.allclose(mixture.w[:, 0], w, rtol=1e-9, atol=0)
        for row, (_, tracks) in zip(mixture.table, hypotheses, strict=True):
            mine = sorted((a.r[l], *a.m[l], *a.P[l].ravel()) for l in row if l >= 0)
            theirs = sorted((r, *m, *P.ravel()) for r, m, P in tracks.values())
            assert np.allclose(mine, theirs, rtol=1e-9, atol=1e-9)


def kalman(scans, m, P, q):
    """Filtered means and covariances of one target, and those smoothed by the joint Gaussian."""
    I, H, G = np.eye(2), np.eye(2, 4), np.vstack((0.5 * np.eye(2), np.eye(2)))
    F, Q, n = np.block([[I, I], [0 * I, I]]), q**2 * G @ G.T, len(scans)
    # The joint prior of all states, then one update by all detections.
    mean, joint = [m], np.zeros((n, n, 4, 4))
    joint[0, 0] = P
    for k in range(1, n):
        mean.append(F @ mean[-1])
        joint[k, :k] = F @ joint[k - 1, :k]
        joint[:k, k] = joint[k, :k].swapaxes(1, 2)
        joint[k, k] = F @ joint[k - 1, k - 1] @ F.T + Q
    C = joint.swapaxes(1, 2).reshape(4 * n, 4 * n)
    found = []
    for last in (*range(1, n + 1),):
        A = np.zeros((2 * last, 4 * n))
        for k in range(last):
            A[2 * k : 2 * k + 2, 4 * k : 4 * k + 4] = H
        S = A @ C @ A.T + np.eye(2 * last)
        K = C @ A.T @ np.linalg.inv(S)
        z = np.concatenate([np.ravel(scan) for scan in scans[:last]])
        x = np.concatenate(mean) + K @ (z - A @ np.concatenate(mean))
        V = C - K @ S @ K.T
        found.append(
            (x.reshape(n, 4), np.array([V[i : i + 4, i : i + 4] for i in 4 * np.arange(n)]))
        )
    return found


@pytest.mark.parametrize("lag", [0, 2, 20])
def test_one_certain_target_is_the_kalman_filter_or_smoother(make_recording, lag):
    rng = np.random.default_rng(1)
    scans = [np.array([[50 + 2 * k, 50 - k]]) + rng.normal(size=(1, 2)) for k in range(9)]
    birth = (1.0, 50.0, 50.0, 2.0, -1.0, 5.0, 5.0, 1.0, 1.0)
    # A target is born once, in a unit of time that never passes again.
    steps = run(
        make_recording(scans), p_detect=1.0, clutter_rate=0.0, p_survive=1.0, time_unit=1e9,
        birth_components=(birth,), gate=1e9, std_acceleration=0.7, lag=lag,
    )  # fmt: skip
    found = kalman(scans, np.array(birth[1:5]), np.diag(np.square(birth[5:])), 0.7)
    assert len(steps) == len(scans)
    for k, one in enumerate(steps):
        x, V = found[min(k + lag, len(scans) - 1)]
        assert one.objects.label.tolist() == [0] and one.objects.time_ns[0] == k * 10**9
        assert np.allclose(one.objects.state[0], x[k], rtol=1e-9)
        assert np.allclose(one.objects.covariance[0], V[k], rtol=1e-9, atol=1e-9)
        assert np.allclose(one.objects.existence, 1)
        assert np.allclose(one.steps["cardinality_mean"], 1)


def test_two_sensors_at_a_time_are_one_that_sees_their_mean_better(make_recording):
    rng = np.random.default_rng(2)
    one, two = ([50 + 2 * k + rng.normal(size=(1, 2)) for k in range(6)] for _ in range(2))
    birth = (1.0, 50.0, 50.0, 2.0, 2.0, 5.0, 5.0, 1.0, 1.0)
    changes = {"p_detect": 1.0, "clutter_rate": 0.0, "p_survive": 1.0, "time_unit": 1e9,
        "birth_components": (birth,), "gate": 1e9, "acceleration_density": 1.0}  # fmt: skip
    first, second = make_recording(one), make_recording(two).streams["radar"]
    both = dataclasses.replace(first, streams={"a": first.streams["radar"], "b": second})
    mean = make_recording([(x + y) / 2 for x, y in zip(one, two, strict=True)])
    steps = run(both, **changes), run(mean, std_position=0.5**0.5, **changes)
    assert len(steps[0]) == len(one)
    for a, b in zip(*steps, strict=True):
        assert np.allclose(a.objects.state, b.objects.state, rtol=1e-9)
        assert np.allclose(a.objects.covariance, b.objects.covariance, rtol=1e-9, atol=1e-9)


def test_visibility_is_a_markov_chain_of_two_states(make_recording):
    params = mbm.Params(**{**BASE, "birth_components": (), "clutter_rate": 0.1, "p_survive": 0.97},
        hide_rate=0.3, show_rate=0.2)  # fmt: skip
    start = bernoulli.newborn(np.array([0.6]), np.array([[50.0, 50, 0, 0]]), np.eye(4)[None])
    state = mbm.init()
    mixture = bernoulli.add_tracks(state.mixture, start, np.array([0]), np.ones((1, 1), bool),
                                   np.array([0]))  # fmt: skip
    state = dataclasses.replace(state, mixture=mixture, time_ns=-1_000_000_000)
    recording = make_recording([np.zeros((0, 2))] * 4)
    context = Context.of(recording.setup(), params)
    # States: visible, hidden, gone; five missed detections, the chain by its matrix exponential.
    both = np.exp(-0.5)
    stay = np.array([[0.4 + 0.6 * both, 0.6 - 0.6 * both], [0.4 - 0.4 * both, 0.6 + 0.4 * both]])
    T = np.zeros((3, 3))
    T[:2, :2], T[:2, 2], T[2, 2] = 0.97 * stay, 0.03, 1.0
    p = np.array([0.6, 0.0, 0.4])
    for scan in recording.scans():
        state, _ = mbm.step(state, [scan], context)
        p = (p @ T) * [0.1, 1.0, 1.0]
        p /= p.sum()
        a = state.mixture.local
        assert np.allclose([a.r[0], a.visible[0]], [p[:2].sum(), p[0] / p[:2].sum()], rtol=1e-12)


def line(start, velocity, steps, rng, std=0.5):
    start, velocity = np.array(start), np.array(velocity)
    return [start + velocity * k + std * rng.normal(size=2) for k in range(steps)]


@pytest.mark.parametrize(
    "birth",
    [
        {"birth_components": [(0.01, *c[1:]) for c in BIRTHS]},
        {"birth": "detections", "birth_rate": 0.01},
        {"birth": "detections", "birth_rate": 0.01, "poisson": True},
    ],
)
@pytest.mark.parametrize("extraction", ["existence", "cardinality"])
def test_two_targets_keep_their_labels(make_recording, birth, extraction):
    rng = np.random.default_rng(3)
    paths = [line((30, 40), (1, 0.2), 25, rng), line((70, 60), (-1, -0.3), 25, rng)]
    scans = [[p[k] for p in paths] + [rng.uniform(0, 100, 2)] for k in range(25)]
    scans[12] = scans[12][1:]
    steps = run(make_recording(scans), std_position=0.5, extraction=extraction, clutter_rate=1.0,
        std_acceleration=0.2, **birth)  # fmt: skip
    label = [set(s.objects.label.tolist()) for s in steps]
    assert all(len(l) == 2 for l in label[6:]) and len(set.union(*label[6:])) == 2
    for k in (10, 24):
        assert np.allclose(steps[k].steps["cardinality_mean"], 2, atol=0.5)
        found = steps[k].objects.state[:, :2]
        for p in paths:
            assert np.linalg.norm(found - p[k], axis=1).min() < 2
    assert steps[12].steps["cardinality_variance"][0] > steps[24].steps["cardinality_variance"][0]


def test_poisson_tracks_begin_a_scan_before_bernoulli_births(make_recording):
    rng = np.random.default_rng(5)
    recording = make_recording([[z] for z in line((50, 50), (1, 1), 8, rng)])
    changes = {"birth": "detections", "clutter_rate": 0.01, "extract_existence": 0.8}
    begin = {
        poisson: next(
            k
            for k, s in enumerate(run(recording, poisson=poisson, **changes))
            if len(s.objects.label)
        )
        for poisson in (True, False)
    }
    assert begin == {True: 0, False: 1}


def test_smoothing_shows_tracks_from_their_first_detection_and_through_gaps(make_recording):
    rng = np.random.default_rng(6)
    path = line((20, 20), (2, 1), 20, rng)
    scans = [[z] if k not in (9, 10, 11) else np.zeros((0, 2)) for k, z in enumerate(path)]
    changes = {"birth": "detections", "poisson": True, "extract_existence": 0.9,
        "birth_rate": 0.01, "clutter_rate": 1.0}  # fmt: skip
    counts = {
        lag: [len(s.objects.label) for s in run(make_recording(scans), lag=lag, **changes)]
        for lag in (0, 5)
    }
    assert counts[5] == [1] * 20
    assert counts[0][0] == 0 and 0 in counts[0][9:12]


@pytest.mark.parametrize("lag", [0.0, 3.0, 8.0])
def test_targets_that_end_within_the_lag_are_shown_as_long_as_they_were(make_recording, lag):
    """Detected to the tenth scan, gone for good after it; a second one stays."""
    rng = np.random.default_rng(7)
    paths = [line((20, 20), (2, 1), 24, rng), line((20, 80), (2, 0), 24, rng)]
    scans = [[p[k] for j, p in enumerate(paths) if j or k < 10] for k in range(24)]
    steps = run(make_recording(scans), birth="detections", poisson=True, lag=lag,
        birth_rate=0.01, clutter_rate=0.1, p_survive=0.95)  # fmt: skip
    counts = [len(s.objects.label) for s in steps]
    assert counts[2:10] == [2] * 8 and counts[14:] == [1] * 10
    for k in range(2, 10):
        x = steps[k].objects.state[:, :2]
        assert np.hypot(*(x - paths[0][k]).T).min() < 3


def test_targets_are_shown_before_their_first_detection_if_wanted(make_recording):
    rng = np.random.default_rng(11)
    path = line((20, 20), (2, 1), 14, rng, std=0.1)
    scans = [[z] if k >= 5 else np.zeros((0, 2)) for k, z in enumerate(path)]
    steps = run(
        make_recording(scans), birth="detections", poisson=True, std_position=0.1, lag=9.0,
        retrodict=3.0, std_acceleration=0.01, clutter_rate=0.1,
    )  # fmt: skip
    assert [len(s.objects.label) for s in steps] == [0, 0] + [1] * 12
    for k in (2, 3, 4):
        assert np.linalg.norm(steps[k].objects.state[0, :2] - path[k]) < 1


def test_the_way_back_is_that_of_a_flat_prior():
    rng = np.random.default_rng(13)
    F = np.eye(4) + np.eye(4, k=2)
    root = rng.normal(size=(2, 4, 4))
    P, Q = root[0] @ root[0].T, root[1] @ root[1].T
    new = bernoulli.newborn(np.array([0.3]), rng.normal(size=(1, 4)), P[None])
    none, zero = bernoulli.nothing(4), np.array([0])
    epochs = [
        Epoch(5 * 10**9, none, F, Q, 1.0),
        Epoch(
            7 * 10**9, bernoulli.add_tracks(none, new, zero, np.ones((1, 1), bool), zero), F, Q, 1.0
        ),
    ]
    age, r, m, V = smooth(epochs, np.array([0]))
    flat = 1e9 * np.eye(4)
    K = flat @ F.T @ np.linalg.inv(F @ flat @ F.T + Q + P)
    assert age.tolist() == [-2.0] and r.tolist() == [0.3]
    assert np.allclose(m[0], K @ new.m[0], atol=1e-6)
    assert np.allclose(V[0], np.linalg.inv(np.eye(4) * 1e-9 + F.T @ np.linalg.inv(P + Q) @ F))


def test_tracks_are_given_up_when_not_detected_for_long(make_recording):
    rng = np.random.default_rng(12)
    path = line((50, 50), (0, 0), 6, rng)
    recording = make_recording([[z] for z in path] + [np.zeros((0, 2))] * 8)
    changes = {"birth": "detections", "poisson": True, "hide_rate": 1.0, "show_rate": 0.01}
    counts = [len(s.objects.label) for s in run(recording, max_coast=3.0, **changes)]
    assert counts[5:] == [1, 1, 1, 1, 0, 0, 0, 0, 0]
    assert [len(s.objects.label) for s in run(recording, **changes)][5:] == [1] * 9


def test_what_lies_still_is_left_out_if_wanted(make_recording):
    rng = np.random.default_rng(7)
    paths = [line((30, 40), (1, 0), 20, rng), line((70, 60), (0, 0), 20, rng)]
    recording = make_recording([[p[k] for p in paths] for k in range(20)])
    changes = {"birth": "detections", "poisson": True, "clutter_rate": 0.1}
    all_ = run(recording, **changes)
    moving = run(recording, min_travel=8.0, **changes)
    assert [len(s.objects.label) for s in all_[3:]] == [2] * 17
    assert [len(s.objects.label) for s in moving[12:]] == [1] * 8
    assert np.linalg.norm(moving[-1].objects.state[0, :2] - paths[0][-1]) < 3
    assert not any(len(s.objects.label) for s in moving[:5])
    there = line((30, 40), (1, 0), 15, rng)
    back = run(make_recording([[z] for z in there + there[::-1]]), min_travel=8.0, **changes)
    assert len(back[-1].objects.label) == 1


@pytest.mark.parametrize("unscented", [False, True])
def test_range_and_azimuth_from_a_moving_platform(make_recording, unscented):
    rng = np.random.default_rng(8)
    path = np.array(line((60, 80), (-2, -1), 20, rng, std=0.0))
    time_ns = np.arange(20) * 10**9
    own = np.stack((np.linspace(0, 30, 20), np.linspace(0, -20, 20), np.zeros(20)), 1)
    yaw = np.linspace(3.0, 3.4, 20)
    sensor = Sensor("radar", time_ns, own, yaw_quaternion(yaw))
    v = path - own[:, :2]
    z = np.stack((np.hypot(*v.T), np.arctan2(v[:, 1], v[:, 0]) - yaw), 1)
    z[:, 1] = np.arctan2(np.sin(z[:, 1]), np.cos(z[:, 1]))
    z += rng.normal(size=(20, 2)) * (0.5, 0.005)
    recording = make_recording([row[None] for row in z], kind="range_bearing", sensor=sensor)
    steps = run(
        recording, std_range=0.5, std_azimuth=0.005, clutter_region=(), max_range=200.0,
        birth="detections", poisson=True, unscented=unscented, clutter_rate=0.1,
    )  # fmt: skip
    error = [np.linalg.norm(s.objects.state[0, :2] - x) for s, x in zip(steps, path, strict=True)]
    assert max(error[3:]) < 2.0
    assert len({int(s.objects.label[0]) for s in steps[3:]}) == 1


def random_mixture(rng, tracks=4, copies=3, hypotheses=6):
    """Tracks of several Bernoullis each, in random hypotheses."""
    n = tracks * copies
    root = rng.normal(size=(n, 4, 4))
    P = root @ root.swapaxes(1, 2) + np.eye(4)
    local = bernoulli.newborn(rng.random(n), rng.normal(size=(n, 4)), P)
    table = rng.integers(-1, copies, (hypotheses, tracks))
    table = np.where(table < 0, -1, table + copies * np.arange(tracks))
    w = rng.dirichlet(np.ones(hypotheses))
    return bernoulli.Mixture.whole(local, np.arange(tracks), np.zeros((tracks, 4)), w, table)


def marginals(mixture):
    """Existence, mean and second moment of every track over the hypotheses."""
    a, weight = mixture.local, mixture.w * mixture.existence()
    second = a.P + a.m[:, :, None] * a.m[:, None, :]
    shares = [weight[:, t] for t in range(mixture.table.shape[1])]
    return [
        np.array([np.tensordot(share, x[mixture.table[:, t]], 1) for t, share in enumerate(shares)])
        for x in (np.ones(len(a)), a.m, second)
    ]


def test_merging_keeps_the_moments_of_every_track():
    for seed in range(20):
        mixture = bernoulli.prune(random_mixture(np.random.default_rng(seed)), 0.0, 10)[0]
        merged = bernoulli.merge(mixture, 3.0, 0.5)
        assert len(np.unique(merged.table)) < len(np.unique(mixture.table))
        for before, after in zip(marginals(mixture), marginals(merged), strict=True):
            assert np.allclose(before, after, rtol=1e-12, atol=1e-12)
        far = bernoulli.merge(mixture, 1e-12, 0.0)
        assert np.array_equal(far.table, mixture.table)


def test_twin_groups_as_the_definition_does():
    for seed in range(30):
        rng = np.random.default_rng(seed)
        a = random_mixture(rng, tracks=5, copies=4).local
        visible, weight = rng.random(len(a)), rng.random(len(a))
        track, limits = rng.integers(0, 4, len(a)), (rng.choice([0.0, 2.0, 9.0]), 0.4)
        inputs = (track, weight, a.r, a.m, a.P, visible, *limits)
        for x, y in zip(bernoulli.group(*inputs), compiled.group(*inputs), strict=True):
            assert np.allclose(x, y, rtol=1e-12, atol=1e-12)


def test_uniting_makes_close_tracks_of_the_best_hypothesis_one():
    m = np.array([[0.0, 0, 1, 0], [0.5, 0, 1, 0], [9.0, 0, 0, 0]])
    new = bernoulli.newborn(np.array([0.6, 0.3, 0.8]), m, np.tile(np.eye(4), (3, 1, 1)))
    mixture = bernoulli.Mixture.whole(
        new, np.arange(3), m, np.array([0.7, 0.3]), np.tile(np.arange(3), (2, 1))
    )
    united = bernoulli.prune(bernoulli.unite(mixture, 2.0), 1e-6, 10)[0]
    assert united.label.tolist() == [0, 1, 2]
    assert np.allclose(united.existence(), [[0.9, 0, 0.8], [0.6, 0.3, 0.8]])
    one = united.table[0, 0]
    assert np.allclose(united.local.m[one], [0.5 / 3, 0, 1, 0])
    spread = 1 + 2 / 3 * (0.5 / 3) ** 2 + 1 / 3 * (1 / 3) ** 2
    assert np.allclose(united.local.P[one], np.diag([spread, 1, 1, 1]))


def test_pruning_unites_equal_hypotheses_and_drops_the_unused():
    mixture = random_mixture(np.random.default_rng(4))
    mixture.table[:, 2] = -1
    mixture.local.r[mixture.table[0, 0]] = 1e-9
    pruned = bernoulli.prune(mixture, 1e-6, 10)[0]
    assert pruned.label.tolist() == [0, 1, 3]
    assert np.isclose(pruned.w.sum(), 1) and (np.diff(pruned.w[:, 0]) <= 0).all()
    assert len(np.unique(pruned.table, axis=0)) == len(pruned.w)
    assert sorted(set(pruned.table[pruned.table >= 0])) == list(range(len(pruned.local)))
    for before, after in zip(marginals(mixture), marginals(pruned), strict=True):
        assert np.allclose(before[[0, 1, 3]], after, atol=1e-8)
    expected = mixture.w[:, 0] @ mixture.existence()
    capped = bernoulli.prune(mixture, 1e-6, 2)[0]
    assert capped.label.tolist() == sorted(np.argsort(-expected)[:2])


def test_cardinality_equals_enumeration():
    mixture = random_mixture(np.random.default_rng(9))
    r = mixture.existence()
    rho = np.zeros((len(r), 5))
    for exists in np.ndindex(2, 2, 2, 2):
        e = np.array(exists)
        rho[:, e.sum()] += np.prod(np.where(e, r, 1 - r), axis=1)
    assert np.allclose(bernoulli.cardinality(mixture), rho)
    numbers = mbm._numbers(mixture)
    mean = mixture.w[:, 0] @ rho @ np.arange(5)
    assert np.isclose(numbers["cardinality_mean"][0], mean)
    variance = mixture.w[:, 0] @ rho @ (np.arange(5) - mean) ** 2
    assert np.isclose(numbers["cardinality_variance"][0], variance)


def test_cardinality_extraction_takes_the_likeliest_number():
    one = bernoulli.newborn(np.full(3, 0.45), np.zeros((3, 4)), np.tile(np.eye(4), (3, 1, 1)))
    mixture = bernoulli.Mixture.whole(one, np.arange(3), one.m, np.ones(1), np.arange(3)[None])
    # P(n) = 0.166, 0.408, 0.334, 0.091: one object, though none exists by half.
    params = mbm.Params(**BASE, extraction="cardinality")
    assert len(mbm.extract(mixture, params)[0]) == 1


@pytest.mark.parametrize("poisson", [False, True])
def test_nothing_seen_gives_nothing(make_recording, poisson):
    steps = run(make_recording([np.zeros((0, 2))] * 4), poisson=poisson, birth="detections")
    assert len(steps) == 4 and not any(len(s.objects.label) for s in steps)
    assert run(make_recording([np.zeros((0, 2))]).setup()) == []


def test_detections_outside_the_view_begin_no_track(make_recording):
    recording = make_recording([[[300.0 + k, 0.0], [50.0 + k, 0.0]] for k in range(8)])
    steps = run(recording, birth="detections", poisson=True, max_range=200.0, clutter_region=(),
        clutter_rate=0.1)  # fmt: skip
    assert len(steps[-1].objects.label) == 1 and steps[-1].objects.state[0, 0] < 100


def test_a_crowd_of_detections_is_cut_with_a_warning(make_recording, caplog):
    rng = np.random.default_rng(10)
    path = line((50, 50), (1, 0), 6, rng)
    scans = [np.vstack((z, rng.uniform(0, 100, (10_000 if k == 3 else 5, 2)))) for k, z in
        enumerate(path)]  # fmt: skip
    with caplog.at_level(logging.WARNING):
        steps = run(make_recording(scans), birth="detections", poisson=True)
    said = [record.args[2] for record in caplog.records]
    assert "10001 detections, max_detections" in caplog.text and len(said) == len(set(said))
    assert all(s.steps["tracks"][0] <= 1000 and s.steps["hypotheses"][0] <= 100 for s in steps)


def test_scans_out_of_order_or_twice_are_refused(make_recording):
    recording = make_recording([[[1.0, 1.0]]] * 3)
    params, rng = mbm.Params(**BASE), np.random.default_rng(0)
    scans = list(recording.scans())
    for wrong in (scans[::-1], [scans[0], scans[0]]):
        with pytest.raises(InputError, match="scan"):
            list(mbm.estimate(recording.setup(), wrong, params, rng))


@pytest.mark.parametrize(
    "wrong", [{"extraction": "best"}, {"max_hypotheses": 0}, {"lag": -1}, {"min_existence": 1.0}]
)
def test_impossible_parameters_are_refused(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        resolve(mbm.Params, ("here", {**BASE, **wrong}))

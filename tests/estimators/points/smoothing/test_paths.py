"""Smoothed trajectories of the best global hypothesis against least squares and enumeration."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scene import simulated
from support.births import at_the_first_scan_alone

from echoset.estimators.points import mbm
from echoset.estimators.points.kernels import bernoulli, paths, smoothing
from echoset.estimators.run import Estimation
from echoset.formats.windows import concatenate
from echoset.metrics.run import score
from echoset.models.motion import constant_velocity, white_acceleration

SIGMA, DENSITY = 1.0, 0.3
F, Q, H = constant_velocity(1.0)[0], DENSITY * white_acceleration(1.0), np.eye(2, 4)
BIRTHS = (
    (1.0, 50.0, 50.0, 1.0, -1.0, 3.0, 3.0, 1.0, 1.0),
    (1.0, 51.0, 46.0, 0.8, 0.5, 3.0, 3.0, 1.0, 1.0),
)
BASE = {
    "p_detect": 1.0,
    "clutter_rate": 0.0,
    "clutter_region": (-500.0, 500.0, -500.0, 500.0),
    "std_position": SIGMA,
    "p_survive": 1.0,
    "birth": "components",
    "gate": 1e9,
    "acceleration_density": DENSITY,
    "merge_distance": 0.0,
    "poisson": False,
}


def joint(Z, birth):
    """Means (n, 4) and covariances of all states by one linear system, and the log evidence."""
    n = len(Z)
    m, P = np.array(birth[1:5]), np.diag(np.square(birth[5:]))
    means, S = [m], np.zeros((4 * n, 4 * n))
    S[:4, :4] = P
    for k in range(1, n):
        means.append(F @ means[-1])
        now, before = slice(4 * k, 4 * k + 4), slice(4 * k - 4, 4 * k)
        S[now, : 4 * k] = F @ S[before, : 4 * k]
        S[: 4 * k, now] = S[now, : 4 * k].T
        S[now, now] = F @ S[before, before] @ F.T + Q
    x = np.concatenate(means)
    C = np.kron(np.eye(n), H)
    V = C @ S @ C.T + SIGMA**2 * np.eye(2 * n)
    e = np.ravel(Z) - C @ x
    log_l = -0.5 * (e @ np.linalg.solve(V, e) + np.linalg.slogdet(2 * np.pi * V)[1])
    K = S @ C.T @ np.linalg.inv(V)
    x, S = (x + K @ e).reshape(n, 4), S - K @ C @ S
    return x, np.array([S[4 * k : 4 * k + 4, 4 * k : 4 * k + 4] for k in range(n)]), log_l


def path(rng, birth, n):
    x, L = np.array(birth[1:5]), np.linalg.cholesky(Q)
    for _ in range(n):
        yield x[:2] + SIGMA * rng.normal(size=2)
        x = F @ x + L @ rng.normal(size=4)


def run(recording, **changes):
    params = mbm.Params(**{**BASE, **changes})
    return list(mbm.estimate(recording.setup(), recording.scans(), params, None))


def first_scan_only(monkeypatch):
    """Births at the first scan alone."""
    at_the_first_scan_alone(monkeypatch, mbm)


@pytest.mark.parametrize("poisson", [False, True])
def test_one_target_without_clutter_is_the_smoother(make_recording, monkeypatch, poisson):
    first_scan_only(monkeypatch)
    Z = list(path(np.random.default_rng(1), BIRTHS[0], 12))
    births = BIRTHS[:1]
    found = run(make_recording([z[None] for z in Z]), birth_components=births, smooth="whole",
                poisson=poisson)  # fmt: skip
    x, P, _ = joint(Z, BIRTHS[0])
    for k, one in enumerate(found):
        assert len(one.objects.label) == 1
        np.testing.assert_allclose(one.objects.state[0], x[k], atol=1e-9)
        np.testing.assert_allclose(one.objects.covariance[0], P[k], atol=1e-9)


def test_two_targets_that_cross_by_enumeration_over_the_recording(make_recording, monkeypatch):
    """Of all 2^8 ways to give out the detections the likeliest, each target smoothed in it."""
    first_scan_only(monkeypatch)
    swapped = 0
    for seed in range(4):
        rng = np.random.default_rng(seed)
        Z = np.stack([list(path(rng, birth, 8)) for birth in BIRTHS], 1)
        best = max(
            product([0, 1], repeat=8),
            key=lambda s, Z=Z: sum(
                joint([Z[k, g ^ i] for k, g in enumerate(s)], BIRTHS[i])[2] for i in (0, 1)
            ),
        )
        swapped += len(set(best)) > 1
        found = run(
            make_recording(Z), birth_components=BIRTHS, smooth="whole",
            max_hypotheses=1000, min_weight=1e-200, min_existence=0.0,
        )  # fmt: skip
        paths = [joint([Z[k, g ^ i] for k, g in enumerate(best)], BIRTHS[i])[0] for i in (0, 1)]
        for k, one in enumerate(found):
            mine = one.objects.state[np.argsort(one.objects.label)]
            np.testing.assert_allclose(mine, np.stack(paths)[:, k], atol=1e-8)
    assert swapped


def test_the_dead_stay_with_their_hypothesis(make_recording):
    """One target dies at half time among clutter: it is there until then, under one label."""
    rng = np.random.default_rng(5)
    Z, birth = list(path(rng, BIRTHS[0], 10)), (0.1, *BIRTHS[0][1:])
    clutter = [rng.uniform(0, 100, (3, 2)) for _ in range(30)]
    scans = [np.vstack((Z[k][None], clutter[k])) if k < 10 else clutter[k] for k in range(30)]
    found = run(
        make_recording(scans), birth_components=(birth,), smooth="whole", p_detect=0.9,
        p_survive=0.95, clutter_rate=3.0, clutter_region=(0.0, 100.0, 0.0, 100.0), poisson=True,
        gate=20.0,
    )  # fmt: skip
    assert [len(one.objects.label) for one in found] == [1] * 10 + [0] * 20
    assert len({one.objects.label[0] for one in found[:10]}) == 1
    x, *_ = joint(Z, birth)
    mine = np.array([one.objects.state[0, :2] for one in found[:10]])
    assert np.abs(mine - x[:, :2]).max() < 0.5


def test_tracks_are_followed_back_before_their_first_detection_if_wanted(make_recording):
    Z = list(path(np.random.default_rng(6), BIRTHS[0], 12))
    scans = [z[None] if k >= 4 else np.zeros((0, 2)) for k, z in enumerate(Z)]
    changes = {"birth": "detections", "poisson": True, "clutter_rate": 0.1, "p_detect": 0.9}
    for retrodict, first in ((0.0, 4), (2.0, 2), (9.0, 0)):
        found = run(make_recording(scans), smooth="whole", retrodict=retrodict, **changes)
        assert [len(one.objects.label) for one in found] == [0] * first + [1] * (12 - first)


def test_what_lies_still_is_left_out_if_wanted(make_recording):
    """One that moves, from its first detection on, and not one that lies."""
    rng = np.random.default_rng(9)
    lies = np.array([80.0, 80.0])
    Z = [np.stack((z, lies + rng.normal(size=2))) for z in path(rng, BIRTHS[0], 15)]
    changes = {"birth": "detections", "poisson": True, "clutter_rate": 0.1, "p_detect": 0.9}
    whole = run(make_recording(Z), smooth="whole", **changes)
    moving = run(make_recording(Z), smooth="whole", min_travel=12.0, **changes)
    assert [len(one.objects.label) for one in whole] == [2] * 15
    assert [len(one.objects.label) for one in moving] == [1] * 15
    assert np.linalg.norm(moving[0].objects.state[0, :2] - Z[0][0]) < 3


def test_a_lag_by_either_name(make_recording):
    rng = np.random.default_rng(7)
    Z = [np.vstack((z[None], rng.uniform(0, 100, (2, 2)))) for z in path(rng, BIRTHS[0], 12)]
    changes = {"birth": "detections", "poisson": True, "clutter_rate": 2.0, "p_detect": 0.9}
    one, other = (
        run(make_recording(Z), **changes, **by) for by in ({"lag": 4.0}, {"smooth": "4s"})
    )
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a.objects.state, b.objects.state)


def test_of_hypotheses_that_become_one_the_weightiest_tells_its_past():
    n = 3
    local = bernoulli.newborn(
        np.array([0.9, 1e-9, 0.8]), np.zeros((n, 4)), np.tile(np.eye(4), (n, 1, 1))
    )
    table = np.array([[0, 1], [0, -1], [-1, 2]])
    mixture = bernoulli.Mixture.whole(
        local, np.arange(2), np.zeros((2, 4)), np.array([0.2, 0.5, 0.3]), table
    )
    mixture = mbm.replace(mixture, parent=np.array([[7], [8], [9]]))
    pruned, _ = bernoulli.prune(mixture, 1e-5, 100)
    np.testing.assert_allclose(pruned.w[:, 0], [0.7, 0.3])
    assert pruned.parent[:, 0].tolist() == [8, 9]


def test_every_hypothesis_knows_what_it_was_before(make_recording):
    """Its Bernoullis come from those that its parent had."""
    rng = np.random.default_rng(8)
    Z = [rng.uniform(40, 60, (3, 2)) for _ in range(6)]
    changes = {"birth": "detections", "p_detect": 0.8, "clutter_rate": 2.0, "poisson": True}
    params = mbm.Params(**{**BASE, **changes, "clutter_region": (0.0, 100.0, 0.0, 100.0)})
    context, state = mbm.Context.of(make_recording(Z).setup(), params), mbm.init()
    before, checked = None, 0
    for scan in make_recording(Z).scans():
        state, epoch = mbm.step(state, [scan], context)
        now = epoch.mixture
        if before is not None:
            group = dict(zip(before.label.tolist(), before.group.tolist(), strict=True))
            links = list(zip(now.came.tolist(), now.heir.tolist(), strict=True))
            for t, label in enumerate(now.label.tolist()):
                if label not in group:
                    continue
                link = links.index((group[label], now.group[t]))
                some = np.flatnonzero(now.table[:, t] >= 0)
                at = before.label.tolist().index(label)
                had = before.table[now.parent[some, link], at]
                assert (now.local.origin[now.table[some, t]] == had).all()
                checked += len(some)
        before = now
    assert checked > 50


@pytest.mark.parametrize("max_coast", [0.0, 3.5])
def test_who_is_given_up_ends_with_the_last_detection(make_recording, monkeypatch, max_coast):
    """Without a limit existence falls by what is missed, with it nobody knows when it ended."""
    first_scan_only(monkeypatch)
    rng = np.random.default_rng(3)
    Z = [*(z[None] for z in path(rng, BIRTHS[0], 8)), *[np.zeros((0, 2))] * 8]
    birth = ((0.001, *BIRTHS[0][1:]),)
    found = run(
        make_recording(Z), birth_components=birth, p_detect=0.1, p_survive=0.99,
        clutter_rate=0.01, max_coast=max_coast, smooth="whole", poisson=True, extract_smoothed=0.5,
    )  # fmt: skip
    assert sum(len(one.objects.label) for one in found) == (8 if max_coast else 16)


@pytest.mark.parametrize("smooth", ["none", "whole", "search"])
def test_a_way_without_detections_is_none(make_recording, monkeypatch, smooth):
    """A target is seen on 6 m and missed on 40 m."""
    first_scan_only(monkeypatch)
    Z = [np.array([[50.0 + 2.0 * k, 50.0]]) for k in range(4)] + [np.zeros((0, 2))] * 20
    birth = ((0.01, 50.0, 50.0, 2.0, 0.0, 1.0, 1.0, 1.0, 1.0),)
    shown = {}
    for least in (3.0, 12.0):
        params = mbm.Params(
            **{**BASE, "birth_components": birth, "p_detect": 0.01, "clutter_rate": 0.01,
               "p_survive": 0.999, "poisson": True, "min_travel": least, "smooth": smooth}
        )  # fmt: skip
        recording = make_recording(Z)
        rng = np.random.default_rng(1)
        steps = list(mbm.estimate(recording.setup(), recording.scans(), params, rng))
        shown[least] = sum(len(one.objects.label) for one in steps)
    assert shown[12.0] == 0 < shown[3.0]


def test_groups_that_met_and_parted_keep_their_own_past():
    """Label 3 or 24 is there, and 5 for sure; met and parted, 5 would have had 24 before."""

    def epoch(time_ns, *mixture):
        return smoothing.Epoch(time_ns, bernoulli.Mixture(*mixture), F, Q, 0.99)

    def local(r, origin):
        n = len(r)
        moments = np.zeros((n, 4)), np.tile(np.eye(4), (n, 1, 1))
        return bernoulli.Bernoullis(
            np.array(r), *moments, np.ones(n), np.zeros(n), np.array(origin)
        )

    label, group, table = np.array([3, 5, 24]), np.array([0, 1, 0]), [[-1, 1, 2], [0, -1, -1]]
    w, table = np.array([[0.52, 1.0], [0.48, 0.0]]), np.array(table)
    start, every = np.zeros((3, 4)), np.arange(2)
    first = epoch(0, local([0.99, 1.0, 0.9], [-1, -1, -1]), label, start, w, table, group,
                  np.array([[0, 0], [1, 1]]), every, every)  # fmt: skip
    # Groups 0 and 1 were one, of 3 with its own past and of 5 with the likelier one of the other.
    parent = np.array([[1, 0, 0, 0], [0, 0, 1, 0]])
    came, heir = np.array([0, 1, 0, 1]), np.array([0, 0, 1, 1])
    table = np.array([[0, 1, -1], [-1, -1, 2]])
    last = epoch(10**9, local([0.99, 1.0, 0.9], [0, 1, 2]), label, start, w, table, group, parent,
                 came, heir)  # fmt: skip
    end = paths.back(None, last, 0.0)
    assert sorted(end.label.tolist()) == [3, 5]
    assert sorted(paths.back(end, first, 0.0).label.tolist()) == [3, 5]


@pytest.mark.parametrize("looks_back", [{"smooth": "whole"}, {"lag": 100.0}])
def test_targets_that_meet_are_each_shown_once(looks_back):
    """Told by their marginals, tracks that met would both go back to the same detections."""
    recording = simulated("rendezvous", "rendezvous-s2026-0001", 2026)
    settings = {"poisson": True, "acceleration_density": 0.09, "p_survive": 0.98}
    asked = Estimation("mbm", (("test", settings | looks_back),))
    seen = replace(recording.setup(), truth=None)
    found = concatenate(list(asked.on(seen, "met").steps(recording.scans())))
    table = score("t-gospa", [], found, recording)
    (false,) = (
        value
        for value, part, time in zip(table.value, table.part, table.time, strict=True)
        if part == "false" and np.isnan(time)
    )
    assert false < 0.5

"""Poisson multi-Bernoulli filter against enumeration, the Kalman filter and closed forms."""

import logging
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from echoset.estimators.points import pmb, pmb_filter
from echoset.estimators.points.backlog import Backlog
from echoset.estimators.points.model.sensing import Look
from echoset.estimators.points.pmb_filter import Tracks
from echoset.estimators.points.source import Nothing
from echoset.models import registry
from echoset.models.checks import check_objects, check_steps
from echoset.models.errors import InputError, ParameterError
from echoset.models.geometry.poses import yaw_quaternion
from echoset.models.parameters import resolve
from echoset.models.radar.detection import View
from echoset.models.records import Sensor

REGION = (0.0, 100.0, 0.0, 100.0)
BASE = {
    "p_detect": 0.9,
    "clutter_rate": 5.0,
    "clutter_region": REGION,
    "std_position": 1.0,
    "birth_rate": 0.1,
}
EXACT = {"gate": 1e9, "min_existence": 1e-300}
H = np.eye(2, 4)


def run(recording, **changes):
    params = pmb.Params(**{**BASE, **changes})
    rng = np.random.default_rng(0)
    found = list(pmb.estimate(recording.setup(), recording.scans(), params, rng))
    for one in found:
        check_objects(one.objects, "objects")
        check_steps(one.steps, 1)
    return found


def states(recording, params):
    """The filter's state after every scan."""
    context = pmb.Context.of(recording.setup(), params)
    state = pmb.init(context.params)
    for scan in recording.scans():
        state, _ = pmb.step(state, [scan], context)
        yield state


def kalman(m, P, z, R=1.0):
    """Likelihood of a position and the updated moments."""
    S = H @ P @ H.T + R * np.eye(2)
    K = P @ H.T @ np.linalg.inv(S)
    return multivariate_normal.pdf(z, H @ m, S), m + K @ (z - H @ m), P - K @ S @ K.T


def seen(z, clutter=1e-3, spatial=1e-4, p_detect=0.9, **changes):
    z = np.reshape(np.asarray(z, float), (-1, 2))
    n = len(z)
    pose = np.zeros(2), np.zeros(2), np.eye(2)
    columns = np.full(n, clutter), *pose, View(), p_detect, np.full(n, spatial)
    return replace(Look(False, z, np.eye(2)[None], *columns), **changes)


def start(params, r, m):
    """A state with tracks at m (T, 4) that are not sure of their place, and what waits."""
    m = np.asarray(m, float)
    P = np.array([np.diag([2.0 + t, 3.0, 1.0, 1.0]) for t in range(len(m))])
    P[:, 0, 2] = P[:, 2, 0] = 0.5
    tracks = Tracks(np.arange(len(m)), np.asarray(r, float), m, P)
    return replace(pmb.init(params), tracks=tracks, next_label=len(m), time_ns=0)


def enumerated(state, Z, params, clutter, even, near):
    """Existence and moments of every track, and existence of one begun at each detection.

    Over all joint associations of tracks and detections, but for pairs that are not ``near``.
    """
    a, p = state.tracks, params.p_detect
    hits = {pair: kalman(a.m[pair[0]], a.P[pair[0]], Z[pair[1]]) for pair in near}
    total, new = 0.0, np.zeros(len(Z))
    parts = [[] for _ in range(len(a))]
    for chosen in product(*([None, *(z for s, z in near if s == t)] for t in range(len(a)))):
        used = [z for z in chosen if z is not None]
        if len(set(used)) < len(used):
            continue
        weight = (clutter + even) ** (len(Z) - len(used))
        for t, z in enumerate(chosen):
            weight *= 1 - a.r[t] * p if z is None else a.r[t] * p * hits[t, z][0]
        total += weight
        for t, z in enumerate(chosen):
            there = a.r[t] * (1 - p) / (1 - a.r[t] * p) if z is None else 1.0
            moments = (a.m[t], a.P[t]) if z is None else hits[t, z][1:]
            parts[t].append((weight * there, *moments))
        for z in set(range(len(Z))) - set(used):
            new[z] += weight * even / (clutter + even)
    found = []
    for mine in parts:
        w = sum(q for q, _, _ in mine)
        m = sum(q * x for q, x, _ in mine) / w
        P = sum(q * (C + np.outer(x - m, x - m)) for q, x, C in mine) / w
        found.append((w / total, m, P))
    return found, new / total


@pytest.mark.parametrize("p_detect", [0.6, 0.95])
def test_one_scan_by_enumeration_where_the_graph_is_a_tree(p_detect):
    """Three targets in a row that share detections with their neighbours, and one by itself."""
    params = pmb.Params(**{**BASE, **EXACT, "p_detect": p_detect, "gate": 18.0})
    m = [[10, 10, 1, 0], [18, 10, 0, 1], [27, 10, 0, 0], [80, 80, 0, 0]]
    Z = np.array([[14.0, 10.2], [22.5, 9.5], [30.5, 10.0], [79.0, 80.0], [50.0, 50.0]])
    state = start(params, [0.9, 0.4, 0.99, 0.2], m)
    chain = {(0, 0), (1, 0), (1, 1), (2, 1), (2, 2), (3, 3)}
    look = seen(Z, p_detect=p_detect)
    even = params.birth_rate * p_detect * params.backlog * 1e-4
    expected, new = enumerated(state, Z, params, 1e-3, even, chain)
    after = pmb_filter.update(state, look, params, params)
    assert len(after.tracks) == len(m) + len(Z)
    for t, (r, mean, P) in enumerate(expected):
        assert after.tracks.r[t] == pytest.approx(r, abs=1e-9)
        np.testing.assert_allclose(after.tracks.m[t], mean, atol=1e-9)
        np.testing.assert_allclose(after.tracks.P[t], P, atol=1e-9)
    begun = dict(zip(map(tuple, after.tracks.m[4:, :2]), after.tracks.r[4:], strict=True))
    for z, r in zip(Z, new, strict=True):
        assert begun[tuple(z)] == pytest.approx(r, abs=1e-9)


def test_two_scans_from_places_of_birth_by_enumeration():
    """Nothing known at first: each detection is a target of a Poisson process, or clutter."""
    births = ((0.2, 40.0, 50.0, 1.0, 0.0, 5.0, 5.0, 1.0, 1.0),
              (0.1, 44.0, 50.0, 0.0, 0.0, 4.0, 4.0, 1.0, 1.0))  # fmt: skip
    params = pmb.Params(
        **{**BASE, **EXACT, "birth": "components", "birth_components": births, "p_survive": 0.9}
    )
    look, kappa, p = seen([[41.0, 51.0], [70.0, 20.0]]), 1e-3, 0.9
    state, _ = pmb_filter.predict(pmb.init(params), params, 0)
    after = pmb_filter.update(state, look, params, params)
    w, *_ = after.undetected
    assert w.sum() == pytest.approx(0.3 * (1 - p))
    for z, r, mean, spread in zip(
        look.z, after.tracks.r, after.tracks.m, after.tracks.P, strict=True
    ):
        parts = [
            (p * c[0] * q, x, C)
            for c in births
            for q, x, C in [kalman(np.array(c[1:5]), np.diag(np.square(c[5:])), z)]
        ]
        e = sum(q for q, _, _ in parts)
        centre = sum(q * x for q, x, _ in parts) / e
        around = sum(q * (C + np.outer(x - centre, x - centre)) for q, x, C in parts) / e
        assert r == pytest.approx(e / (kappa + e), rel=1e-9)
        np.testing.assert_allclose(mean, centre, atol=1e-9)
        np.testing.assert_allclose(spread, around, atol=1e-9)
    later, _ = pmb_filter.predict(after, params, 10**9)
    assert later.undetected[0].sum() == pytest.approx(0.3 * 0.1 * 0.9 + 0.3)
    np.testing.assert_allclose(later.tracks.r, 0.9 * after.tracks.r)


def test_one_target_without_clutter_is_the_kalman_filter(make_recording):
    rng, birth = np.random.default_rng(3), (1.0, 50.0, 50.0, 1.0, -1.0, 3.0, 3.0, 1.0, 1.0)
    Z = [50 + np.array([[1.0, -1.0]]) * k + rng.normal(size=(1, 2)) for k in range(8)]
    params = pmb.Params(
        p_detect=1.0, clutter_rate=0.0, clutter_region=REGION, std_position=1.0, p_survive=1.0,
        birth="components", birth_components=(birth,), std_acceleration=0.5, gate=1e9,
    )  # fmt: skip
    I = np.eye(2)
    F, G = np.block([[I, I], [0 * I, I]]), np.vstack((I / 2, I))
    m, P = np.array(birth[1:5]), np.diag(np.square(birth[5:]))
    later = replace(params, birth_components=())
    context = pmb.Context.of(make_recording(Z).setup(), params)
    state = pmb.init(params)
    for k, scan in enumerate(make_recording(Z).scans()):
        state, _ = pmb.step(state, [scan], context)
        context = replace(context, params=later, sensing={"radar": later})
        if k:
            m, P = F @ m, F @ P @ F.T + 0.25 * G @ G.T
        _, m, P = kalman(m, P, Z[k][0])
        assert state.tracks.r[0] == pytest.approx(1.0, abs=1e-9)
        np.testing.assert_allclose(state.tracks.m[0], m, atol=1e-9)
        np.testing.assert_allclose(state.tracks.P[0], P, atol=1e-9)
        assert state.tracks.r[1:].sum() < 1e-9


def test_sure_detections_of_two_targets_are_compared():
    """Without clutter or misses only the two ways to pair them remain, and the likelier counts."""
    params = pmb.Params(**{**BASE, **EXACT, "p_detect": 1.0, "birth_rate": 0.0})
    state = start(params, [1.0, 1.0], [[10, 10, 0, 0], [30, 10, 0, 0]])
    after = pmb_filter.update(
        state, seen([[11.0, 10.0], [29.0, 10.0]], clutter=0.0, p_detect=1.0), params, params
    )
    expected = [kalman(state.tracks.m[t], state.tracks.P[t], z)[1] for t, z in
                enumerate(([11.0, 10.0], [29.0, 10.0]))]  # fmt: skip
    np.testing.assert_allclose(after.tracks.m[:2], expected, atol=1e-6)
    np.testing.assert_allclose(after.tracks.r[:2], 1.0, atol=1e-9)


def test_several_sensors_at_one_time_update_one_after_the_other(make_recording):
    one, other = (make_recording([z]) for z in ([[50.0, 50.0]], [[51.0, 50.0]]))
    both = replace(one, streams={"a": one.streams["radar"], "b": other.streams["radar"]})
    birth = (0.5, 48.0, 50.0, 0.0, 0.0, 3.0, 3.0, 1.0, 1.0)
    (found,) = run(both, birth="components", birth_components=(birth,), extract_existence=0.1)
    _, m, P = kalman(np.array(birth[1:5]), np.diag(np.square(birth[5:])), [50.0, 50.0])
    _, m, _ = kalman(m, P, [51.0, 50.0])
    best = found.objects.existence.argmax()
    np.testing.assert_allclose(found.objects.state[best], m, atol=0.02)
    assert found.objects.existence[best] > 0.99


def test_range_and_azimuth_of_a_turned_radar(make_recording):
    """Near the target a range and an azimuth are a position."""
    place, turn = np.array([[10.0, -20.0, 0.0]]), yaw_quaternion(np.array([0.7]))
    sensor = Sensor("radar", np.zeros(1, np.int64), place, turn)
    where = np.array([110.0, 30.0])
    local = where - (10, -20)
    polar = [[np.hypot(*local), np.arctan2(local[1], local[0]) - 0.7]]
    recording = make_recording([polar] * 6, "range_bearing", sensor=sensor)
    found = run(
        recording, clutter_region=(), max_range=300.0, std_range=1.0, std_azimuth=0.01,
        clutter_rate=1.0,
    )  # fmt: skip
    assert len(found[-1].objects.label) == 1
    np.testing.assert_allclose(found[-1].objects.state[0, :2], where, atol=1e-6)


def test_a_target_out_of_view_is_not_missed(make_recording):
    sensor = Sensor.static("radar", np.zeros(2))
    view = {"view_range_max": np.array([300.0] * 3 + [50.0] * 5)}
    recording = make_recording(
        [[[100.0, 0.3]]] * 3 + [[]] * 5, "range_bearing", sensor=sensor, scan=view
    )
    found = run(recording, clutter_region=(), std_range=1.0, std_azimuth=0.01, p_survive=1.0,
                clutter_rate=0.1)  # fmt: skip
    assert found[-1].objects.existence == pytest.approx(found[2].objects.existence, abs=1e-6)
    whole = make_recording([[[100.0, 0.3]]] * 3 + [[]] * 5, "range_bearing", sensor=sensor)
    found = run(whole, clutter_region=(), std_range=1.0, std_azimuth=0.01, max_range=300.0,
                clutter_rate=0.1)  # fmt: skip
    assert not len(found[-1].objects.label)


def test_what_waits_undetected_is_the_sum_of_what_was_missed():
    p, miss = 0.8, 0.3
    waiting = Backlog(7.0)
    expected = 7.0
    for _ in range(4):
        waiting = waiting.predict(p, 1.0).missed(seen([], p_detect=1 - miss))
        expected = miss * (p * expected + 1)
    np.testing.assert_allclose(waiting.at(np.zeros((2, 2))), expected, rtol=1e-12)
    twice, once = Backlog(7.0).predict(p, 1.0).predict(p, 1.0), Backlog(7.0).predict(p, 2.0)
    assert twice.elsewhere == pytest.approx(once.elsewhere)


def test_births_wait_for_their_first_detection(make_recording):
    """A detection begins a target by what waits there, which every scan before has thinned."""
    Z, params, waiting = [[[50.0, 50.0]], [[20.0, 20.0]], [[80.0, 80.0]]], pmb.Params(**BASE), 100.0
    for state in states(make_recording(Z), params):
        waiting = params.p_survive * waiting + 1
        even = 0.1 * 0.9 * waiting
        assert state.tracks.r[-1] == pytest.approx(even / (even + 5), rel=1e-3)
        waiting *= 0.1


def test_what_waits_where_a_moving_sector_has_looked():
    """By points: each keeps what was missed in the looks that held it, but for its cell's width."""
    rng = np.random.default_rng(5)
    waiting, where = Backlog(10.0), rng.uniform(-400, 400, (3000, 2))
    expected, edge = np.full(3000, 10.0), np.zeros(3000, bool)
    for k in range(6):
        position, c, s = np.array([60.0 * k - 100, 20.0 * k]), np.cos(0.4 * k), np.sin(0.4 * k)
        view = View(-0.8, 0.8, 0.0, 150.0)
        look = seen([], view=view, position=position, rotation=np.array([[c, -s], [s, c]]))
        waiting = waiting.predict(0.9, 1.0).missed(look)
        local = (where - position) @ look.rotation
        inside = view.contains(np.hypot(*local.T), np.arctan2(local[:, 1], local[:, 0]))
        expected = (0.9 * expected + 1) * np.where(inside, 0.1, 1.0)
        edge |= view.distance(local) < 150 / 24
    assert 0.1 < edge.mean() < 0.6 and (expected[~edge] < 9).sum() > 100
    np.testing.assert_allclose(waiting.at(where)[~edge], expected[~edge], rtol=1e-12)


def test_what_waits_in_view_is_the_mean_where_its_clutter_is():
    """By points that are spread like it: a quarter of the view has been looked at before."""
    rng = np.random.default_rng(6)
    before = seen([], view=View(-0.8, 0.0, 0.0, 75.0))
    look = seen([], view=View(-0.8, 0.8, 0.0, 150.0))
    waiting = Backlog(10.0).missed(look).predict(0.9, 1.0).missed(before)
    r, azimuth = rng.uniform(0, 150, 20_000), rng.uniform(-0.8, 0.8, 20_000)
    there = waiting.at(np.stack((r * np.cos(azimuth), r * np.sin(azimuth)), 1))
    # Cells, 6 m wide, count for where their middles are: near the sensor that is coarse.
    assert waiting.mean(look) == pytest.approx(there.mean(), rel=0.1)
    assert waiting.mean(seen([])) == waiting.elsewhere == pytest.approx(10.0)


def test_a_map_of_what_waits_does_not_grow_beyond_bounds(monkeypatch):
    monkeypatch.setattr("echoset.estimators.points.backlog.MOST", 10_000)
    waiting, view = Backlog(10.0), View(range_max=100.0)
    for k in range(20):
        waiting = waiting.missed(seen([], view=view, position=np.array([500.0 * k, 0.0])))
        assert waiting.cells.size <= 10_000
        assert waiting.at(np.array([[500.0 * k, 1.0]])) == pytest.approx(1.0)


def test_births_at_a_limited_number_of_detections(make_recording):
    params = pmb.Params(**{**BASE, "max_births": 2})
    rng = np.random.default_rng(1)
    (state,) = states(make_recording([rng.uniform(0, 100, (9, 2))]), params)
    assert len(state.tracks) == 2
    assert state.next_label == 2


def test_the_most_promising_targets_are_kept(make_recording, caplog):
    """The odds of a detection where it is expected: existence over the area of the place."""
    params = pmb.Params(**{**BASE, "max_tracks": 3})
    state = start(params, [0.5, 0.1, 0.9, 0.3, 0.3], [[10 * t, 0, 0, 0] for t in range(5)])
    area = np.sqrt([np.linalg.det(P[:2, :2]) for P in state.tracks.P])
    expected = np.sort(np.argsort(-state.tracks.r / area)[:3])
    after = pmb_filter.reduce(state, params, 1000)
    assert after.tracks.label.tolist() == expected.tolist()
    lost = state.tracks.r.sum() - after.tracks.r.sum()
    assert after.cut["max_tracks"] == pytest.approx(lost)
    free = replace(params, max_tracks=None)
    assert pmb_filter.reduce(state, free, 0) is state
    rng = np.random.default_rng(1)
    with caplog.at_level(logging.WARNING):
        run(make_recording([rng.uniform(0, 100, (50, 2))] * 5), max_tracks=2)
    assert len(caplog.messages) == 1 and "max_tracks" in caplog.messages[0]


def test_a_crowd_among_as_much_clutter_stays_bounded():
    """Where much overlaps nothing is told apart for long: what is followed does not pile up."""
    crowd = registry.load("echoset.scenarios", "crowd")
    scene = {"targets": 100, "clutter_rate": 100.0, "clutter_region": (-316.0, 316.0) * 2}
    recording = crowd.simulate(crowd.Params(**scene, steps=20), np.random.default_rng(1), "x")
    model = {"std_position": 10.0, "p_detect": 0.95, "clutter_region": scene["clutter_region"]}
    found = run(recording, **model, clutter_rate=100.0, birth_rate=2.0, acceleration_density=0.25)
    assert max(one.steps["tracks"][0] for one in found) <= 500


def test_numbers_and_regions(make_recording):
    Z = [[[20.0, 20.0], [80.0, 80.0]]] * 6
    found = run(make_recording(Z), regions={"A": [0.0, 50.0, 0.0, 50.0]})[-1]
    r = found.objects.existence
    assert found.steps["cardinality_mean"] == pytest.approx(r.sum(), abs=1e-2)
    assert found.steps["region_mean_A"] == pytest.approx(r[0], abs=1e-2)
    assert found.steps["cardinality_variance"] == pytest.approx((r * (1 - r)).sum(), abs=1e-2)
    assert found.steps["tracks"] >= 2


def test_labels_last(make_recording):
    rng = np.random.default_rng(2)
    Z = [rng.normal([(20.0 + k, 20.0), (80.0 - k, 70.0)]) for k in range(20)]
    found = run(make_recording(Z))
    labels = [tuple(one.objects.label) for one in found[4:]]
    assert set(labels) == {labels[0]} and len(labels[0]) == 2


class Made(Nothing):
    """A source that finds one target where no scan has rows, and tells its class by its label."""

    region = REGION

    def see(self, scans, label, where, classes):
        self.z, self.R = np.array([[50.0, 50.0]]), np.eye(2)[None]
        return self

    def recognise(self, label, where, classes):
        found = {int(l): np.log([0.2, 0.8]) for l in label}
        return {**classes, **found}

    def named(self, objects, classes):
        self.told = classes
        return objects


def test_what_a_source_makes_is_followed_and_recognised(make_recording):
    recording = make_recording([[]] * 6)
    params, source = pmb.Params(**BASE), Made()
    *_, last = pmb.run(pmb.Context.of(recording.setup(), params, source), recording.scans())
    (label,) = last.objects.label.tolist()
    np.testing.assert_allclose(last.objects.state[0, :2], 50.0, atol=1e-6)
    assert list(source.told) == [label]


def test_nothing_ever(make_recording):
    found = run(make_recording([[], [], []]))
    assert [len(one.objects.label) for one in found] == [0, 0, 0]


def test_pairs_that_are_cut_are_told_of_once(make_recording, monkeypatch, caplog):
    monkeypatch.setattr("echoset.estimators.points.pairs.MOST", 20)
    Z = [np.full((30, 2), 50.0) + np.arange(30)[:, None] * 0.01] * 3
    with caplog.at_level(logging.WARNING):
        run(make_recording(Z))
    assert len(caplog.messages) == 1 and "pairs" in caplog.messages[0]


def test_what_is_refused(make_recording):
    with pytest.raises(InputError, match="clutter_region or max_range"):
        run(make_recording([[[1.0, 2.0]]]), clutter_region=())
    for wrong in ({"min_existence": 0.0}, {"gate": 0.0}, {"backlog": -1.0}):
        with pytest.raises(ParameterError, match=next(iter(wrong))):
            resolve(pmb.Params, ("here", {**BASE, **wrong}))

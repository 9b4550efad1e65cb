"""PHD filter against a plain textbook version, the Kalman filter, and laws of probability."""

import dataclasses
import time
import tracemalloc

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from echoset.estimators.points import phd
from echoset.estimators.points.context import Context
from echoset.estimators.points.model.measurement import expected
from echoset.estimators.points.model.sensing import look
from echoset.estimators.points.phd_filter import Mixture
from echoset.estimators.points.streams import per_stream, resolved
from echoset.models.checks import check_objects, check_steps
from echoset.models.errors import InputError, ParameterError
from echoset.models.geometry.poses import yaw_quaternion
from echoset.models.parameters import resolve, sensor_model
from echoset.models.records import Sensor, Stream

BIRTH = (0.1, 50.0, 50.0, 0.0, 0.0, 40.0, 40.0, 3.0, 3.0)
BASE = {
    "p_detect": 0.9,
    "clutter_rate": 5.0,
    "clutter_region": (0.0, 100.0, 0.0, 100.0),
    "std_position": 1.0,
    "birth": "components",
    "birth_components": (BIRTH,),
    "gate": 1e9,
}


def run(recording, **changes):
    params = resolve(phd.Params, ("here", {**BASE, **changes}))
    rng = np.random.default_rng(0)
    steps = list(phd.estimate(recording.setup(), recording.scans(), params, rng))
    for step in steps:
        check_objects(step.objects, "objects")
        check_steps(step.steps, 1)
    return steps


def mixtures(recording, params):
    """The filter's reduced mixture after every scan."""
    context, state = Context.of(recording.setup(), params), phd.init()
    for scan in recording.scans():
        state, _ = phd.step(state, [scan], context)
        yield state.mixture


def textbook(scans, params, birth, dt=1.0):
    """Vo and Ma 2006, tables I and II, one component and one detection at a time."""
    I = np.eye(2)
    F = np.block([[I, dt * I], [0 * I, I]])
    G = np.vstack((dt**2 / 2 * I, dt * I))
    Q, R = params.std_acceleration**2 * G @ G.T, params.std_position**2 * I
    H = np.eye(2, 4)
    x0, x1, y0, y1 = params.clutter_region
    kappa = params.clutter_rate / ((x1 - x0) * (y1 - y0))
    p_d, mixture = params.p_detect, []
    for k, Z in enumerate(scans):
        step = F if k else np.eye(4)
        mixture = [
            (params.p_survive * w, step @ m, step @ P @ step.T + (Q if k else 0))
            for w, m, P in mixture
        ]
        mixture += [(c[0], c[1:5], np.diag(c[5:] ** 2)) for c in birth]
        new = [((1 - p_d) * w, m, P) for w, m, P in mixture]
        for z in Z:
            updated = []
            for w, m, P in mixture:
                S = H @ P @ H.T + R
                K = P @ H.T @ np.linalg.inv(S)
                q = multivariate_normal.pdf(z, H @ m, S)
                updated.append((p_d * w * q, m + K @ (z - H @ m), (np.eye(4) - K @ H) @ P))
            total = kappa + sum(w for w, _, _ in updated)
            new += [(w / total, m, P) for w, m, P in updated]
        left = [c for c in new if c[0] > params.prune_weight]
        mixture = []
        while left:
            best = max(left, key=lambda c: c[0])
            d2 = [(c[1] - best[1]) @ np.linalg.inv(c[2]) @ (c[1] - best[1]) for c in left]
            near = [c for c, d in zip(left, d2, strict=True) if d <= params.merge_distance]
            left = [c for c, d in zip(left, d2, strict=True) if d > params.merge_distance]
            w = sum(c[0] for c in near)
            m = sum(c[0] * c[1] for c in near) / w
            P = sum(c[0] * (c[2] + np.outer(m - c[1], m - c[1])) for c in near) / w
            mixture.append((w, m, P))
        mixture = sorted(mixture, key=lambda c: -c[0])[: params.max_components]
        yield mixture


def scene(rng, steps=12, targets=3, clutter=4):
    start = rng.uniform(20, 80, (targets, 2))
    velocity = rng.normal(size=(targets, 2))
    for k in range(steps):
        z = start + k * velocity + rng.normal(size=(targets, 2))
        z = z[rng.random(targets) < 0.9]
        yield rng.permutation(np.vstack((z, rng.uniform(0, 100, (rng.poisson(clutter), 2)))))


@pytest.mark.parametrize("changes", [{}, {"max_components": 7}, {"std_acceleration": 0.2}])
def test_the_mixture_is_the_textbooks(make_recording, changes):
    rng = np.random.default_rng(2)
    params = phd.Params(**{**BASE, **changes})
    scans = list(scene(rng))
    ours = list(mixtures(make_recording(scans), params))
    theirs = list(textbook(scans, params, np.array([BIRTH])))
    for a, b in zip(ours, theirs, strict=True):
        order = np.argsort(-a.w, kind="stable")
        np.testing.assert_allclose(a.w[order], [c[0] for c in b], atol=1e-9)
        np.testing.assert_allclose(a.m[order], [c[1] for c in b], atol=1e-9)
        np.testing.assert_allclose(a.P[order], [c[2] for c in b], atol=1e-9)


def test_certain_detection_of_one_target_is_the_kalman_filter(make_recording):
    rng = np.random.default_rng(3)
    z = np.cumsum(rng.normal(size=(20, 2)) + 1.0, axis=0)
    birth = (1.0, 0.0, 0.0, 1.0, 1.0, 5.0, 5.0, 2.0, 2.0)
    never = {"p_detect": 1.0, "clutter_rate": 0.0, "p_survive": 1.0, "std_position": 1.5}
    params = phd.Params(**{**BASE, **never, "birth_components": (birth,)})
    context = Context.of(make_recording([]).setup(), params)
    only_once = dataclasses.replace(params, birth_components=())
    later = dataclasses.replace(context, params=only_once)
    m, P = np.array(birth[1:5]), np.diag(np.square(birth[5:]))
    F, G = np.eye(4) + np.eye(4, k=2), np.vstack((0.5 * np.eye(2), np.eye(2)))
    H, state = np.eye(2, 4), phd.init()
    for k, scan in enumerate(make_recording(z[:, None]).scans()):
        if k:
            m, P = F @ m, F @ P @ F.T + G @ G.T
        S = H @ P @ H.T + 2.25 * np.eye(2)
        m, P = (
            m + P @ H.T @ np.linalg.solve(S, z[k] - H @ m),
            P - P @ H.T @ np.linalg.solve(S, H @ P),
        )
        state, (estimates, _) = phd.step(state, [scan], later if k else context)
        assert estimates.objects.label.tolist() == [0]
        np.testing.assert_allclose(estimates.objects.state[0], m, atol=1e-9)
        np.testing.assert_allclose(estimates.objects.covariance[0], P, atol=1e-9)
        np.testing.assert_allclose(estimates.objects.existence, 1.0, atol=1e-12)


def polar_rows(x, position, yaw):
    d = x - position
    return np.stack((np.hypot(*d.T), np.arctan2(d[:, 1], d[:, 0]) - yaw), 1)


@pytest.mark.parametrize("unscented", [False, True])
def test_range_and_azimuth_from_a_turned_sensor_find_the_target(make_recording, unscented):
    rng = np.random.default_rng(4)
    position, yaw = np.array([30.0, -40.0]), 2.8
    sensor = Sensor(
        "radar", np.zeros(1, np.int64), np.array([[*position, 0.0]]), yaw_quaternion(yaw)[None]
    )
    path = np.array([10.0, 60.0]) + np.arange(30)[:, None] * [1.5, -2.0]
    true = polar_rows(path, position, yaw)
    noise = rng.normal(size=true.shape) * [1.0, 0.01]
    model = {"std_range": 1.0, "std_azimuth": 0.01, "max_range": 200.0, "clutter_region": ()}
    model["birth_components"] = ((1e-3, *BIRTH[1:]),)
    z = [row[None] for row in true + noise + [0, 2 * np.pi] * rng.integers(-1, 2, (30, 1))]
    steps = run(
        make_recording(z, "range_bearing", sensor=sensor), unscented=unscented,
        std_acceleration=0.1, **model,
    )  # fmt: skip
    for step, x in zip(steps[5:], path[5:], strict=True):
        P = step.objects.covariance[0]
        e = step.objects.state[0, :2] - x
        assert len(step.objects.label) == 1
        assert e @ np.linalg.solve(P[:2, :2], e) < 25
    assert np.sqrt(P[0, 0]) < 1.0


def test_extended_moments_are_the_unscented_ones_far_away(make_recording):
    """A small covariance far from the sensor: the measurement is nearly linear."""
    z = [np.array([[100.0, 0.3]])]
    model = {"std_range": 1.0, "std_azimuth": 0.01, "max_range": 200.0, "clutter_region": ()}
    recording = make_recording(z, "range_bearing")
    params = phd.Params(**{**BASE, **model})
    seen = look(params, next(recording.scans()), True, recording.sensors["radar"])
    m, P = np.array([[80.0, 40.0, 1.0, 2.0]]), 1e-4 * (np.eye(4) + 0.3)[None]
    for a, b in zip(expected(seen, m, P, False), expected(seen, m, P, True), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-5, atol=1e-8)


def test_nothing_is_learnt_where_the_sensor_does_not_look(make_recording):
    view = {"view_azimuth_min": np.full(2, 1.0), "view_azimuth_max": np.full(2, 1.5)}
    recording = make_recording([[], []], "range_bearing", scan=view)
    model = {"std_range": 1.0, "std_azimuth": 0.01, "max_range": 200.0, "clutter_region": ()}
    away, by_mean = (80.0, 0.0, 0.0, 0.0), {"p_survive": 1.0, "std_acceleration": 0.0, **model}
    c = (1.0, *away, 5.0, 5.0, 0.1, 0.1)
    steps = run(recording, birth_components=(c,), **by_mean)
    assert [s.steps["cardinality_mean"][0] for s in steps] == pytest.approx([1.0, 2.0])
    edge = (1.0, 80 * np.cos(1.0), 80 * np.sin(1.0), 0.0, 0.0, 5.0, 5.0, 0.1, 0.1)
    half = run(recording, birth_components=(edge,), fov_mass=True, **by_mean)
    assert half[0].steps["cardinality_mean"][0] == pytest.approx(1 - 0.9 / 2, abs=2e-3)


def test_targets_die_outside_the_scene(make_recording):
    recording = make_recording([[], []])
    c = (1.0, 99.0, 50.0, 5.0, 0.0, 1.0, 1.0, 0.1, 0.1)
    once = {"p_detect": 0.0, "p_survive": 1.0, "birth_components": (c,)}
    kept = run(recording, **once)
    assert kept[1].steps["cardinality_mean"][0] == pytest.approx(2.0)
    lost = run(recording, scene=(0.0, 98.0, 0.0, 100.0), **once)
    assert lost[1].steps["cardinality_mean"][0] == pytest.approx(1.0)


def test_rates_per_time_do_not_depend_on_the_scans(make_recording):
    c = (0.2, 50.0, 50.0, 0.0, 0.0, 1.0, 1.0, 0.1, 0.1)
    quiet = {"p_detect": 0.0, "p_survive": 0.8, "time_unit": 1.0, "birth_components": (c,)}
    slow = run(make_recording([[]] * 2, dt=1.0), **quiet)
    start = slow[0].steps["cardinality_mean"][0]
    assert slow[1].steps["cardinality_mean"][0] == pytest.approx(0.8 * start + 0.2)
    fast = run(make_recording([[]] * 3, dt=0.5), **quiet)
    root = np.sqrt(0.8)
    half = 0.2 * (1 - root) / (1 - 0.8)
    expected = (start * root + half) * root + half
    assert expected == pytest.approx(0.8 * start + 0.2)
    assert fast[2].steps["cardinality_mean"][0] == pytest.approx(expected)


def test_regions_add_up_and_follow_the_number_of_targets(make_recording):
    rng = np.random.default_rng(5)
    halves = {
        "west": (-500, 50, -500, 600),
        "east": (50, 600, -500, 600),
        "all": (-500, 600, -500, 600),
    }
    for step in run(make_recording(list(scene(rng))), regions=halves):
        s = {key: value[0] for key, value in step.steps.items()}
        assert s["region_mean_west"] + s["region_mean_east"] == pytest.approx(s["region_mean_all"])
        assert s["region_mean_all"] == pytest.approx(s["cardinality_mean"], abs=1e-6)
        assert s["region_variance_all"] == pytest.approx(s["cardinality_variance"], abs=1e-6)
        # Covariances of the halves are negative: a detection's target is in one of them.
        assert (
            s["region_variance_west"] + s["region_variance_east"] > s["region_variance_all"] - 1e-9
        )


def test_labels_follow_targets_and_are_unique(make_recording):
    rng = np.random.default_rng(6)
    a = np.array([20.0, 20.0]) + np.arange(25)[:, None] * [1.0, 0.0]
    b = np.array([20.0, 70.0]) + np.arange(25)[:, None] * [1.0, 0.0]
    scans = [np.stack(pair) + 0.5 * rng.normal(size=(2, 2)) for pair in zip(a, b, strict=True)]
    steps = run(make_recording(scans), clutter_rate=0.5)
    labels = [frozenset(s.objects.label.tolist()) for s in steps[3:]]
    assert len(set(labels)) == 1 and len(labels[0]) == 2
    one = {"p_detect": 0.0, "birth_components": ((2.6, 50.0, 50.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0),)}
    heavy = run(make_recording([[]]), **one)[0]
    assert len(set(heavy.objects.label.tolist())) == 3
    rounded = run(make_recording([[]]), extraction="rounding", **one)[0]
    assert len(rounded.objects.label) == 1


def test_births_at_detections_start_targets(make_recording):
    rng = np.random.default_rng(7)
    path = np.array([20.0, 30.0]) + np.arange(10)[:, None] * [2.0, 1.0]
    recording = make_recording([x[None] + rng.normal(size=(1, 2)) for x in path])
    steps = run(recording, birth="detections", clutter_rate=1.0)
    assert len(steps[0].objects.label) == 0
    assert len(steps[-1].objects.label) == 1
    assert np.hypot(*(steps[-1].objects.state[0, :2] - path[-1])) < 4.5


def test_births_along_an_edge(make_recording):
    edge = {"birth": "edge", "birth_edge": (0.0, 10.0, 0.0, 90.0), "birth_velocity": (2.0, 0.0)}
    step = run(make_recording([[]]), p_detect=0.0, birth_rate=3.0, regions={
        "all": (-50, 50, -50, 150), "south": (-50, 50, -50, 50)}, **edge)[0].steps  # fmt: skip
    assert step["region_mean_all"][0] == pytest.approx(3.0, abs=1e-3)
    assert step["region_mean_south"][0] == pytest.approx(1.5, abs=1e-3)


def test_variants(make_recording):
    recording = make_recording([[], []])
    assert run(recording, drop_missed_births=True)[1].steps["cardinality_mean"][0] == 0.0
    two = {"p_detect": 0.0, "p_survive": 1.0, "birth_components": ((0.9, *BIRTH[1:]),)}
    assert run(recording, **two)[1].steps["components"][0] == 1
    state = list(mixtures(recording, phd.Params(**{**BASE, **two, "cap_merged_weight": True})))
    assert state[1].w.tolist() == [1.0]


def test_reduction_caps_before_merging_and_merges_by_distance(make_recording):
    w, m = np.array([0.9, 0.8, 0.1]), np.array([[0, 0, 0, 0], [9, 0, 0, 0], [0.5, 0, 0, 0]], float)
    x = Mixture(w, m, np.tile(0.01 * np.eye(4), (3, 1, 1)), np.arange(3), np.arange(3))
    merged = {**BASE, "merge_by": "none", "merge_distance": 1.0, "max_components": 2}
    assert phd.reduce(x, phd.Params(**merged))[0].w == pytest.approx([1.0, 0.8])
    first = phd.Params(**merged, cap_before_merge=True)
    assert phd.reduce(x, first)[0].w == pytest.approx([0.9, 0.8])


def test_two_sensors_with_models_of_their_own(make_recording):
    one = make_recording([[[30.0, 70.0]]] * 5, model={"p_detect": 0.9, "std_position": 1.0})
    other = make_recording([[[-10.0, 70.0]]] * 5, model={"p_detect": 0.5, "std_position": 2.0})
    both = dataclasses.replace(
        one,
        sensors={**one.sensors, "mast": Sensor.static("radar", np.array([40.0, 0.0]))},
        streams={
            "radar": one.streams["radar"],
            "mast": dataclasses.replace(other.streams["radar"], nodes=("mast",)),
        },
    )
    rest = {k: v for k, v in BASE.items() if k not in ("p_detect", "std_position")}

    def resolve_with(**changes):
        layers = (("rest", rest), ("--set", changes))
        stated = sensor_model(both, phd.Params)
        return per_stream(resolved(phd.Params, both, stated, layers), both)

    own = resolve_with()
    assert (own["mast"].p_detect, own["radar"].p_detect) == (0.5, 0.9)
    for p in (0.5, 0.9, 0.90001):
        assert {v.p_detect for v in resolve_with(p_detect=p).values()} == {p}
    said = resolve_with(p_detect=0.7, sensors={"mast": {"std_position": 3}})
    assert (said["mast"].p_detect, said["mast"].std_position) == (0.7, 3.0)
    steps = run(both, merge_by="leader", sensors={"mast": {"p_detect": 0.5, "std_position": 2.0}})
    assert len(steps) == 5
    assert np.hypot(*(steps[-1].objects.state[0, :2] - [30.0, 70.0])) < 0.1


def test_noise_stated_for_every_detection(make_recording):
    recording = make_recording([[[50.0, 50.0], [20.0, 30.0]]])
    stream = recording.streams["radar"]
    rows = {"cov_xx": np.array([1.0, 4.0]), "cov_xy": np.zeros(2), "cov_yy": np.array([1.0, 9.0])}
    recording = dataclasses.replace(
        recording, streams={"radar": dataclasses.replace(stream, rows={**stream.rows, **rows})}
    )
    params = phd.Params(**{**BASE, "std_position": 0.0})
    mixture = next(mixtures(recording, params))
    far = mixture.P[np.argmin(np.hypot(*(mixture.m[:, :2] - [20.0, 30.0]).T))]
    prior = 1600.0
    assert far[0, 0] == pytest.approx(1 / (1 / prior + 1 / 4))
    assert far[1, 1] == pytest.approx(1 / (1 / prior + 1 / 9))
    bad = {**rows, "cov_xy": np.array([0.0, 7.0])}
    broken = dataclasses.replace(
        recording, streams={"radar": dataclasses.replace(stream, rows={**stream.rows, **bad})}
    )
    with pytest.raises(InputError, match="positive definite"):
        run(broken)


def test_what_is_missing_or_wrong_is_said(make_recording):
    recording = make_recording([[[1.0, 1.0]]])
    with pytest.raises(InputError, match="std_position"):
        run(recording, std_position=0.0)
    with pytest.raises(InputError, match="clutter_region"):
        run(recording, clutter_region=())
    with pytest.raises(ParameterError, match="extraction"):
        run(recording, extraction="all")
    with pytest.raises(ParameterError, match=r"regions\.B1"):
        run(recording, regions={"B1": [3, 1, 0, 1]})
    stream = recording.streams["radar"]
    twice = Stream("position", ("radar",), {}, np.zeros(2, np.int64), np.zeros(3, np.int64), {},
                   {key: v[:0] for key, v in stream.rows.items()})  # fmt: skip
    with pytest.raises(InputError, match="two of one stream"):
        run(dataclasses.replace(recording, streams={"radar": twice}))
    back = dataclasses.replace(twice, time_ns=np.array([5, 3]))
    with pytest.raises(InputError, match="out of order"):
        run(dataclasses.replace(recording, streams={"radar": back}))


def test_no_scans_and_scans_without_detections(make_recording):
    assert run(dataclasses.replace(make_recording([[]]), streams={})) == []
    steps = run(make_recording([[], [], []]))
    assert [len(s.objects.label) for s in steps] == [0, 0, 0]


def test_a_crowd_of_detections_is_told_and_bounded(make_recording, caplog):
    rng = np.random.default_rng(8)
    crowd = make_recording([rng.uniform(0, 100, (10_000, 2))] * 2)
    steps = run(crowd, birth="detections", clutter_rate=10_000.0, gate=25.0)
    assert steps[-1].steps["components"][0] <= 100
    assert "10000 detections" in caplog.text


def test_a_crowd_that_every_component_explains_is_merged_in_seconds(make_recording, caplog):
    """Wide births everywhere: each of 10,000 detections has likely components from many."""
    grid = np.arange(5.0, 100.0, 10.0)
    parts = tuple((0.1, x, y, 0.0, 0.0, 30.0, 30.0, 5.0, 5.0) for x in grid for y in grid)
    crowd = np.random.default_rng(9).uniform(0, 100, (10_000, 2))
    tracemalloc.start()
    start = time.process_time()
    (step,) = run(
        make_recording([crowd]), birth_components=parts, max_components=100,
        regions={"left": (0.0, 50.0, 0.0, 100.0)},
    )  # fmt: skip
    assert time.process_time() - start < 10
    assert tracemalloc.get_traced_memory()[1] < 2**30
    tracemalloc.stop()
    assert step.steps["components"][0] <= 100
    assert "10000 detections" in caplog.text


def test_detections_outside_the_view_are_clutter(make_recording):
    view = {
        "view_azimuth_min": np.full(1, -0.5),
        "view_azimuth_max": np.full(1, 0.5),
        "view_range_min": np.zeros(1),
        "view_range_max": np.full(1, 100.0),
    }
    model = {"std_range": 1.0, "std_azimuth": 0.01, "clutter_region": ()}
    model["birth_components"] = ((0.5, 80.0, 0.0, 0.0, 0.0, 10.0, 10.0, 0.1, 0.1),)
    inside, outside = [80.0, 0.0], [50.0, 2.0]
    alone, both = (
        run(make_recording([z], "range_bearing", scan=view), **model)[0]
        for z in ([inside], [inside, outside])
    )
    assert len(both.objects.label) == 1
    np.testing.assert_array_equal(both.objects.state, alone.objects.state)


def test_a_certain_detection_and_two_targets_by_enumeration(make_recording):
    """One detection, two components far apart: only one of them can have made it."""
    first = (0.4, 20.0, 20.0, 0.0, 0.0, 2.0, 2.0, 1.0, 1.0)
    second = (0.3, 80.0, 80.0, 0.0, 0.0, 2.0, 2.0, 1.0, 1.0)
    recording = make_recording([[[20.0, 20.0]]])
    regions = {"near": (0.0, 50.0, 0.0, 50.0), "far": (50.0, 100.0, 50.0, 100.0)}
    step = run(recording, birth_components=(first, second), regions=regions)[0].steps
    likelihood = 0.9 * 0.4 / (2 * np.pi * (1.0 + 4.0))
    q = likelihood / (likelihood + 5.0 / 100.0**2)
    assert step["region_mean_near"][0] == pytest.approx(0.04 + q)
    assert step["region_variance_near"][0] == pytest.approx(0.04 + q * (1 - q))
    assert step["region_mean_far"][0] == pytest.approx(0.03)
    assert step["region_variance_far"][0] == pytest.approx(0.03)

"""Targets seen in simulated maps, from all sides and in odd recordings."""

from dataclasses import replace
from itertools import groupby

import numpy as np
import pytest
from support.straight import straight

import echoset
from echoset.campaign.scenarios import find
from echoset.estimators.maps.tbd import filter as tbd
from echoset.estimators.maps.tbd.scene import Layout, View
from echoset.estimators.maps.tbd.targets import Targets, predict, update
from echoset.models.checks import check_objects, check_steps
from echoset.models.errors import InputError
from echoset.models.parameters import resolve
from echoset.models.random import generator
from echoset.simulate import jsc


def simulated(seed=1, **changes):
    params = resolve(jsc.Params, *find("jsc-6bs").layers, ("here", changes))
    return jsc.simulate(params, generator(seed, "tbd", "r"), "r")


def run(recording, **changes):
    steps = list(tbd.estimate(recording.setup(), recording.scans(), tbd.Params(**changes), None))
    for step in steps:
        check_objects(step.objects, "objects")
        check_steps(step.steps, 1)
    return steps


def true_at(recording, k):
    o = recording.truth.objects
    rows = slice(o.row_offset[k], o.row_offset[k + 1])
    return o.state[rows], o.class_index[rows], o.rotation[rows]


@pytest.fixture(scope="module")
def recording():
    return simulated(scans=14)


def test_kernels_are_given_whole_targets(recording, monkeypatch):
    """Compiled code reads entries that are not there without a word."""
    lengths = set()

    def fit(view, rest, kind, target, *rest_of_it):
        lengths.add(len(target))
        return plain(view, rest, kind, target, *rest_of_it)

    plain = View.fit
    monkeypatch.setattr(View, "fit", fit)
    next(tbd.estimate(recording.setup(), recording.scans(), tbd.Params(), None))
    assert lengths == {7}


def test_a_vehicle_held_by_one_end_finds_the_other():
    """One 6.6 m long that is taken, and surely, for one of 4.7 m at its front; within 50 scans."""
    place, size = np.array([2.0, 1.0]), np.log(6.6 / 4.5)
    body = {"vehicle_length": 6.6, "vehicle_width": 1.8 * np.exp(size)}
    recording = straight([1], [place], [0.3], [0.0], 1, scans=50, **body)
    params = tbd.Params()
    layout = Layout.of(recording.setup(), list(recording.streams), params)
    x, y = place + 0.93 * np.array([np.cos(0.3), np.sin(0.3)])
    P = np.diag([0.02, 0.02, 0.1, 0.1, 0.01, 0.1, 0.01])[None] ** 2
    sure, one = np.array([10.0]), np.array([1])
    m = np.array([[x, y, 0.0, 0.0, 0.3, 0.0, 0.05]])
    held = Targets(m, P, one, sure, sure, np.array([0]), np.array([40]))
    for _, scans in groupby(recording.scans(), key=lambda scan: scan.time_ns):
        view = View.of(layout, list(scans), recording.setup())
        view = view.shown(held.kind, held.vectors)
        held = predict(held, params, 0.05)
        held, _ = update(held, view, view.mean(held.kind, held.vectors), params)
    assert np.hypot(*(held.m[0, :2] - place)) < 0.2
    assert abs(held.m[0, 6] - size) < 0.1


def test_bodies_that_differ_widen_the_covariances_of_vehicles(recording):
    """By their variance along both axes; nothing else changes."""
    plain, wide = (run(recording, std_body=std)[-1].objects for std in (0.0, 0.08))
    np.testing.assert_array_equal(wide.state, plain.state)
    more = wide.covariance - plain.covariance
    for kind, added in zip(plain.class_index.tolist(), more, strict=True):
        np.testing.assert_allclose(added, np.diag([0.0064 * kind] * 2 + [0.0] * 2), atol=1e-15)
    assert 0 < plain.class_index.sum() < len(plain.class_index)


def test_all_are_found_with_their_classes(recording):
    """After eight scans all eight and no more, half of them within 0.1 m, with labels that stay."""
    steps = run(recording)
    labels = set()
    for k, step in enumerate(steps[8:], 8):
        state, kind, _ = true_at(recording, k)
        offset = step.objects.state[:, None, :2] - state[:, :2]
        d = np.hypot(offset[..., 0], offset[..., 1])
        assert d.shape == (8, 8)
        assert (d.min(0) < 0.5).all() and np.median(d.min(0)) < 0.1
        assert len(set(d.argmin(0))) == 8
        assert (step.objects.class_index[d.argmin(0)] == kind).all()
        labels.add(tuple(sorted(step.objects.label.tolist())))
    assert len(labels) == 1
    speed = step.objects.state[d.argmin(0), 2:] - state[:, 2:]
    assert np.median(np.hypot(*speed.T)) < 1.0
    assert step.steps["cardinality_mean"][0] == pytest.approx(8, abs=0.1)


@pytest.mark.parametrize("eirp", [20.0, 30.0, 50.0])
def test_places_do_not_depend_on_the_power(eirp):
    """Within 0.06 m in the mean over scans, pedestrians and vehicles, and no sidelobe is one."""
    recording = simulated(seed=3, scans=16, eirp=eirp)
    for k, step in enumerate(run(recording)[10:], 10):
        state, _, _ = true_at(recording, k)
        d = np.hypot(*(step.objects.state[:, None, :2] - state[:, :2]).T)
        assert d.shape == (8, 8) and d.min(1).mean() < 0.06


def test_noise_alone_and_maps_of_nothing():
    empty = simulated(scans=3, pedestrians=0, vehicles=0)
    assert [len(s.objects.label) for s in run(empty)] == [0, 0, 0]
    dark = {
        name: replace(s, scan={"map": np.zeros_like(s.scan["map"])})
        for name, s in empty.streams.items()
    }
    assert [len(s.objects.label) for s in run(replace(empty, streams=dark))] == [0, 0, 0]


def test_stations_on_masts_anywhere_and_maps_in_another_unit():
    there = {"stations": [[-40, 3, 0.1], [5, -38, 1.4], [30, 25, -2.4]], "station_height": 8.0}
    recording = simulated(scans=6, pedestrians=2, vehicles=1, **there)
    streams = {
        name: replace(
            s,
            scan={"map": s.scan["map"] * np.float32(1e-9)},
            model={**s.model, "noise_power": 1e-9},
        )
        for name, s in recording.streams.items()
    }
    for found in (run(recording), run(replace(recording, streams=streams))):
        state, kind, _ = true_at(recording, 5)
        d = np.hypot(*(found[-1].objects.state[:, None, :2] - state[:, :2]).T)
        assert d.shape == (3, 3) and (d.min(1) < 0.3).all()
        assert (found[-1].objects.class_index[d.argmin(1)] == kind).all()


def test_the_step_is_a_pure_function(recording):
    params, setup = tbd.Params(), recording.setup()
    layout = Layout.of(setup, list(recording.streams), params)
    scans = [s for s in recording.scans() if s.time_ns == 50_000_000]
    start = tbd.init(layout)
    a, b = (tbd.step(start, scans, layout, setup, params) for _ in range(2))
    np.testing.assert_array_equal(a.targets.m, b.targets.m)
    assert len(start.targets) == 0 and not start.evidence.any() and len(a.targets) >= 8
    again = [tbd.step(a, scans, layout, setup, params) for _ in range(2)]
    np.testing.assert_array_equal(again[0].targets.m, again[1].targets.m)
    np.testing.assert_array_equal(again[0].evidence, again[1].evidence)


def test_stations_that_are_not_synchronous(recording):
    apart = {
        name: replace(s, time_ns=s.time_ns + 8_000_000 * k)
        for k, (name, s) in enumerate(recording.streams.items())
    }
    steps = run(replace(recording, streams=apart))
    assert len(steps) == 14
    assert [len(s.objects.label) for s in steps[8:]] == [8] * 6


def test_it_is_found_by_its_name_and_needs_a_waveform(recording):
    found = echoset.estimate(recording, "tbd", stations=2)
    assert found.objects.state_names == ("x", "y", "vx", "vy")
    model = {k: v for k, v in recording.streams["S1"].model.items() if k != "carrier"}
    bare = {**recording.streams, "S1": replace(recording.streams["S1"], model=model)}
    with pytest.raises(InputError, match="S1: does not state its waveform: carrier missing"):
        run(replace(recording, streams=bare))
    with pytest.raises(InputError, match="stations is 7, but only 6 streams have maps"):
        run(recording, stations=7)
    small = replace(
        recording.streams["S0"], scan={"map": recording.streams["S0"].scan["map"][:, 1:]}
    )
    with pytest.raises(InputError, match="stream S0 at 50000000 ns: map of"):
        run(replace(recording, streams={**recording.streams, "S0": small}))


@pytest.mark.parametrize("scale", [0.76, 1.3])
def test_vehicles_of_another_size_than_stated(scale):
    """Found as one vehicle each after ten scans, within 0.3 m, and no corner is a pedestrian."""
    changes = {"vehicle_length": 4.5 * scale, "vehicle_width": 1.8 * scale}
    recording = simulated(seed=5, scans=16, **changes)
    for k, step in enumerate(run(recording)[10:], 10):
        state, kind, _ = true_at(recording, k)
        d = np.hypot(*(step.objects.state[:, None, :2] - state[:, :2]).T)
        assert d.shape == (8, 8) and (d.min(1) < 0.3).all()
        assert (step.objects.class_index[d.argmin(1)] == kind).all()

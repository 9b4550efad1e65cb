"""The simulated UWB network obeys the laws of its scene."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files

import numpy as np
import pytest
import yaml

from echoset.models.checks import check
from echoset.models.errors import ParameterError
from echoset.models.parameters import resolve
from echoset.models.scatter import bearing
from echoset.models.uwb import distance, free_space_amplitude, range_std
from echoset.simulate import uwb

ACTIVE = 0


def scenario(name: str) -> uwb.Params:
    text = (files("echoset.simulate") / "scenarios" / f"{name}.yaml").read_text()
    content = yaml.safe_load(text)
    assert content["scenario"] == name
    assert set(content["parameters"]) == set(uwb.Params.__dataclass_fields__)
    return resolve(uwb.Params, (name, content["parameters"]))


def simulate(params: uwb.Params, seed: int = 3):
    return uwb.simulate(params, np.random.default_rng(seed), "example")


@pytest.fixture(scope="module")
def scene():
    """A recording, its stream and, per row: event, step, path lengths of what is no clutter."""
    recording = simulate(scenario("uwb-olos"))
    stream = recording.streams["uwb"]
    event = np.repeat(np.arange(len(stream)), np.diff(stream.row_offset))
    return recording, stream, event


def ends(recording, stream):
    """Positions of transmitter and receiver of every event."""
    step = np.searchsorted(recording.truth.objects.time_ns, stream.time_ns)
    device = recording.truth.objects.columns("device_x", "device_y")[step]
    anchors = np.array([recording.sensors[n].position[0, :2] for n in stream.nodes[:3]])
    tx = np.where(stream.scan["tx"][:, None] == 3, device, anchors[stream.scan["tx"] % 3])
    return tx, anchors[stream.scan["rx"]], device


def test_recording_keeps_the_contract(scene):
    check(scene[0])
    check(simulate(scenario("uwb-los")))


def test_events_stand_in_order_and_blocked_links_have_none(scene):
    recording, stream, _ = scene
    s, truth = stream.scan, recording.truth
    order = np.lexsort((s["tx"], s["rx"], s["mode"], stream.time_ns))
    assert (order == np.arange(len(stream))).all()
    key = np.stack((stream.time_ns // 100_000_000, s["rx"], s["mode"]))
    active = {tuple(k[:2].tolist()) for k in key.T if k[2] == ACTIVE}
    blocked = {*zip(truth.blocked_time_ns // 100_000_000, truth.blocked_rx, strict=True)}
    assert len(active) + len(blocked) == 3 * 180 and not active & blocked
    for step, anchors in ((30, 0), (31, 3), (60, 3), (61, 2), (80, 2), (81, 1), (110, 1)):
        assert sum(k == step for k, _ in blocked) == anchors
    assert {j for k, j in blocked if k == 70} == {0, 1} and (100, 1) in blocked
    assert (s["mode"] == 1).sum() == 9 * 180


def test_numbers_are_poisson(scene):
    _, stream, event = scene
    rows = stream.rows
    for chosen, mean in ((rows["origin_id"] < 0, 5.0), (rows["origin_los"] == 0, 10.0)):
        count = np.bincount(event[chosen], minlength=len(stream))
        n = len(count)
        # some true paths fade below the threshold: at these lengths fewer than 1 in 200
        assert abs(count.mean() - mean) < 4.5 * np.sqrt(mean / n) + mean / 200
        assert abs(count.var() / mean - 1) < 4.5 * np.sqrt((2 + 1 / mean) / n) + 1 / 200
    los = np.bincount(event[rows["origin_los"] == 1], minlength=len(stream))
    assert (los <= (stream.scan["mode"] == ACTIVE)).all()
    assert los[stream.scan["mode"] == ACTIVE].mean() > 0.99


def test_noise_has_the_std_of_the_true_amplitude(scene):
    recording, stream, event = scene
    rows = stream.rows
    tx, rx, _ = ends(recording, stream)
    true = rows["origin_id"] >= 0
    q = np.stack((rows["origin_x"], rows["origin_y"]), 1)[true]
    path = distance(tx[event[true]], q) + distance(q, rx[event[true]])
    u = free_space_amplitude(path, 30.0)
    error = (rows["distance"][true] - path) / range_std(u, 500e6 / np.sqrt(12))
    n = len(error)
    assert abs(error.mean()) < 4.5 / np.sqrt(n)
    assert abs(error.var() - 1) < 4.5 * np.sqrt(2 / n)
    # |u + n|^2 is noncentral chi-square: mean u^2 + 1, variance 2 u^2 + 1
    excess = (rows["amplitude"][true] ** 2 - u**2 - 1) / np.sqrt(2 * u**2 + 1)
    assert abs(excess.mean()) < 4.5 / np.sqrt(n) + 5e-3


def test_clutter_is_uniform_with_rayleigh_amplitudes(scene):
    _, stream, _ = scene
    false = stream.rows["origin_id"] < 0
    z, power = stream.rows["distance"][false], stream.rows["amplitude"][false] ** 2 - 1
    n = len(z)
    assert abs(z.mean() - 10) < 4.5 * 20 / np.sqrt(12 * n)
    assert power.min() >= 0 and abs(power.mean() - 1) < 4.5 / np.sqrt(n)
    assert np.isnan(stream.rows["origin_x"][false]).all()


def test_amplitude_is_no_range(scene):
    recording, stream, event = scene
    rows = stream.rows
    los = rows["origin_los"] == 1
    tx, rx, _ = ends(recording, stream)
    path = distance(tx, rx)[event[los]]
    # regressed on the inverse path length, the in-phase noise of variance 1/2 remains
    line = np.polyfit(1 / path, rows["amplitude"][los], 1)
    rest = rows["amplitude"][los] - np.polyval(line, 1 / path)
    assert abs(rest.var() / 0.5 - 1) < 4.5 * np.sqrt(2 / len(rest)) + 0.02


def test_scatterers_face_the_receiver(scene):
    recording, stream, event = scene
    rows = stream.rows
    hit = (rows["origin_id"] >= 0) & (rows["origin_los"] == 0)
    step = np.searchsorted(recording.truth.objects.time_ns, stream.time_ns)
    centre = recording.truth.objects.columns("x", "y")[step][event[hit]]
    q = (np.stack((rows["origin_x"], rows["origin_y"]), 1)[hit] - centre) / [0.3, 0.2]
    _, rx, _ = ends(recording, stream)
    off = np.arctan2(q[:, 1], q[:, 0]) - bearing(centre, rx[event[hit]])
    assert np.abs(np.remainder(off + np.pi, 2 * np.pi) - np.pi).max() <= np.pi / 3 + 1e-9
    depth = 1 - np.hypot(*q.T)
    assert depth.min() > -1e-12 and depth.max() < 0.1 / 0.25 + 1e-12


def test_trajectory_runs_through_the_knots_with_its_own_velocity():
    params = scenario("uwb-olos")
    x = uwb.trajectory(params)
    assert np.allclose(x[0, :2], params.path[0]) and np.allclose(x[-1, :2], params.path[-1])
    middle = np.gradient(x[:, :2], params.dt, axis=0)[1:-1]
    assert np.abs(middle - x[1:-1, 2:]).max() < 5e-3
    gaps = [np.hypot(*(x[:, :2] - knot).T).min() for knot in params.path]
    assert max(gaps) < 0.05


def test_device_keeps_its_bias(scene):
    o = scene[0].truth.objects
    b = o.columns("device_x", "device_y") - o.columns("x", "y")
    assert np.allclose(b, [0.16, -0.32 * np.sin(np.pi / 3)])
    assert np.allclose(o.semi_axes, [0.3, 0.2]) and o.time_ns[0] == 100_000_000


def test_equal_generators_give_equal_recordings():
    params = replace(scenario("uwb-olos"), steps=5)
    a, b = (simulate(params).streams["uwb"] for _ in range(2))
    assert all((a.rows[k] == b.rows[k]).all() for k in ("distance", "amplitude"))
    assert len(simulate(params, 4).streams["uwb"].rows["distance"]) != len(a.rows["distance"])


def test_other_networks_are_simulated():
    params = replace(
        scenario("uwb-los"), steps=3, anchors=((0.0, 0.0),), mean_clutter=0.0, mean_scatter=0.0
    )
    recording = simulate(params)
    check(recording)
    assert len(recording.streams["uwb"]) == 6


@pytest.mark.parametrize(
    "change",
    [
        {"dt": 0.0},
        {"path": ((0.0, 0.0), (0.0, 0.0))},
        {"blocked": ((3, 2, 1),)},
        {"blocked": ((1, 2, 4),)},
        {"semi_axes": (0.3, 0.0)},
        {"opening_angle": 7.0},
    ],
)
def test_impossible_scenes_are_refused(change):
    with pytest.raises(ParameterError, match=next(iter(change))):
        resolve(uwb.Params, ("settings", change))


def test_heights_lengthen_all_paths():
    heights = ((4.0, 4.5, 2.5), (0.0, 0.5, 3.0), (6.5, 0.0, 2.0))
    still = {"steps": 20, "mean_clutter": 0.0, "snr_db": 80.0, "amplitude_threshold": 0.0}
    params = replace(scenario("uwb-los"), anchors=heights, device_height=1.0, **still)
    recording = simulate(params)
    check(recording)
    assert recording.streams["uwb"].model["device_height"] == 1.0
    stream = recording.streams["uwb"]
    event = np.repeat(np.arange(len(stream)), np.diff(stream.row_offset))
    los = stream.rows["origin_los"] == 1
    step = np.searchsorted(recording.truth.objects.time_ns, stream.time_ns)[event[los]]
    m = recording.truth.objects.columns("device_x", "device_y")[step]
    a = np.array(heights)[stream.scan["rx"][event[los]]]
    d = np.sqrt(((m - a[:, :2]) ** 2).sum(1) + (a[:, 2] - 1.0) ** 2)
    assert np.abs(stream.rows["distance"][los] - d).max() < 0.01


@pytest.mark.parametrize(
    "change",
    [
        {"anchors": [[0.0, 0.0, 2.0], [1.0, 0.0]]},
        {"anchors": [[0.0], [1.0]]},
        {"device_height": 1.0},
        {"anchors": [[0.0, 0.0, 2.0], [1.0, 0.0, 2.0]], "device_height": -1.0},
    ],
)
def test_heights_are_all_told_or_none(change):
    with pytest.raises(ParameterError):
        resolve(uwb.Params, ("settings", change))

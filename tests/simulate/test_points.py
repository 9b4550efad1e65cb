"""Scenarios of point targets: the laws of detection, clutter, noise, motion, birth and death."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from echoset.models import registry
from echoset.models.checks import check
from echoset.models.errors import ParameterError
from echoset.models.parameters import resolve
from echoset.simulate import crossing, crowd, many, meeting, moving_platform
from echoset.simulate.targets import step_noise

SCENARIOS = {
    "crossing": crossing,
    "meeting": meeting,
    "many": many,
    "crowd": crowd,
    "moving-platform": moving_platform,
}
Z = 4.5
"""Tolerances in standard errors."""


def simulate(scenario, seed=1, **parameters):
    params = scenario.Params(**parameters)
    return scenario.simulate(params, np.random.default_rng(seed), "run")


def rest(steps, **parameters):
    """One target that rests at (30, -40), seen in ``steps`` scans."""
    target = ((30.0, -40.0, 0.0, 0.0, 1, steps),)
    return simulate(crossing, steps=steps, targets=target, noise_density=0.0, **parameters)


@pytest.mark.parametrize("name", SCENARIOS)
def test_files_state_the_defaults_of_every_parameter(name):
    module = registry.load("echoset.scenarios", name)
    assert module is SCENARIOS[name]
    path = Path(module.__file__).parent / "scenarios" / f"{name}.yaml"
    content = yaml.safe_load(path.read_text())
    assert content["scenario"] == name
    assert list(content["parameters"]) == list(module.Params.__dataclass_fields__)
    assert resolve(module.Params, (name, content["parameters"])) == module.Params()


@pytest.mark.parametrize("name", SCENARIOS)
def test_recordings_are_sound_and_follow_from_the_generator(name):
    scenario = SCENARIOS[name]
    one, same, other = (simulate(scenario, seed) for seed in (1, 1, 2))
    check(one)
    radar = one.streams["radar"]
    for key, values in radar.rows.items():
        np.testing.assert_array_equal(values, same.streams["radar"].rows[key])
    assert len(other.streams["radar"].rows["origin_id"]) != len(radar.rows["origin_id"])
    params = scenario.Params()
    np.testing.assert_array_equal(radar.time_ns, np.arange(1, params.steps + 1) * 10**9)
    np.testing.assert_array_equal(one.truth.objects.time_ns, radar.time_ns)
    assert one.truth.objects.state_names == ("x", "y", "vx", "vy")
    for key, value in radar.model.items():
        np.testing.assert_array_equal(value, getattr(params, key))
    assert "origin_id" in radar.rows and "origin_id" not in radar.observed().rows


@pytest.mark.parametrize("name", SCENARIOS)
def test_labels_last_and_detections_name_their_targets(name):
    recording = simulate(SCENARIOS[name])
    truth, radar = recording.truth.objects, recording.streams["radar"]
    step = np.repeat(np.arange(len(truth.time_ns)), np.diff(truth.row_offset))
    for label in np.unique(truth.label):
        own = step[truth.label == label]
        np.testing.assert_array_equal(own, np.arange(own[0], own[-1] + 1))
    for k in range(len(radar)):
        origin = radar.rows["origin_id"][radar.row_offset[k] : radar.row_offset[k + 1]]
        found = origin[origin >= 0]
        alive = truth.label[truth.row_offset[k] : truth.row_offset[k + 1]]
        assert len(set(found)) == len(found) and set(found) <= set(alive)


def test_detection_is_binomial_and_noise_is_normal():
    n, p, sigma = 5000, 0.8, 5.0
    radar = rest(n, p_detect=p, clutter_rate=0.0, std_position=sigma).streams["radar"]
    m = radar.row_offset[-1]
    assert abs(m - n * p) < Z * np.sqrt(n * p * (1 - p))
    assert np.diff(radar.row_offset).max() == 1
    error = np.stack((radar.rows["x"] - 30.0, radar.rows["y"] + 40.0))
    assert (np.abs(error.mean(1)) < Z * sigma / np.sqrt(m)).all()
    assert (np.abs(error.var(1) - sigma**2) < Z * sigma**2 * np.sqrt(2 / m)).all()
    assert abs(np.mean(error[0] * error[1])) < Z * sigma**2 / np.sqrt(m)


def test_clutter_is_poisson_uniform_and_in_random_places_of_the_scan():
    n, rate = 5000, 6.0
    region = (-10.0, 30.0, 5.0, 10.0)
    recording = rest(n, p_detect=1.0, clutter_rate=rate, clutter_region=region)
    radar = recording.streams["radar"]
    count = np.diff(radar.row_offset) - 1
    assert abs(count.mean() - rate) < Z * np.sqrt(rate / n)
    fourth = rate + 2 * rate**2
    assert abs(count.var() - rate) < Z * np.sqrt(fourth / n)
    false = radar.rows["origin_id"] == -1
    x = (radar.rows["x"][false] + 10) / 40
    y = (radar.rows["y"][false] - 5) / 5
    for u in (x, y):
        assert u.min() >= 0 and u.max() <= 1
    cells = np.bincount((x * 4).astype(int) * 4 + (y * 4).astype(int), minlength=16)
    total = len(x)
    assert (np.abs(cells - total / 16) < Z * np.sqrt(total * 15 / 256)).all()
    lone = count == 1
    first = radar.rows["origin_id"][radar.row_offset[:-1][lone]] == 0
    assert abs(first.mean() - 0.5) < Z * 0.5 / np.sqrt(lone.sum())


def test_nothing_at_all_is_a_recording():
    for name, scenario in SCENARIOS.items():
        none = {"targets": 0} if name in ("meeting", "crowd") else {"targets": ()}
        none = {"birth_rate": 0.0, "initial_rate": 0.0} if name == "many" else none
        recording = simulate(scenario, clutter_rate=0.0, **none)
        check(recording)
        assert recording.streams["radar"].row_offset[-1] == 0
        assert len(recording.truth.objects.label) == 0


def test_step_noise_has_the_covariance_of_white_acceleration():
    n, dt, q = 20000, 0.7, 3.0
    w = step_noise(dt, q, n, np.random.default_rng(3))
    axis = q * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    expected = np.kron(axis, np.eye(2))
    spread = np.sqrt((np.outer(*(np.diag(expected),) * 2) + expected**2) / n)
    assert (np.abs(w.T @ w / n - expected) < Z * spread).all()


def test_lines_without_noise_are_straight():
    truth = simulate(crossing, noise_density=0.0).truth.objects
    step = np.repeat(np.arange(1, 101), np.diff(truth.row_offset))
    for label, (x, y, vx, vy, first, last) in enumerate(crossing.Params().targets):
        mine = truth.label == label
        k = step[mine]
        assert (k[0], k[-1]) == (first, last)
        expected = np.column_stack((x + vx * (k - first), y + vy * (k - first)))
        np.testing.assert_allclose(truth.state[mine, :2], expected, atol=1e-9)


def test_meeting_targets_spread_forwards_and_backwards_alike():
    n, count, q, P = 21, 4000, 0.01, 0.1
    parameters = {"steps": n, "targets": count, "clutter_rate": 0.0, "last": ()}
    state = simulate(meeting, **parameters).truth.objects.state.reshape(n, count, 4)
    for k, t in ((10, 0), (0, 10), (20, 10)):
        variance = np.r_[[P + P * t**2 + q * t**3 / 3] * 2, [P + q * t] * 2]
        mean = state[k].mean(0) - (150, 150, 0, 0)
        assert (np.abs(mean) < Z * np.sqrt(variance / count)).all()
        assert (np.abs(state[k].var(0) - variance) < Z * variance * np.sqrt(2 / count)).all()


def test_meeting_targets_start_and_end_when_told():
    truth = simulate(meeting, first=(1, 11), last=(40,)).truth.objects
    alive = np.diff(truth.row_offset)
    np.testing.assert_array_equal(alive, np.repeat([3, 4, 3], [10, 30, 41]))
    assert 0 not in truth.label[truth.row_offset[40] :]


def test_births_and_deaths():
    n, p, rate = 4000, 0.9, 2.0
    still = {"std_velocity": 0.0, "noise_density": 0.0, "clutter_rate": 0.0}
    recording = simulate(many, steps=n, birth_rate=rate, p_survive=p, initial_rate=20.0, **still)
    truth = recording.truth.objects
    alive = np.diff(truth.row_offset)
    births = truth.label.max() + 1 - alive[0]
    assert abs(births - rate * (n - 1)) < Z * np.sqrt(rate * (n - 1))
    at_risk = alive[:-1].sum()
    deaths = births + alive[0] - alive[-1]
    assert abs(deaths - at_risk * (1 - p)) < Z * np.sqrt(at_risk * p * (1 - p))
    fresh = np.unique(truth.label, return_index=True)[1]
    place = truth.state[fresh, :2] / 2000 + 0.5
    assert (np.abs(place.mean(0) - 0.5) < Z / np.sqrt(12 * len(place))).all()


def test_who_leaves_the_region_is_gone():
    recording = simulate(many, p_survive=1.0, std_velocity=50.0, steps=200)
    truth = recording.truth.objects
    assert np.abs(truth.state[1:, :2]).max() <= 1000
    assert len(np.unique(truth.label)) > 2 * np.diff(truth.row_offset).max()


def test_platform_heads_where_it_goes():
    params = moving_platform.Params(turn_rate=0.02, platform=(5.0, 6.0, 0.3))
    x, y, heading = moving_platform.poses(params).T
    np.testing.assert_allclose((x[0], y[0], heading[0]), (5.0, 6.0, 0.3))
    move = np.diff(x + 1j * y)
    aside = np.angle(move * np.exp(-1j * (heading[:-1] + 0.01)))
    np.testing.assert_allclose(aside, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.abs(move), 2 * 5 / 0.02 * np.sin(0.01), rtol=1e-12)
    straight = moving_platform.poses(replace(params, turn_rate=0.0))
    np.testing.assert_allclose(
        straight[-1, :2] - (5, 6), 745 * np.array([np.cos(0.3), np.sin(0.3)])
    )


def to_map(recording):
    """Detections in the map as complex numbers, and their steps."""
    radar, sensor = recording.streams["radar"], recording.sensors["radar"]
    step = np.repeat(np.arange(len(radar)), np.diff(radar.row_offset))
    np.testing.assert_array_equal(sensor.time_ns, radar.time_ns)
    *_, qz, qw = sensor.quaternion.T
    own = sensor.position[:, 0] + 1j * sensor.position[:, 1]
    turn = (qw + 1j * qz) ** 2
    polar = radar.rows["range"] * np.exp(1j * radar.rows["azimuth"])
    return own[step] + turn[step] * polar, step


def test_ranges_and_bearings_lead_back_to_the_targets():
    exact = {"p_detect": 1.0, "clutter_rate": 0.0, "std_range": 0.0, "std_azimuth": 0.0}
    recording = simulate(moving_platform, max_range=1e4, **exact)
    place, step = to_map(recording)
    truth = recording.truth.objects
    assert len(place) == len(truth.label)
    order = np.lexsort((recording.streams["radar"].rows["origin_id"], step))
    expected = truth.state[:, 0] + 1j * truth.state[:, 1]
    np.testing.assert_allclose(place[order], expected, rtol=1e-12)


def test_noise_of_range_and_bearing():
    n = 4000
    target = ((-200.0, 1.0, 0.0, 0.0, 1, n),)
    scene = {"steps": n, "targets": target, "speed": 0.0, "noise_density": 0.0, "turn_rate": 0.0}
    rows = simulate(moving_platform, p_detect=1.0, clutter_rate=0.0, **scene).streams["radar"].rows
    assert len(rows["range"]) == n
    assert np.abs(rows["azimuth"]).max() <= np.pi and np.ptp(np.sign(rows["azimuth"])) == 2
    around = (rows["azimuth"] - np.arctan2(1.0, -200.0) + np.pi) % (2 * np.pi) - np.pi
    along = rows["range"] - np.hypot(200, 1)
    assert abs(np.mean(along * around)) < Z * 3.0 * 0.01 / np.sqrt(n)
    for error, sigma in ((along, 3.0), (around, 0.01)):
        assert abs(error.mean()) < Z * sigma / np.sqrt(n)
        assert abs(error.var() - sigma**2) < Z * sigma**2 * np.sqrt(2 / n)


def test_a_sector_holds_its_clutter_and_only_the_targets_in_it():
    n, rate = 2000, 3.0
    at_the_edge, past_it = ((100 * np.cos(a), 100 * np.sin(a)) for a in (0.4999, 0.5001))
    places = ((100.0, 0.0), at_the_edge, past_it, (0.0, 100.0), (801.0, 0.0))
    targets = tuple((*place, 0.0, 0.0, 1, n) for place in places)
    scene = {"steps": n, "targets": targets, "speed": 0.0, "noise_density": 0.0, "turn_rate": 0.0}
    scene |= {"opening_angle": 1.0, "clutter_rate": rate, "p_detect": 0.9}
    radar = simulate(moving_platform, **scene).streams["radar"]
    step = np.repeat(np.arange(n), np.diff(radar.row_offset))
    for key in ("azimuth", "range"):
        low, high = (radar.scan[f"view_{key}_{end}"][step] for end in ("min", "max"))
        assert ((low <= radar.rows[key]) & (radar.rows[key] <= high)).all()
    origin = radar.rows["origin_id"]
    assert set(origin) == {-1, 0, 1}
    assert abs((origin == 1).sum() - 0.45 * n) < Z * np.sqrt(n * 0.45 * 0.55) + 0.01 * n
    assert abs((origin == 0).sum() - 0.9 * n) < Z * np.sqrt(n * 0.09)
    false = origin == -1
    assert abs(false.sum() - rate * n) < Z * np.sqrt(rate * n)
    for u in (radar.rows["range"][false] / 800, radar.rows["azimuth"][false] + 0.5):
        assert abs(u.mean() - 0.5) < Z / np.sqrt(12 * false.sum())
        assert abs(u.var() - 1 / 12) < Z * np.sqrt(1 / 180 / false.sum())


@pytest.mark.parametrize(
    ("scenario", "wrong"),
    [
        (crossing, {"steps": 0}),
        (crossing, {"dt": 0.0}),
        (crossing, {"p_detect": 1.1}),
        (crossing, {"clutter_rate": -1.0}),
        (crossing, {"clutter_region": (1.0, 0.0, 0.0, 1.0)}),
        (crossing, {"std_position": -1.0}),
        (crossing, {"noise_density": -1.0}),
        (crossing, {"targets": ((0.0, 0.0, 0.0, 0.0, 5, 4),)}),
        (meeting, {"targets": -1}),
        (meeting, {"p_detect": 1.5}),
        (many, {"clutter_rate": -1.0}),
        (meeting, {"spread": -1.0}),
        (meeting, {"last": (0,)}),
        (many, {"p_survive": 1.5}),
        (many, {"birth_rate": -1.0}),
        (crowd, {"targets": -1}),
        (moving_platform, {"max_range": 0.0}),
        (moving_platform, {"std_azimuth": -0.1}),
        (moving_platform, {"opening_angle": 7.0}),
        (moving_platform, {"noise_density": -1.0}),
        (moving_platform, {"targets": ((0.0, 0.0, 0.0, 0.0, 0, 4),)}),
    ],
)
def test_impossible_parameters(scenario, wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        resolve(scenario.Params, ("here", wrong))

"""The base stations' scene: two engines of one law, traffic, and what the recording states."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import echoset
from echoset.campaign.scenarios import find
from echoset.models.checks import check
from echoset.models.errors import ParameterError
from echoset.models.parameters import resolve
from echoset.models.radar.multibeam import BaseStation, Echoes, beamformer, steering
from echoset.models.random import generator
from echoset.simulate import jsc, spectral, traffic, waveform
from echoset.simulate.compiled.spectral import strongest_columns
from echoset.simulate.traffic import gap

SMALL = BaseStation(
    subcarriers=64,
    symbols=16,
    transmit_elements=8,
    receive_elements=6,
    scan_step=0.3,
    max_range=300,
)


def params(**values: object) -> jsc.Params:
    scenario = find("jsc-6bs")
    return resolve(jsc.Params, *scenario.layers, ("test", values))


def some_echoes(n: int, seed: int = 1) -> Echoes:
    rng = np.random.default_rng(seed)
    beta = 10 ** rng.uniform(-8, -6, n) * np.exp(2j * np.pi * rng.random(n))
    return Echoes(rng.uniform(5, 280, n), rng.uniform(-1, 1, n), rng.uniform(-20, 20, n), beta)


def test_engines_agree_without_noise() -> None:
    for station, echoes in ((SMALL, some_echoes(7)), (SMALL, some_echoes(1, 2))):
        a = spectral.range_angle_map(station, echoes, 0.2, False, np.random.default_rng(1))
        b = waveform.range_angle_map(station, echoes, 0.2, False, np.random.default_rng(1))
        assert np.abs(a - b).max() < 1e-9 * b.max()


def test_engines_agree_on_the_whole_scene() -> None:
    p = params(scans=1, station_azimuths=[0.3], noisy=False)
    a, b = (
        jsc.simulate(replace(p, engine=engine), generator(3, "a", "b"), "r")
        for engine in jsc.ENGINES
    )
    x, y = (r.streams["S0"].scan["map"] for r in (a, b))
    assert np.abs(x - y).max() <= 1e-6 * y.max()  # float32


def test_waveform_is_the_channel_antenna_by_antenna() -> None:
    """Eqs. 1-3 with every antenna's channel, for one direction."""
    s, e, user = SMALL, some_echoes(3), -0.4
    d, towards = 2, float(SMALL.azimuth_axis[2])
    w_T = beamformer(s, towards, user) * np.sqrt(s.power)
    w_R = steering(s.receive_elements, np.array(towards)).conj()
    k, m = np.arange(s.subcarriers)[:, None], np.arange(s.symbols)
    G = np.zeros((s.subcarriers, s.symbols), complex)
    for r, a, v, beta in zip(e.range, e.azimuth, e.speed, e.beta, strict=True):
        H = np.outer(
            steering(s.receive_elements, np.array(a)), steering(s.transmit_elements, np.array(a))
        )
        f_D, tau = -2 * v * s.carrier / 299792458, 2 * r / 299792458
        turn = np.exp(2j * np.pi * (m * s.symbol_time * f_D - k * s.spacing * tau))
        G += beta * turn * (w_R @ H @ w_T) / np.sqrt(s.receive_elements)
    expected = waveform.strongest_column(G, len(s.range_axis))
    found = waveform.range_angle_map(s, e, user, False, np.random.default_rng(1))[:, d]
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * expected.max())


def test_a_single_scatterer_lands_in_its_bin_with_its_snr() -> None:
    station = BaseStation()
    bin_, direction = 100, 30
    e = Echoes(
        station.range_axis[[bin_]],
        station.azimuth_axis[[direction]],
        np.zeros(1),
        np.array([1e-6j]),
    )
    away = float(np.arcsin(np.sin(e.azimuth[0]) - 0.4))
    map_ = spectral.range_angle_map(station, e, away, False, np.random.default_rng(1))
    assert np.unravel_index(map_.argmax(), map_.shape) == (bin_, direction)
    snr = 0.3 / (3168 * 120e3 * 4e-20) * 1e-12 * 50 * 3168 * 112
    assert map_.max() == pytest.approx(snr, rel=1e-9)


def test_twin_is_equal() -> None:
    rng = np.random.default_rng(5)
    a, D_r, D_c = (
        rng.normal(size=shape) + 1j * rng.normal(size=shape) for shape in ((4, 3), (3, 20), (3, 9))
    )
    for noisy in (True, False):
        plain = spectral.strongest_columns(a, D_r, D_c, noisy, np.random.default_rng(2))
        twin = strongest_columns(a, D_r, D_c, noisy, np.random.default_rng(2))
        assert twin == pytest.approx(plain, rel=1e-12)


def test_no_echo_is_noise_alone() -> None:
    """The strongest of 20 x 9 unit exponentials, by its mean; 400 draws, 4.5 standard errors."""
    none = np.zeros((1, 0), complex), np.zeros((0, 20), complex), np.zeros((0, 9), complex)
    rng = np.random.default_rng(3)
    top = np.array([strongest_columns(*none, True, rng).max() for _ in range(400)])
    expected = (1 / np.arange(1, 181)).sum()
    assert abs(top.mean() - expected) < 4.5 * top.std() / 20


def outline(state, heading, body):
    """Points (T, 64, 2) along the outline of a rectangle."""
    t = np.linspace(-1, 1, 17)[:-1]
    one = np.ones_like(t)
    unit = np.concatenate([np.stack(p, 1) for p in ((t, one), (t, -one), (one, t), (-one, -t))])
    c, s = np.cos(heading), np.sin(heading)
    R = np.stack((np.stack((c, -s), -1), np.stack((s, c), -1)), -2)
    return state[:, None, :2] + (unit * body) @ R.swapaxes(1, 2)


def test_gaps_of_rectangles() -> None:
    """Against points along their outlines, and against overlaps told by points inside."""
    rng = np.random.default_rng(1)
    for _ in range(200):
        x, h = rng.uniform(-4, 4, (2, 1, 2)), rng.uniform(-3, 3, (2, 1))
        body = rng.uniform(0.2, 2.5, (2, 2))
        found = gap(x[0], h[0], tuple(body[0]), x[1], h[1], tuple(body[1]))[0]
        a, b = (outline(x[k], h[k], body[k])[0] for k in (0, 1))
        near = np.hypot(*(a[:, None] - b).T).min()
        if found > 0:
            assert found <= near + 1e-12 and near < found + 0.4
        else:
            grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 61)] * 2), -1).reshape(-1, 2) * body[0]
            c, s = np.cos(h[0, 0] - h[1, 0]), np.sin(h[0, 0] - h[1, 0])
            turn = np.array(
                [[np.cos(h[1, 0]), -np.sin(h[1, 0])], [np.sin(h[1, 0]), np.cos(h[1, 0])]]
            )
            inside = grid @ np.array([[c, s], [-s, c]]) + (x[0, 0] - x[1, 0]) @ turn
            assert (np.abs(inside) <= body[1] + 0.1).all(1).any()


def test_the_parked_are_as_many_as_are_drawn() -> None:
    """A fifth of the vehicles, 30 scenes of 4: 4.5 standard errors."""
    p = params()
    still = []
    for run in range(30):
        state = jsc._targets(p, generator(run, "parked", "b")).state
        still += (np.hypot(*state[4:, :, 2:].T).max(0) == 0).tolist()
    assert abs(np.mean(still) - 0.2) < 4.5 * np.sqrt(0.2 * 0.8 / 120)


def test_oncoming_vehicles_pass_on_lanes_3_5_m_apart() -> None:
    lanes = {"east": [-19.0, -1.75, 19.0, -1.75], "west": [19.0, 1.75, -19.0, 1.75]}
    p = params(lanes=lanes, vehicles=4, pedestrians=0)
    passed = 0
    for run in range(10):
        found = jsc._targets(p, generator(run, "pass", "b"))
        state, heading = found.state, found.heading
        east = np.abs(heading[:, 0]) < 1
        before = np.sign(state[east][:, None, :, 0] - state[~east][None, :, :, 0])
        passed += int((before.max(-1) > before.min(-1)).sum())
    assert passed > 0


def walker(state):
    """A pedestrian with the state (1, 4)."""
    return jsc.Targets(np.zeros(1, int), state, np.zeros(1), np.ones((1, 2)))


def test_vehicles_have_sizes_of_their_own() -> None:
    """Log sizes have the deviations stated; echoes come from those bodies; the rest is as it was.

    Deviations of 60 vehicles within 4.5 standard errors. Without a spread nothing is drawn.
    """
    p = params(scans=2, vehicles=3, vehicle_spread=[0.1, 0.05])
    found = [jsc._targets(p, generator(run, "sizes", "b")) for run in range(20)]
    log = np.log(np.concatenate([f.scale[f.kind == 1] for f in found]))
    assert len(log) == 60 and (np.abs(log.std(0) / (0.1, 0.05) - 1) < 4.5 / np.sqrt(120)).all()
    assert all((f.scale[f.kind == 0] == 1).all() for f in found)
    one = jsc.Targets(
        np.ones(1, int), np.array([[0.0, 0.0, 1.0, 0.0]]), np.zeros(1), np.array([[1.2, 0.8]])
    )
    e = jsc.echoes(p, one, np.array([50.0, 0.0, 0.0]), np.pi, generator(1, "a", "b"))
    assert e.range.min() == pytest.approx(50 - 1.2 * 2.25)
    assert np.abs(e.range * np.sin(e.azimuth)).max() == pytest.approx(0.8 * 0.9)
    truth = jsc.simulate(p, generator(1, "a", "b"), "r").truth
    drawn = jsc._targets(p, generator(1, "a", "b"))
    assert truth is not None and truth.objects.semi_axes is not None
    np.testing.assert_allclose(truth.objects.semi_axes[4:7], drawn.scale[4:] * (2.25, 0.9))


def test_stations_take_their_maps_one_after_the_other() -> None:
    """Of a vehicle that passes, each station's echo is that of its own time; truth of the mean."""
    p = params(scans=2, station_azimuths=[0.0, 0.0, 0.0], noisy=False, stagger=0.01)
    state = np.array([[[0.0, 0.0, -100.0, 0.0], [-5.0, 0.0, -100.0, 0.0]]])
    targets = jsc.Targets(np.zeros(1, int), state, np.zeros((1, 2)), np.ones((1, 2)))
    recording = jsc.recorded(p, targets, generator(1, "a", "b"), "r")
    check(recording)
    for q, stream in enumerate(recording.streams.values()):
        np.testing.assert_array_equal(stream.time_ns, p.time_ns + q * 10_000_000)
        row = np.unravel_index(stream.scan["map"][0].argmax(), stream.scan["map"][0].shape)[0]
        assert abs(p.range_axis[row] - (50.0 + q)) <= p.range_bin / 2
    assert recording.truth is not None
    np.testing.assert_array_equal(recording.truth.objects.time_ns, p.time_ns + 10_000_000)
    np.testing.assert_allclose(recording.truth.objects.state[:, 0], [-1.0, -6.0])


def test_nobody_is_there() -> None:
    p = params(scans=2, pedestrians=0, vehicles=0, station_azimuths=[0.0], max_range=60.0)
    recording = jsc.simulate(p, generator(1, "a", "b"), "empty")
    check(recording)
    assert recording.truth is not None and len(recording.truth.objects.label) == 0


def test_stations_stand_where_they_are_put() -> None:
    """The peak of a scatterer is where geometry has it, seen from a mast at any place."""
    p = params(scans=1, stations=[[-30.0, 5.0, 0.3], [4.0, -40.0, 1.4]], station_height=9.0)
    for x, y, z, yaw in p.poses.tolist():
        target = np.array([[6.0, 3.0, 1.0, -2.0]])
        e = jsc.echoes(p, walker(target), np.array([x, y, z]), yaw, generator(1, "a", "b"))
        v = np.array([6.0 - x, 3.0 - y, -z])
        assert e.range[0] == pytest.approx(np.linalg.norm(v))
        along = v @ (-np.sin(yaw), np.cos(yaw), 0.0)
        assert e.azimuth[0] == pytest.approx(np.arcsin(along / np.linalg.norm(v)))
        assert e.speed[0] == pytest.approx(v @ (1.0, -2.0, 0.0) / np.linalg.norm(v))
    recording = jsc.simulate(p, generator(1, "a", "b"), "r")
    sensor = recording.sensors["S1"]
    np.testing.assert_allclose(sensor.position[0], [4.0, -40.0, 9.0])
    model = recording.streams["S1"].model
    assert model["map_region"] == [-20.0, 20.0, -20.0, 20.0]
    assert model["reference_echo"] == pytest.approx(
        3235.07 * (50 / jsc.seen_from(p, np.array([4.0, -40.0]), 1.4)) ** 4, rel=1e-5
    )


def test_traffic_keeps_clear_and_moves_as_it_says() -> None:
    p = params(scans=100)
    for run in range(5):
        found = jsc._targets(p, generator(run, "a", "b"))
        kinds, state, heading = found.kind, found.state, found.heading
        assert np.abs(state[..., :2]).max() <= 19.0
        v = np.gradient(state[..., :2], p.dt, axis=1)[:, 2:-2]
        assert np.abs(v - state[:, 2:-2, 2:]).max() < 0.2
        body = np.array([[0.25, 0.25], [2.25, 0.9]])[kinds]
        for i in range(len(kinds)):
            for j in range(i):
                a, b = (outline(state[k, ::5], heading[k, ::5], body[k]) for k in (i, j))
                assert np.hypot(*(a[:, :, None] - b[:, None]).T).min() >= p.clearance - 0.02
        moving = np.hypot(*state[..., 2:].T).T > 1e-3
        along = np.arctan2(state[..., 3], state[..., 2])
        assert np.abs(np.exp(1j * along) - np.exp(1j * heading))[moving].max() < 1e-6


def test_recording_survives_both_formats(tmp_path: Path) -> None:
    p = params(scans=2, station_azimuths=[0.0, 2.0], max_range=60.0)
    recording = jsc.simulate(p, generator(1, "a", "b"), "r")
    check(recording)
    assert recording.truth is not None
    assert recording.truth.objects.class_names == ("pedestrian", "vehicle")
    for suffix in ("h5", "mcap"):
        path = tmp_path / f"r.{suffix}"
        echoset.write(recording, path)
        back = echoset.read(path)
        assert isinstance(back, type(recording))
        for name in recording.streams:
            assert np.array_equal(
                back.streams[name].scan["map"], recording.streams[name].scan["map"]
            )


def test_swerling_and_phase() -> None:
    """Power of a pedestrian's echo is exponential about the radar equation, 2000 draws."""
    p, rng = params(scans=1), generator(1, "a", "b")
    x = np.array([[0.0, 0.0, 1.0, 0.0]])
    where = np.array([50.0, 0.0, 0.0])
    e = [jsc.echoes(p, walker(x), where, np.pi, rng) for _ in range(2000)]
    power = np.array([abs(s.beta[0]) ** 2 for s in e])
    mean = (299792458 / 28e9) ** 2 / (4 * np.pi) ** 3 / 50**4
    assert abs(power.mean() / mean - 1) < 4.5 / np.sqrt(2000)
    assert abs(np.mean([s.beta[0] / abs(s.beta[0]) for s in e])) < 4.5 / np.sqrt(2000)
    assert e[0].speed[0] == pytest.approx(-1.0)
    assert e[0].azimuth[0] == pytest.approx(0.0)


def test_births_lie_on_the_lines() -> None:
    b = jsc.births(params())
    assert b.shape[1] == 9
    assert np.isclose(np.abs(b[:-1, 1:3]), 3.5).any(axis=1).sum() == 40
    assert b[-1, 1:].tolist() == [0.0] * 4 + [pytest.approx(5**0.5)] * 4


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"lanes": {}}, "lanes"),
        ({"lanes": {"a": [0, 0, 0, 0]}}, "lanes"),
        ({"crosswalks": [1, 2]}, "crosswalks"),
        ({"engine": "fast"}, "engine"),
        ({"vehicle_speed": [2.0, 1.0]}, "vehicle_speed"),
        ({"station_azimuths": []}, "station_azimuths"),
        ({"area": [0.0, 1.0, 0.0, 9.0]}, "area must be x_min < x_max"),
        ({"dt": 0.04}, "dt must be at least 0.0484 s, in which 51 directions are scanned"),
    ],
)
def test_impossible_scene(values: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        params(**values)


def test_no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(traffic, "_ROUNDS", 2)
    with pytest.raises(ParameterError, match="no room"):
        jsc.simulate(params(scans=2, clearance=30.0), generator(1, "a", "b"), "r")

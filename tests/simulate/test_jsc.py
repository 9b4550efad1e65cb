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
from echoset.simulate import jsc, spectral, waveform
from echoset.simulate.compiled.spectral import strongest_columns

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


def test_traffic_keeps_clear_and_moves_as_it_says() -> None:
    p = params(scans=100)
    for run in range(5):
        kinds, state, heading = jsc._targets(p, generator(run, "a", "b"))
        assert np.abs(state[..., :2]).max() <= p.half_width
        v = np.gradient(state[..., :2], p.dt, axis=1)[:, 2:-2]
        assert np.abs(v - state[:, 2:-2, 2:]).max() < 0.2
        room = np.where(kinds == 1, np.hypot(4.5, 1.8) / 2, 0.25)
        for i in range(len(kinds)):
            for j in range(i):
                gap = np.hypot(*(state[i, :, :2] - state[j, :, :2]).T).min()
                assert gap >= room[i] + room[j] + p.clearance
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
    where = np.array([50.0, 0.0])
    e = [jsc.echoes(p, np.zeros(1, int), x, np.zeros(1), where, np.pi, rng) for _ in range(2000)]
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
    ],
)
def test_impossible_scene(values: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        params(**values)


def test_no_room() -> None:
    with pytest.raises(ParameterError, match="no room"):
        jsc.simulate(params(scans=2, clearance=30.0), generator(1, "a", "b"), "r")

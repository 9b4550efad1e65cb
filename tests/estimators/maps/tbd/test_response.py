"""The mean of maps against maps that are simulated, derivatives, laws, and the compiled twins."""

import numpy as np
import pytest

from echoset.campaign.scenarios import find
from echoset.estimators.maps.frames import STAMP
from echoset.estimators.maps.kernels import response
from echoset.estimators.maps.kernels.compiled import response as compiled
from echoset.estimators.maps.tbd.params import Params
from echoset.estimators.maps.tbd.scene import Layout, View, windows
from echoset.models.parameters import resolve
from echoset.models.random import generator
from echoset.models.records import Scan
from echoset.simulate import jsc, spectral

KINDS = np.array([0, 1])
TARGETS = np.array([[4.0, -3.0, 0.0, 0.2, 0.0, 0.5, -0.3], [-6.0, 5.0, 0.7, -0.1, 0.0, 1.0, 1.2]])


@pytest.fixture(scope="module")
def scene():
    changes = {"scans": 1, "stations": [[-50, 0, 0.1], [10, -45, 1.8]], "station_height": 5.0}
    return resolve(jsc.Params, *find("jsc-6bs").layers, ("here", changes))


@pytest.fixture(scope="module")
def recording(scene):
    return jsc.simulate(scene, generator(2, "response", "r"), "r")


@pytest.fixture(scope="module")
def setup(recording):
    return recording.setup()


@pytest.fixture(scope="module")
def view(recording, setup):
    layout = Layout.of(setup, list(recording.streams), Params(dynamic_range=200.0))
    return View.of(layout, list(recording.scans()), setup)


def test_the_mean_is_that_of_simulated_maps(scene, view):
    """400 scans of both targets at a slow speed, cell by cell where there is power: 4.5 errors.

    A cell is exponential, and the cells of an echo fluctuate together; what the beam to a user
    adds is known in the mean over its directions only, and the noise of the strongest column is a
    little more than that of any.
    """
    slow = TARGETS.copy()
    slow[:, 3:] = 0.0
    mean = view.mean(KINDS, slow)
    rng, n = np.random.default_rng(3), 400
    found = np.zeros(mean.shape)
    square = np.zeros(mean.shape)
    state = np.hstack((slow[:, :2], np.zeros((2, 2))))
    targets = jsc.Targets(KINDS, state, slow[:, 2], np.ones((2, 2)))
    for _ in range(n):
        for q, pose in enumerate(scene.poses):
            e = jsc.echoes(scene, targets, pose[:3], pose[3], rng)
            user = rng.uniform(-scene.aperture, scene.aperture)
            D = spectral.range_angle_map(scene, e, user, True, rng)
            found[q] += D / n
            square[q] += D**2 / n
    stderr = np.sqrt((square - found**2) / n)
    bright = mean > 30
    assert bright.sum() > 50
    off = (found - mean)[bright] / np.hypot(stderr, 0.05 * mean)[bright]
    assert np.abs(off).max() < 4.5
    assert abs((found / mean)[bright].mean() - 1) < 0.1
    assert abs(np.median((found / mean)[~bright]) - 1) < 0.05


def test_twins_are_equal(view):
    rng = np.random.default_rng(4)
    layout = view.layout
    columns = rng.integers(-1, 2, view.columns.shape).astype(float)
    rest = 1 + rng.exponential(size=view.power.shape)
    larger = TARGETS + np.array([0.0, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0])
    for kind, target in zip((*KINDS, *KINDS), (*TARGETS, *larger), strict=True):
        body = layout.bodies[kind]
        at = windows(layout, *target[:2], 4.0)
        for q in range(2):
            args = layout.stations[q], layout.beams[q]
            outs = [rest[q].copy() for _ in range(2)]
            for out, module in zip(outs, (response, compiled), strict=True):
                module.add(out, -0.5, *args, columns[q], body, target, at[q])
            np.testing.assert_allclose(*outs, rtol=1e-9)
            notes = [(np.zeros(51), np.full(51, 3.0)) for _ in range(2)]
            for note, module in zip(notes, (response, compiled), strict=True):
                module.strongest(*note, *args, body, target)
            np.testing.assert_allclose(*notes, rtol=1e-9)
        arguments = view.power, rest, layout.stations, layout.beams, columns, body, target, at
        for derive in (True, False):
            a, b = (m.fit(*arguments, 3.0, derive) for m in (response, compiled))
            for x, y in zip(a, b, strict=True):
                np.testing.assert_allclose(x, y, rtol=1e-7, atol=1e-7)
    arguments = view.power, rest, layout.cell, layout.weight, 3.0
    np.testing.assert_allclose(response.gains(*arguments), compiled.gains(*arguments), rtol=1e-9)
    total = response.log_likelihood(view.power, rest, 3.0).sum()
    np.testing.assert_allclose(view.log_likelihood(rest, 3.0), total)


def test_a_range_axis_with_another_step(view):
    station = view.layout.stations[0].copy()
    station[response.DR] *= 1.7
    outs = [np.zeros(view.power.shape[1:]) for _ in range(2)]
    for out, module in zip(outs, (response, compiled), strict=True):
        module.add(
            out, 1.0, station, view.layout.beams[0], np.zeros(51), view.layout.bodies[1],
            TARGETS[1], np.array([0, 120, 5, 50]),
        )  # fmt: skip
    np.testing.assert_allclose(*outs, rtol=1e-8)
    assert outs[0][:, :5].max() == 0 and outs[0][120:].max() == 0 < outs[0].max()


def test_the_score_is_the_derivative(view):
    rest = np.ones_like(view.power)
    for kind, target in zip(KINDS.tolist(), TARGETS, strict=True):
        at = windows(view.layout, *target[:2], 4.0)
        _, g, _ = view.fit(rest, kind, target, at, 3.0, True)
        for k, h in enumerate((1e-4, 1e-4, 1e-4, 1e-4, 1e-4)):
            up, down = target.copy(), target.copy()
            up[k] += h
            down[k] -= h
            a, b = (view.fit(rest, kind, x, at, 3.0, False)[0] for x in (up, down))
            # The steps of the kernel are finite, the nulls between sidelobes narrow.
            assert g[k] == pytest.approx((a - b) / (2 * h), rel=0.1, abs=2.0)


def test_score_and_information_have_their_law():
    """For a cell with an inverse-gamma mean: the score's mean is 0, its variance a / (a + 2)."""
    rng, n, a, mu = np.random.default_rng(5), 100_000, 3.0, 40.0
    D = mu * a * rng.exponential(size=n) / rng.gamma(a, size=n)
    score = (D - mu) / (mu + D / a)
    assert abs(score.mean()) < 4.5 * score.std() / np.sqrt(n)
    assert (score**2).mean() == pytest.approx(a / (a + 2), rel=0.02)
    h = 1e-5
    up, down = (response.log_likelihood(D, np.array(mu * np.exp(s)), a) for s in (h, -h))
    np.testing.assert_allclose((up - down) / (2 * h), score, atol=1e-6)


def test_windows_hold_what_is_near(view):
    layout = view.layout
    for x, y in ((0.0, 0.0), (15.0, -12.0)):
        at = windows(layout, x, y, 2.0)
        for q, scan in enumerate(("S0", "S1")):
            power = np.zeros(view.power.shape[1:])
            target = np.array([x, y, 0.0, 0.0, 0.0, 0.0, 0.0])
            whole = view.whole[q]
            compiled.add(
                power, 1.0, layout.stations[q], layout.beams[q], np.zeros(51), layout.bodies[0],
                target, whole,
            )  # fmt: skip
            i0, i1, j0, j1 = at[q]
            assert power[i0:i1, j0:j1].sum() > 0.8 * power.sum(), scan


def test_a_station_without_a_map_says_nothing(view, setup):
    layout = view.layout
    scan = Scan("S1", 0, {"map": view.power[1].astype(np.float32)}, {})
    one = View.of(layout, [scan], setup)
    assert (one.whole[0] == 0).all() and (one.layout.cell[:, 0] == -1).all()
    alone = one.gains(np.ones_like(one.power), 3.0)
    both = view.gains(np.ones_like(one.power), 3.0)
    assert (alone != both).any() and np.isfinite(alone).all()


def test_a_station_that_takes_its_map_later_sees_targets_further_on(view):
    """30 ms later a target is where its velocity takes it: the map of one that stands there."""
    station = view.layout.stations[0].copy()
    station[response.LATE] = 0.03
    for kind, target in zip(KINDS, TARGETS, strict=True):
        moved = target.copy()
        moved[:2] += 0.03 * target[5:]
        for module in (response, compiled):
            outs = [np.zeros(view.power.shape[1:]) for _ in range(2)]
            notes = [(np.zeros(51), np.zeros(51)) for _ in range(2)]
            for k, (where, x) in enumerate(((station, target), (view.layout.stations[0], moved))):
                args = where, view.layout.beams[0]
                body = view.layout.bodies[kind]
                module.add(outs[k], 1.0, *args, notes[k][0], body, x, view.whole[0])
                module.strongest(*notes[k], *args, body, x)
            np.testing.assert_allclose(*outs, rtol=1e-9)
            np.testing.assert_allclose(*notes, rtol=1e-9)


def test_the_view_knows_when_each_map_was_taken(view, setup, recording):
    late = next(s for s in recording.scans() if s.stream == "S1")
    late = Scan("S1", late.time_ns - 20_000_000, {**late.scan, STAMP: late.time_ns}, {})
    found = View.of(view.layout, [late], setup)
    assert found.layout.stations[:, response.LATE].tolist() == [0.0, pytest.approx(0.02)]


def test_echoes_hide_what_is_far_below_them(recording, setup):
    """With 25 dB the floor at r is 10^-2.5 of 1 m2 there, or the noise, in maps and their mean."""
    layout = Layout.of(setup, list(recording.streams), Params(dynamic_range=25.0))
    r = np.asarray(recording.streams["S0"].model["range_axis"])[1:]
    reference = recording.streams["S0"].model["reference_echo"]
    at = float(np.sqrt(np.sqrt(layout.stations[0, response.GAIN] / reference)))
    expected = np.maximum(reference * (at / np.maximum(r, 1.0)) ** 4 / 10**2.5, 1.0)
    np.testing.assert_allclose(layout.floor[0, 1:], expected, rtol=1e-9)
    view = View.of(layout, list(recording.scans()), setup)
    nothing = view.mean(KINDS[:0], TARGETS[:0])
    np.testing.assert_allclose(nothing[0, :, 7], layout.floor[0], rtol=1e-12)
    map_ = recording.streams["S0"].scan["map"][0]
    np.testing.assert_allclose(view.power[0] - map_, nothing[0] - 1, atol=1e-2)

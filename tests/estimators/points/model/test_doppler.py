"""Doppler beside the place, against integration; sensors that move, ambiguity, and all filters."""

import logging
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.stats import norm

from echoset.estimators.points import mbm, pairs, phd, pmb
from echoset.estimators.points.model import doppler, measurement
from echoset.estimators.points.model.sensing import SensorParams, look
from echoset.models.geometry.poses import velocity_at, yaw_quaternion
from echoset.models.records import Sensor

SECOND = 10**9
PLACE, SPEED, HEIGHT = np.array([10.0, -20.0]), np.array([3.0, -1.0, 0.5]), -4.0
BASE = {"p_detect": 0.9, "clutter_rate": 0.0, "std_position": 2.0, "std_range": 2.0}
BASE |= {"std_azimuth": 0.02, "std_doppler": 0.3}
NODES, WEIGHTS = np.polynomial.hermite_e.hermegauss(24)
WEIGHTS = WEIGHTS / WEIGHTS.sum()


def rates(z=0.0, std=0.3, above=0.0, period=0.0, updates=True):
    z = np.atleast_1d(z)
    return doppler.Rates(
        z, np.full(len(z), std**2), PLACE, SPEED, np.full(len(z), above), period, 0.01, updates
    )


def rate(x, above):
    """Range rate of states (n, 4) by what the distance does in a short time."""
    p = np.column_stack((x[:, :2] - PLACE, np.full(len(x), above)))
    v = np.column_stack((x[:, 2:], np.zeros(len(x)))) - SPEED
    dt = 1e-4
    return np.diff([np.linalg.norm(p + s * v, axis=1) for s in (-dt, dt)], axis=0)[0] / (2 * dt)


def nodes(m, P):
    """Points (k, 4) of a Gaussian with their weights, for integrals."""
    at = np.array(list(product(NODES, repeat=4)))
    w = np.prod(list(product(WEIGHTS, repeat=4)), axis=1)
    keep = w > 1e-12
    return m + at[keep] @ np.linalg.cholesky(P).T, w[keep] / w[keep].sum()


def moments(x, w):
    mean = w @ x
    return mean, (w[:, None] * (x - mean)).T @ (x - mean)


def target(distance=60.0, angle=0.7, speed=12.0):
    where = PLACE + distance * np.array([np.cos(angle), np.sin(angle)])
    m = np.array([*where, speed, -speed / 2])
    A = np.array(
        [[2.0, 0.5, 0.3, 0.0], [0.5, 1.5, 0.0, 0.4], [0.3, 0.0, 4.0, 0.0], [0.0] * 3 + [3.0]]
    )
    return m, A @ A.T


@pytest.mark.parametrize("above", [0.0, -25.0])
def test_the_rate_is_that_of_the_distance(above):
    m, P = target()
    mean, H, _ = doppler.expansion(rates(), np.array([above]), m[None], 0 * P[None])
    np.testing.assert_allclose(mean, rate(m[None], above), atol=1e-6)
    e = 1e-4 * np.eye(4)
    slope = (rate(m + e, above) - rate(m - e, above)) / 2e-4
    np.testing.assert_allclose(H[0], slope, atol=1e-5)


@pytest.mark.parametrize("above", [0.0, -25.0])
def test_moments_of_the_rate_are_those_of_the_integral(above):
    m, P = target()
    mean, H, more = doppler.expansion(rates(), np.array([above]), m[None], P[None])
    x, w = nodes(m, P)
    true, _ = moments(rate(x, above)[:, None], w)
    first = rate(m[None], above)
    assert abs(mean - true)[0] < 0.1 * abs(first - true)[0]
    _, rest = moments((rate(x, above) - (x - m) @ H[0])[:, None], w)
    assert more[0] == pytest.approx(rest[0, 0], rel=0.1)


@pytest.mark.parametrize("kind", ["position", "range_bearing"])
@pytest.mark.parametrize("period", [0.0, 20.0])
def test_an_update_is_that_of_the_integral(make_recording, kind, period):
    """The place by its own rule; given it, Doppler by quadrature over the state."""
    m, P = target()
    distance, angle = 61.0, 0.72
    where = PLACE + distance * np.array([np.cos(angle), np.sin(angle)])
    seen = sight(make_recording, kind, where, 0.0, doppler_max=period / 2)
    plain = replace(seen, rates=None)
    arrays = measurement.innovations(plain, m[None], P[None], False)
    zero = np.zeros(1, int)
    m_place, P_place = measurement.updated(plain, m[None], P[None], *arrays, zero, zero)
    log_place = measurement.log_likelihood(plain, arrays[0], arrays[2], 1e9)[0, 0]
    x, w = nodes(m_place[0], P_place[0])
    h, std = rate(x, HEIGHT), 0.3
    z = float(w @ h) + 0.8
    turns = period * np.arange(-9, 10) if period else np.zeros(1)
    l = norm.pdf(z + turns[:, None], h, std).sum(0)
    log_l, mean, spread = log_place + np.log(w @ l), *moments(x, w * l / (w @ l))
    seen = sight(make_recording, kind, where, z, doppler_max=period / 2)
    z_hat, C, S = measurement.innovations(seen, m[None], P[None], False)
    assert measurement.log_likelihood(seen, z_hat, S, 1e9)[0, 0] == pytest.approx(log_l, abs=0.02)
    m_new, P_new = measurement.updated(seen, m[None], P[None], z_hat, C, S, zero, zero)
    scale = np.sqrt(np.diag(spread))
    np.testing.assert_allclose((m_new[0] - mean) / scale, 0.0, atol=0.05)
    np.testing.assert_allclose(
        P_new[0] / np.outer(scale, scale), spread / np.outer(scale, scale), atol=0.06
    )
    x = pairs.near(seen, m[None], P[None], False, 1e9)
    assert x.log_l[0] == pytest.approx(
        measurement.log_likelihood(seen, z_hat, S, 1e9)[0, 0], abs=1e-9
    )
    for one, other in zip(x.updated(seen, m[None], P[None]), (m_new, P_new), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)


def moving():
    """A sensor that is at PLACE, HEIGHT above targets, at 1 s and moves with SPEED."""
    t = np.arange(3)
    position = np.append(PLACE, -HEIGHT) + (t - 1)[:, None] * SPEED
    return Sensor("radar", t * SECOND, position, np.tile(yaw_quaternion(0.4), (3, 1)))


def sight(make_recording, kind, where, z, sensor=None, **changes):
    """One detection at ``where`` (2,) in the map with the Doppler z, at 1 s."""
    local = (where - PLACE) @ np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    if kind == "range_bearing":
        local = np.array([np.linalg.norm([*local, HEIGHT]), np.arctan2(local[1], local[0])])
    recording = make_recording([[local]], kind)
    scan = next(recording.scans())
    scan = replace(scan, time_ns=SECOND, rows={**scan.rows, "doppler": np.array([z])})
    params = SensorParams(**{**BASE, **changes})
    return look(params, scan, kind == "range_bearing", sensor or moving())


def test_a_sensor_moves_as_its_poses_do():
    np.testing.assert_allclose(velocity_at(moving(), SECOND), SPEED)
    np.testing.assert_allclose(velocity_at(moving(), 0), SPEED)
    assert velocity_at(moving(), 9 * SECOND).tolist() == [0.0, 0.0, 0.0]
    assert velocity_at(Sensor.static("radar", PLACE), 5).tolist() == [0.0, 0.0, 0.0]


def test_a_velocity_changes_with_the_poses():
    """Of constant acceleration the difference over a step to either side is exact."""
    t = np.arange(11) / 10
    position = np.column_stack((t**2, 0 * t, 0 * t))
    sensor = Sensor(
        "radar", np.rint(t * 1e9).astype(np.int64), position, np.tile(yaw_quaternion(0.0), (11, 1))
    )
    assert velocity_at(sensor, SECOND // 2)[0] == pytest.approx(1.0)


def test_ambiguous_doppler_that_may_have_turned_often_says_nothing():
    m, P = target()
    P = P + np.diag([0.0, 0.0, 900.0, 900.0])
    seen = rates(1.0, period=8.0)
    density, m_new, P_new = doppler.first(seen, m[None], P[None])
    assert density[0] == pytest.approx(1 / 8)
    np.testing.assert_array_equal(m_new[0], m)
    np.testing.assert_array_equal(P_new[0], P)


@pytest.mark.parametrize("updates", ["use", "gate"])
def test_a_wrong_doppler_is_no_pair(make_recording, updates):
    m, P = target()
    for z, none in ((60.0, True), (float(rate(m[None], HEIGHT)[0]), False)):
        seen = sight(make_recording, "position", m[:2], z, doppler=updates)
        z_hat, C, S = measurement.innovations(seen, m[None], P[None], False)
        log_l = measurement.log_likelihood(seen, z_hat, S, 20.0)
        assert np.isinf(log_l[0, 0]) == none
        assert len(pairs.near(seen, m[None], P[None], False, 20.0)) == (not none)
    plain = replace(seen, rates=None)
    zero = np.zeros(1, int)
    m_new, _ = measurement.updated(seen, m[None], P[None], z_hat, C, S, zero, zero)
    arrays = measurement.innovations(plain, m[None], P[None], False)
    m_place, _ = measurement.updated(plain, m[None], P[None], *arrays, zero, zero)
    assert np.allclose(m_new, m_place) == (updates == "gate")
    assert seen.with_doppler(np.ones(1))[0] == (1.0 if updates == "gate" else 0.01)


def with_doppler(recording, columns):
    stream = recording.streams["radar"]
    rows = {**stream.rows, **{k: np.array(v) for k, v in columns.items()}}
    return replace(recording, streams={"radar": replace(stream, rows=rows)})


def towards_a_wall(make_recording, n=6, offset=False):
    """A sensor that drives at 8 m/s towards a wall, 100 m ahead at the start."""
    t = np.arange(n)
    position = np.column_stack((8.0 * t, 0 * t, 0 * t))
    sensor = Sensor("radar", t * SECOND, position, np.tile(yaw_quaternion(0.0), (n, 1)))
    recording = make_recording([[[100.0 - 8.0 * k, 0.0]] for k in t], sensor=sensor)
    columns = {"doppler": np.full(n, -8.0)}
    if offset:
        columns["time_offset"] = np.full(n, 0.0)
        columns["time_offset"][1:-1] = 0.25
        stream = recording.streams["radar"]
        stream.rows["x"][1:-1] -= 2.0
    return with_doppler(recording, columns)


FILTER = {
    "p_detect": 0.999, "clutter_rate": 1e-9, "clutter_region": (-500.0, 500.0, -500.0, 500.0),
    "std_position": 1.0, "std_doppler": 0.1, "std_acceleration": 0.1, "birth_rate": 0.1,
}  # fmt: skip


@pytest.mark.parametrize("module", [phd, mbm, pmb])
@pytest.mark.parametrize("offset", [False, True])
def test_a_wall_stands_though_it_comes_nearer(make_recording, module, offset):
    recording = towards_a_wall(make_recording, offset=offset)
    params = module.Params(**FILTER)
    rng = np.random.default_rng(0)
    last = list(module.estimate(recording.setup(), recording.scans(), params, rng))[1]
    (state,), (P,) = last.objects.state, last.objects.covariance
    np.testing.assert_allclose(state, [100.0, 0.0, 0.0, 0.0], atol=0.02)
    assert np.sqrt(P[2, 2]) < 0.15 < np.sqrt(P[3, 3])


def test_all_filters_are_one_with_one_target(make_recording):
    rng = np.random.default_rng(3)
    z = [np.array([[100.0 - 8.0 * k, 0.0]]) + rng.normal(size=2) for k in range(6)]
    recording = with_doppler(make_recording(z), {"doppler": -8.0 + 0.1 * rng.normal(size=6)})
    found = []
    for module in (phd, mbm, pmb):
        more = {"poisson": True} if module is mbm else {}
        params = module.Params(**FILTER, **more)
        steps = list(module.estimate(recording.setup(), recording.scans(), params, rng))
        found.append((steps[-1].objects.state[0], steps[-1].objects.covariance[0]))
    # Births of the PHD move with process noise from their detection on, as they do without Doppler.
    for (state, P), close in zip(found[:2], (0.01, 1e-9), strict=True):
        np.testing.assert_allclose(state, found[2][0], atol=close)
        np.testing.assert_allclose(P, found[2][1], atol=close)


@pytest.mark.parametrize("module", [phd, mbm, pmb])
def test_doppler_of_unknown_noise_is_not_used_and_that_is_said(make_recording, module, caplog):
    recording = towards_a_wall(make_recording)
    plain = replace(recording, streams={"radar": replace(
        recording.streams["radar"], rows={k: recording.streams["radar"].rows[k] for k in "xy"}
    )})  # fmt: skip
    params = module.Params(**{**FILTER, "std_doppler": 0.0})
    rng = np.random.default_rng(0)
    with caplog.at_level(logging.WARNING):
        found = list(module.estimate(recording.setup(), recording.scans(), params, rng))
    assert [r.getMessage() for r in caplog.records] == [
        "radar: Doppler is not used: its noise is not known, give std_doppler"
    ]
    same = list(module.estimate(plain.setup(), plain.scans(), params, rng))
    for a, b in zip(found, same, strict=True):
        np.testing.assert_array_equal(a.objects.state, b.objects.state)
    caplog.clear()
    list(module.estimate(recording.setup(), recording.scans(),
                         replace(params, doppler="ignore"), rng))  # fmt: skip
    assert not caplog.records

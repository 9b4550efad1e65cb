"""A radar that turns while targets move: each row at its own time and from its own pose."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from echoset.estimators.points import mbm, phd
from echoset.estimators.points.model.targets import TargetParams, within
from echoset.models.geometry.poses import yaw_quaternion
from echoset.models.motion import white_acceleration
from echoset.models.records import Sensor

TURN = 2.5
FILTERS = pytest.mark.parametrize(
    ("module", "changes"), [(phd, {}), (mbm, {"poisson": False}), (mbm, {"poisson": True})]
)


def scene(make_recording, rng, kind, steps=8):
    """A target at 20 m/s and the platform at 5 m/s, and when the beam meets it in each turn."""
    x = np.array([200.0, -100.0, -12.0, 16.0])
    offset, scans, now = [], [], 0.0
    for k in range(steps):
        tau = rng.uniform(0, TURN)
        t = k * TURN + tau
        dt, now = t - now, t
        noise = rng.multivariate_normal(np.zeros(4), 0.1 * white_acceleration(dt))
        x = np.concatenate((x[:2] + dt * x[2:], x[2:])) + noise
        d = x[:2] - np.array([5.0 * t, 0.0])
        z = d + rng.normal(size=2)
        if kind == "range_bearing":
            z = np.array([np.hypot(*d), np.arctan2(d[1], d[0])]) + rng.normal(size=2) * (1.0, 0.005)
        scans.append(z[None])
        offset.append(tau)
    last, dt = x, steps * TURN - now
    end = np.concatenate((last[:2] + dt * last[2:], last[2:]))
    end = end + rng.multivariate_normal(np.zeros(4), 0.1 * white_acceleration(dt))
    path = np.array([[0.0, 0.0, 0.0], [5000.0, 0.0, 0.0]])
    sensor = Sensor("radar", np.array([0, 10**12]), path, np.tile(yaw_quaternion(0.0), (2, 1)))
    # A last scan, without detections, to be asked about.
    recording = make_recording([*scans, []], kind, dt=TURN, sensor=sensor)
    stream = recording.streams["radar"]
    rows = {**stream.rows, "time_offset": np.array(offset)}
    return replace(recording, streams={"radar": replace(stream, rows=rows)}), end


@pytest.mark.parametrize("kind", ["position", "range_bearing"])
@FILTERS
def test_nees_of_a_turning_radar(make_recording, module, changes, kind):
    rng, total, runs = np.random.default_rng(8), 0.0, 50
    birth = (1.0, 200.0, -100.0, -12.0, 16.0, 1e-3, 1e-3, 1e-3, 1e-3)
    for _ in range(runs):
        recording, end = scene(make_recording, rng, kind)
        params = module.Params(
            p_detect=1.0 - 1e-9, clutter_rate=1e-9, clutter_region=(-1e4, 1e4, -1e4, 1e4),
            std_position=1.0, std_range=1.0, std_azimuth=0.005, acceleration_density=0.1,
            p_survive=1.0, time_unit=1e9, birth="components", birth_components=(birth,),
            gate=1e9, **changes,
        )  # fmt: skip
        context, state = module.Context.of(recording.setup(), params), module.init()
        for scan in recording.scans():
            if len(scan.rows["time_offset"]):
                state, _ = module.step(state, [scan], context)
        predicted = module.predict(state, params, scan.time_ns)[0].mixture
        x = getattr(predicted, "local", predicted)
        best = (x.r if hasattr(x, "r") else x.w).argmax()
        e = x.m[best] - end
        total += e @ np.linalg.solve(x.P[best], e)
    # The acceleration within a turn counts in part twice, which makes the filter wary by some.
    low, high = chi2.ppf([0.001, 0.999], 4 * runs)
    assert 0.8 * low < total < high


def test_the_way_back_in_time_is_that_of_the_motion():
    motion = within(TargetParams(acceleration_density=1.0))
    F, Q = motion(-0.5)
    ahead, noise = motion(0.5)
    np.testing.assert_allclose(F @ ahead, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(ahead @ Q @ ahead.T, noise, atol=1e-12)


@FILTERS
def test_offsets_of_nought_change_nothing(make_recording, module, changes):
    rng = np.random.default_rng(9)
    recording, _ = scene(make_recording, rng, "position")
    stream = recording.streams["radar"]
    rows = {k: v for k, v in stream.rows.items() if k != "time_offset"}
    plain = replace(recording, streams={"radar": replace(stream, rows=rows)})
    nought = {**rows, "time_offset": np.zeros(len(rows["x"]))}
    zero = replace(recording, streams={"radar": replace(stream, rows=nought)})
    params = module.Params(
        p_detect=0.9, clutter_rate=1.0, clutter_region=(-1e3, 1e3, -1e3, 1e3), std_position=1.0,
        birth_std_velocity=(20.0, 20.0), **changes,
    )  # fmt: skip
    a, b = (list(module.estimate(r.setup(), r.scans(), params, None)) for r in (plain, zero))
    for one, other in zip(a, b, strict=True):
        np.testing.assert_array_equal(one.objects.state, other.objects.state)

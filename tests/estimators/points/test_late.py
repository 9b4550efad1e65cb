"""Sensors that are late or shifted: as if their scans had other stamps and other detections."""

from dataclasses import replace

import numpy as np
import pytest

from echoset.estimators.points import mbm, phd, pmb
from echoset.estimators.points.late import true_times
from echoset.estimators.points.model.sensing import SensorParams
from echoset.models.geometry.poses import yaw_quaternion
from echoset.models.records import Scan, Sensor

SECOND = 10**9
BASE = {
    "p_detect": 0.9, "clutter_rate": 0.1, "clutter_region": (-500.0, 500.0, -500.0, 500.0),
    "std_position": 1.0, "std_range": 1.0, "std_azimuth": 0.01, "max_range": 500.0,
    "time_unit": 1.0, "acceleration_density": 0.1,
}  # fmt: skip
FILTERS = pytest.mark.parametrize("module", [phd, mbm, pmb])


def own(**late):
    return {k: SensorParams(p_detect=0.9, clutter_rate=0.0, latency=v) for k, v in late.items()}


def test_scans_stand_in_the_order_of_when_they_were_true():
    rng = np.random.default_rng(3)
    times = {"a": rng.choice(20_000, 60, False), "b": rng.choice(20_000, 40, False)}
    scans = sorted(
        (Scan(name, int(t) * 10**6, {}, {}) for name, ts in times.items() for t in ts),
        key=lambda scan: (scan.time_ns, scan.stream),
    )
    found = list(true_times(iter(scans), own(a=1.7, b=0.2)))
    late = {"a": 1_700_000_000, "b": 200_000_000}
    expected = sorted((scan.time_ns - late[scan.stream], scan.stream) for scan in scans)
    assert [(scan.time_ns, scan.stream) for scan in found] == expected
    assert list(true_times(iter(scans), own(a=0.0, b=0.0))) == scans


def test_no_scan_waits_longer_than_it_may_be_overtaken():
    read = []

    def stream():
        for k in range(50):
            read.append(k)
            yield Scan("a", k * SECOND, {}, {})

    for k, scan in enumerate(true_times(stream(), own(a=3.0))):
        assert scan.time_ns == (k - 3) * SECOND
        assert read[-1] <= k + 4


def two(make_recording, kind="position"):
    """Two radars on a platform that drives at 5 m/s and turns, and a target at 10 m/s."""
    t = np.arange(12)
    position = np.column_stack((5.0 * t, 0 * t, 0 * t))
    sensor = Sensor("radar", t * SECOND, position, yaw_quaternion(0.05 * t))
    rng = np.random.default_rng(2)
    scans = []
    for k in t:
        c, s = np.cos(0.05 * k), np.sin(0.05 * k)
        d = (np.array([100.0 + 10.0 * k, 40.0]) - position[k, :2]) @ np.array([[c, -s], [s, c]])
        z = d if kind == "position" else np.array([np.hypot(*d), np.arctan2(d[1], d[0])])
        scans.append((z + rng.normal(size=2) * ((1, 1) if kind == "position" else (1, 0.01)))[None])
    recording = make_recording(scans, kind, sensor=sensor)
    stream = recording.streams["radar"]
    part = {"a": stream.part(0, 12), "b": replace(stream.part(0, 12), time_ns=stream.time_ns + 300)}
    return replace(recording, streams=part)


def run(module, recording, **changes):
    params = module.Params(**{**BASE, **changes})
    rng = np.random.default_rng(0)
    return list(module.estimate(recording.setup(), recording.scans(), params, rng))


def same(found, expected):
    assert len(found) == len(expected)
    for a, b in zip(found, expected, strict=True):
        assert a.objects.time_ns.tolist() == b.objects.time_ns.tolist()
        np.testing.assert_allclose(a.objects.state, b.objects.state, atol=1e-9)


@FILTERS
def test_a_late_sensor_is_one_with_earlier_stamps(make_recording, module):
    recording = two(make_recording)
    b = recording.streams["b"]
    late = replace(b, time_ns=b.time_ns + 1_400_000_000)
    found = run(
        module, replace(recording, streams={**recording.streams, "b": late}),
        sensors={"b": {"latency": 1.4}},
    )  # fmt: skip
    same(found, run(module, recording))


@FILTERS
@pytest.mark.parametrize("kind", ["position", "range_bearing"])
@pytest.mark.parametrize("timed", [False, True])
def test_offsets_are_taken_off(make_recording, module, kind, timed):
    recording = two(make_recording, kind)
    names, shift = (
        (("x", "y"), (4.0, -3.0)) if kind == "position" else (("range", "azimuth"), (4.0, 0.1))
    )
    b = recording.streams["b"]
    if timed:
        b = replace(b, rows={**b.rows, "time_offset": np.full(12, 0.2)})
        recording = replace(recording, streams={**recording.streams, "b": b})
    rows = {**b.rows, **{k: b.rows[k] + s for k, s in zip(names, shift, strict=True)}}
    moved = replace(recording, streams={**recording.streams, "b": replace(b, rows=rows)})
    found = run(module, moved, sensors={"b": {"registration": shift}})
    same(found, run(module, recording))

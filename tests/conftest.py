"""Small records that hold every kind of stream, for all tests."""

from __future__ import annotations

import numpy as np
import pytest

from echoset.models.records import Estimates, Meta, Objects, Recording, Sensor, Stream, Truth

SECOND = 10**9


def ragged(rng: np.random.Generator, scans: int, mean: float) -> np.ndarray:
    """Row offsets of Poisson-sized scans, empty ones among them."""
    return np.concatenate(([0], np.cumsum(rng.poisson(mean, scans)))).astype(np.int64)


def objects(rng: np.random.Generator, steps: int) -> Objects:
    """One ellipse and its device over ``steps`` seconds."""
    root = rng.normal(size=(steps, 4, 4))
    return Objects(
        np.arange(steps, dtype=np.int64) * SECOND,
        np.arange(steps + 1, dtype=np.int64),
        np.zeros(steps, np.int64),
        ("x", "y", "device_x", "device_y"),
        ("m", "m", "m", "m"),
        rng.normal(size=(steps, 4)),
        covariance=root @ root.swapaxes(1, 2),
        existence=np.ones(steps),
        extent_kind="ellipse",
        semi_axes=rng.uniform(0.1, 0.5, (steps, 2)),
        rotation=np.zeros(steps),
    )


@pytest.fixture
def recording() -> Recording:
    """A UWB network, a radar with a moving view, a Cartesian radar and a radar with maps."""
    rng = np.random.default_rng(7)
    offset = ragged(rng, 300, 3.0)
    m = offset[-1]
    x = np.where(rng.random(m) < 0.3, np.nan, rng.normal(size=m))
    uwb = Stream(
        "uwb",
        ("A1", "A2", "D"),
        {"mean_clutter": 5.0, "max_range": 20.0, "table": np.arange(6.0).reshape(2, 3)},
        np.repeat(np.arange(150, dtype=np.int64), 2) * SECOND // 10,
        offset,
        {
            "mode": np.tile(np.array([0, 1], "u1"), 150),
            "tx": np.tile(np.array([2, 0], "i4"), 150),
            "rx": np.tile(np.array([0, 1], "i4"), 150),
        },
        {
            "distance": rng.uniform(0, 20, m),
            "amplitude": rng.uniform(1, 20, m),
            "origin_id": rng.integers(-1, 1, m).astype("i4"),
            "origin_x": x,
            "origin_y": x,
        },
    )
    times = np.arange(10, dtype=np.int64) * SECOND + 5
    offset = ragged(rng, 10, 2.0)
    bearing = Stream(
        "range_bearing",
        ("R",),
        {"p_detect": 0.9},
        times,
        offset,
        {"view_range_min": np.full(10, 1.0), "view_range_max": np.full(10, 9.0)},
        {
            "range": rng.uniform(1, 9, offset[-1]),
            "azimuth": rng.uniform(-1, 1, offset[-1]),
            "origin_id": np.zeros(offset[-1], "i4"),
        },
    )
    root = rng.normal(size=(offset[-1], 2, 2))
    xx, xy, _, yy = np.ascontiguousarray((root @ root.swapaxes(1, 2)).reshape(-1, 4).T)
    plane = {c: rng.normal(size=offset[-1]) for c in "xy"}
    plane |= {"cov_xx": xx, "cov_xy": xy, "cov_yy": yy}
    position = Stream("position", ("R",), {}, times, offset, {}, plane)
    power = rng.exponential(size=(10, 4, 6)).astype("f4")
    none = np.zeros(11, np.int64)
    axes = {"range_axis": np.arange(4.0), "azimuth_axis": np.linspace(-1, 1, 6)}
    maps = Stream("range_angle_map", ("R",), axes, times, none, {"map": power}, {})
    moving = Sensor(
        "radar",
        np.arange(3, dtype=np.int64) * SECOND,
        rng.normal(size=(3, 3)),
        np.tile([0.0, 0.0, 0.0, 1.0], (3, 1)),
    )
    sensors = {
        "A1": Sensor.static("anchor", np.array([1.0, 2.0])),
        "A2": Sensor.static("anchor", np.array([3.0, 2.0])),
        "D": Sensor.device(0),
        "R": moving,
    }
    truth = Truth(objects(rng, 20), np.array([5]), np.array([2], np.int32), np.array([0], np.int32))
    streams = {"uwb": uwb, "bearing": bearing, "position": position, "maps": maps}
    meta = Meta("example-s1-0000", provenance={"scenario": "example", "seed": 1})
    return Recording(meta, sensors, streams, truth)


@pytest.fixture
def estimates() -> Estimates:
    """Estimates of one object over more steps than a window of a file holds."""
    rng = np.random.default_rng(8)
    provenance = {"estimator": "example", "input": {"name": "example-s1-0000", "digest": "0"}}
    steps = {"effective_sample_size": rng.uniform(1, 9, 1500), "cardinality_mean": np.ones(1500)}
    return Estimates(Meta("example-s1-0000", provenance=provenance), objects(rng, 1500), steps)

"""An object that walks along x with a device on it, and a network of three anchors around it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from echoset.models.records import Estimates, Meta, Objects, Recording, Sensor, Stream, Truth

NAMES = ("x", "y", "device_x", "device_y")
UNITS = ("m",) * 4


def walker(time_ns: np.ndarray, **columns: Any) -> Objects:
    """Centre (t, 0) and device (t, 1) for t in seconds."""
    t = np.asarray(time_ns) / 1e9
    n = len(t)
    state = np.stack([t, np.zeros(n), t, np.ones(n)], 1)
    return Objects(
        np.asarray(time_ns, np.int64),
        np.arange(n + 1),
        np.zeros(n, np.int64),
        NAMES,
        UNITS,
        state,
        **columns,
    )


@pytest.fixture
def recording() -> Recording:
    """Truth at 0, 1, ..., 10 s and no events."""
    return Recording(Meta("walk-s1-0000"), {}, {}, Truth(walker(np.arange(11) * 10**9)))


@pytest.fixture
def estimate() -> Callable[..., Estimates]:
    """Estimates of the walker at times [s], off by (n, 4) or (4,)."""

    def make(times: Any, off: Any = 0.0, **columns: Any) -> Estimates:
        objects = walker(np.round(np.asarray(times) * 1e9).astype(np.int64), **columns)
        objects.state[:] += off
        return Estimates(Meta("walk-s1-0000", provenance={"estimator": "e"}), objects, {})

    return make


@pytest.fixture
def network() -> Recording:
    """Five steps of 0.1 s with three anchors; in the last three A1 and A2 are blocked."""
    n = 5
    time = np.arange(1, n + 1) * 100_000_000
    p = np.stack([np.linspace(2.0, 2.4, n), np.full(n, 1.5)], 1)
    m = p + 0.32 * np.array([np.cos(-1.0), np.sin(-1.0)])
    objects = Objects(
        time,
        np.arange(n + 1),
        np.zeros(n, np.int64),
        NAMES,
        UNITS,
        np.hstack([p, m]),
        extent_kind="ellipse",
        semi_axes=np.tile([0.3, 0.2], (n, 1)),
        rotation=np.zeros(n),
    )
    sensors = {
        name: Sensor.static("anchor", position)
        for name, position in (("A1", (4.0, 4.5)), ("A2", (0.0, 0.5)), ("A3", (6.5, 0.0)))
    }
    sensors["m"] = Sensor.device(0)
    links = [(k, 0, 3, j) for k in range(n) for j in range(3)]
    links += [(k, 1, i, j) for k in range(n) for i in range(3) for j in range(3)]
    events = np.array(sorted(x for x in links if x[0] < 2 or x[1] == 1 or x[3] == 2))
    blocked = np.array([x for x in links if x[0] >= 2 and x[1] == 0 and x[3] < 2])
    stream = Stream(
        "uwb",
        ("A1", "A2", "A3", "m"),
        {},
        time[events[:, 0]],
        np.zeros(len(events) + 1, np.int64),
        {
            "mode": events[:, 1].astype("u1"),
            "tx": events[:, 2].astype("i4"),
            "rx": events[:, 3].astype("i4"),
        },
        {"distance": np.zeros(0)},
    )
    truth = Truth(objects, time[blocked[:, 0]], *(blocked[:, c].astype("i4") for c in (2, 3)))
    return Recording(Meta("net-s1-0000"), sensors, {"uwb": stream}, truth)


Steps = list[dict[int, tuple[float, float]]]
"""Positions [m] of objects by label, second by second."""


@pytest.fixture
def scene() -> Callable[[Steps, Steps], tuple[Estimates, Recording]]:
    """Estimates and a recording whose truth is given, of points at 0, 1, ... s."""

    def points(steps: Steps) -> Objects:
        offset = np.cumsum([0, *map(len, steps)])
        labels = [label for step in steps for label in step]
        state = np.array([p for step in steps for p in step.values()], float).reshape(-1, 2)
        time = np.arange(len(steps)) * 10**9
        return Objects(time, offset, np.array(labels, np.int64), NAMES[:2], UNITS[:2], state)

    def make(truth: Steps, estimated: Steps) -> tuple[Estimates, Recording]:
        meta = Meta("scene-s1-0000", provenance={"estimator": "e"})
        return Estimates(meta, points(estimated), {}), Recording(meta, {}, {}, Truth(points(truth)))

    return make

"""Records in one line each, for tests that need no more than something small and sound."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from echoset.models.records import Meta, Objects, Recording, Sensor, Stream, Truth

SECOND = 10**9


def index(counts: Sequence[int], period: int = SECOND) -> tuple[np.ndarray, np.ndarray]:
    """Times from 0 on, ``period`` [ns] apart, and row offsets of ``counts`` rows at each."""
    offset = np.concatenate(([0], np.cumsum(counts)))
    return np.arange(len(counts), dtype=np.int64) * period, offset.astype(np.int64)


def radar(points: Sequence[Sequence[Sequence[float]]], node: str = "R", **model: Any) -> Stream:
    """A radar that sees ``points[k]``, (n, 2) [m], in scan k, one scan a second."""
    xy = np.array([p for scan in points for p in scan], float).reshape(-1, 2)
    scans = index([len(scan) for scan in points])
    return Stream("position", (node,), model, *scans, {}, {"x": xy[:, 0], "y": xy[:, 1]})


def uwb(distances: Sequence[Sequence[float]], anchor: str = "A", **model: Any) -> Stream:
    """A link from the device ``D`` to ``anchor`` that measures ``distances[k]`` [m] in second k."""
    rows = {"distance": np.array([d for event in distances for d in event], float)}
    n = len(distances)
    scan = {"mode": np.zeros(n, "u1"), "tx": np.ones(n, "i4"), "rx": np.zeros(n, "i4")}
    times = index([len(event) for event in distances])
    return Stream("uwb", (anchor, "D"), model, *times, scan, rows)


def objects(
    states: Sequence[Sequence[Sequence[float]]], names: str = "x y", **more: Any
) -> Objects:
    """The objects ``states[k]``, (n, dx), in second k, labelled in their order."""
    columns = tuple(names.split())
    rows = [row for step in states for row in step]
    label = np.array([i for step in states for i in range(len(step))], np.int64)
    state = np.array(rows, float).reshape(-1, len(columns))
    units = tuple("m" for _ in columns)
    return Objects(*index([len(step) for step in states]), label, columns, units, state, **more)


def recording(
    streams: Mapping[str, Stream], truth: Objects | None = None, name: str = "small"
) -> Recording:
    """A recording of ``streams``, whose radars and anchors stand at the origin."""
    at = np.zeros(2)
    kinds = {n: "anchor" if s.kind == "uwb" else "radar" for s in streams.values() for n in s.nodes}
    sensors = {
        node: Sensor.device() if node == "D" else Sensor.static(kind, at)
        for node, kind in kinds.items()
    }
    return Recording(Meta(name), sensors, dict(streams), None if truth is None else Truth(truth))

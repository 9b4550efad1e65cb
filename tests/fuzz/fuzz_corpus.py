"""Small sound inputs of every reader, made by our own simulators and writers."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from echoset import api, formats
from echoset.campaign.scenarios import find
from echoset.formats import scores as score_files
from echoset.formats import weights
from echoset.metrics.kit.table import rows
from echoset.models.classifier import SHAPES, Weights
from echoset.models.parameters import resolve
from echoset.models.random import generator
from echoset.models.records import Estimates, Recording, Scores

Files = dict[str, bytes]
"""One input: the files that make it, by name; the first is the one that is changed."""

CSV_MAPPING = {
    "kind": "uwb",
    "columns": {"time": "t", "anchor": "id", "distance": "r"},
    "anchors": {"A": [0, 0], "B": [4, 0, 2.5], "C": [4, 5]},
}
POINTS_MAPPING = {"kind": "range_bearing", "columns": {"time": "t", "range": "r", "azimuth": "b"}}


def simulated(name: str, **values: object) -> Recording:
    """A recording of a scenario."""
    found = find(name)
    params = resolve(found.module.Params, *found.layers, ("fuzz", values))
    record: Recording = found.module.simulate(params, generator(1, "fuzz", name), name)
    provenance = {"scenario": name, "seed": 1}
    return replace(record, meta=replace(record.meta, provenance=provenance))


@cache
def records() -> tuple[Recording | Estimates, ...]:
    """Link events, scans with their truth, and estimates with their recording."""
    radar = simulated("moving-platform", steps=3)
    estimates = api.estimate(radar, "phd", birth_rate=0.1)
    return (
        simulated("uwb-los", steps=2, anchors=[[4.0, 4.5]]),
        radar,
        replace(estimates, recording=radar),
    )


@cache
def binary(form: str) -> tuple[Files, ...]:
    """The records as files of a format."""
    found = []
    for record in records():
        data = io.BytesIO()
        formats.write(record, data, form)
        found.append({f"a.{form}": data.getvalue()})
    return tuple(found)


def table() -> Scores:
    """Scores with times, aggregates and what is missing."""
    time = np.arange(4) / 3
    series = rows(("rec", "phd", "ospa", ""), time, time**2)
    whole = rows(("rec", "phd", "ospa", "örtlich"), np.nan, 0.25, 4, [0.125])
    return replace(Scores.join([series, whole]), provenance={"versions": {"numpy": "2.0"}})


@cache
def scores(form: str) -> tuple[Files, ...]:
    """The scores as a file of a format."""
    data = io.BytesIO()
    score_files.write(table(), data, form)
    return ({f"a.{form}": data.getvalue()},)


@cache
def archives() -> tuple[Files, ...]:
    """Weights of a classifier."""
    rng = np.random.default_rng(1)
    arrays = {name: rng.random(shape, np.float32) + 1 for name, shape in SHAPES.items()}
    with TemporaryDirectory() as folder:
        path = Path(folder) / "w.npz"
        weights.write(path, Weights.of(arrays))
        return ({"w.npz": path.read_bytes()},)


@cache
def labyrinth() -> tuple[Files, ...]:
    """Ranges of a walk among anchors, and the walk."""
    rng = np.random.default_rng(2)
    anchors = {"1": (0.0, 0.5), "2": (4.0, 4.5), "3": (6.5, 0.0)}
    log, points = [], []
    for k in range(4):
        t, x, y = 0.1 * k, 1.0 + 0.2 * k, 2.0
        points.append(f"point2 {t:.6f} {x} {y} 0.01 0 0 0.01")
        log.append(f"odom2diff {t:.6f} 0.5 0.5 0.0 0.2 0.01 0.01 0.02")
        for name, (ax, ay) in anchors.items():
            r = np.hypot(x - ax, y - ay) + 0.05 * rng.standard_normal()
            log.append(f"range2 {t:.6f} {r:.6f} 0.01 {ax} {ay} {name} 0")
    pair = "\n".join(log).encode() + b"\n", "\n".join(points).encode() + b"\n"
    return {"a.txt": pair[0], "b.txt": pair[1]}, {"b.txt": pair[1], "a.txt": pair[0]}


@cache
def delimited() -> tuple[Files, ...]:
    """A log of ranges and one of radar points, each with its mapping."""
    ranges = "# a log\nt,id,r,note\n" + "".join(
        f"{0.1 * k:.3f},{name},{3 + 0.1 * k:.3f},x\n" for k in range(5) for name in "ABC"
    )
    points = "t,r,b\n" + "".join(f"{k},{10 + k}.5,{0.1 * k:.2f}\n" for k in range(6))
    return (
        {"a.csv": ranges.encode(), "m.json": json.dumps(CSV_MAPPING).encode()},
        {"a.csv": points.encode(), "m.json": json.dumps(POINTS_MAPPING).encode()},
    )


@cache
def autoferry() -> tuple[Files, ...]:
    """Scans of a radar and a lidar, and the fixes of two vessels."""

    def scan(sensor: int, time: float, measurement: Any) -> dict[str, Any]:
        own = [10.0 + time, 100.0]
        return {
            "sensorID": sensor, "time": time, "ownshipPosition": own, "measurement": measurement
        }  # fmt: skip

    log = [
        scan(2, 1.5, [[1.0, 2.0], [3.0, 4.0]]), scan(1, 1.0, [7.5, 8.0]), scan(2, 0.5, []),
        scan(2, 2.5, [[5.0], [6.0]]), scan(1, 2.0, []),
    ]  # fmt: skip
    truth = [
        [{"targetID": i, "time": t + 0.25 * i, "position": [t, 5.0 * i, 0.0]} for i in (1, 2)]
        for t in (0.0, 0.5, 1.0, 1.5)
    ]
    pair = json.dumps(log, indent=0).encode(), json.dumps(truth, indent=0).encode()
    names = "x_detections.json", "x_groundTruth.json"
    return (
        {names[0]: pair[0], names[1]: pair[1]},
        {names[1]: pair[1], names[0]: pair[0]},
    )


SCENARIO = b"""\
scenario: uwb-los
parameters:
  steps: 18
  dt: 0.1
  anchors: [[4.0, 4.5], [0.0, 0.5], [6.5, 0.0]]
  path:
    - [0.6, 1.2]
    - [1.8, 2.6]
    - [3.2, 3.4]
    - [4.4, 2.6]
  semi_axes: [0.3, 0.2]
  mean_clutter: 5.0
  max_range: 2e1
  blocked: []
"""
MAPPING = b"""\
kind: uwb
delimiter: ","
columns:
  time: {column: t, unit: ms}
  anchor: id
  distance: {column: 3, scale: 0.01}
anchors:
  A1: [0, 0]
  A2: [4.2, 0, 2.5]
epoch: 2020-01-01T00:00:00Z
frame: [north, east, down]
model: {sigma: 0.1, mean_clutter: 0.5}
"""
CONFIG = b"""\
# of an estimator
p_detect: 0.9
clutter_rate: 5
birth_std_velocity: [2.5, 2.5]
sensors:
  radar: {p_detect: 0.8, std_position: 1e-1}
regions: {B1: [100.0, 300.0, 100.0, 300.0]}
"""

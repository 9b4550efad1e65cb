"""Importer of the Autoferry benchmark: radar and lidar of a ferry, and where two vessels were.

Helgesen et al., Heterogeneous multi-sensor tracking for an autonomous surface vehicle in a
littoral environment, Ocean Engineering 252 (2022) 111080. ``..._detections.json`` is a list of
records, one a scan::

    {"sensorID": 2, "time": unix [s], "ownshipPosition": [north, east] [m],
     "measurement": [[north, ...], [east, ...]] [m], relative to the own ship}

with a flat pair for a single point and an empty list where nothing was detected. Sensor 1 is the
lidar, 2 the radar; the bearings of the infrared (3) and optical cameras (4) are left out.
``..._groundTruth.json`` holds lists of ``{"targetID", "time", "position": [north, east, down]}``.

Each sensor becomes a stream of Cartesian points, x east and y north of the own ship, whose
position is the pose of the sensor; its axes are those of the map. Records in any order are sorted
stably by time. A true set needs all vessels at one time: it stands at every fix of any of them,
the others between their own fixes by linear interpolation. Heights are not used.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path

import numpy as np

from ...models.checks import check
from ...models.errors import FormatError, InputError
from ...models.parameters import as_dict, parameter, require
from ...models.records import Array, Meta, Recording, Sensor, Stream, Truth
from .json import Document, read_json, shown
from .tracks import Fixes, align

SUMMARY = "radar and lidar points and true vessels of the Autoferry benchmark (JSON)"
SENSORS = {"radar": 2, "lidar": 1}
LEFT_OUT = (3, 4)
ENDINGS = ("_detections", "_groundTruth")


@dataclass(frozen=True, slots=True)
class Params:
    """What is taken from the files."""

    sensors: tuple[str, ...] = parameter(("radar", "lidar"), "", "sensors to import")
    max_gap: float = parameter(1.0, "s", "longest time between fixes of a vessel to bridge")

    def __post_init__(self) -> None:
        known = len(set(self.sensors)) == len(self.sensors) > 0 and set(self.sensors) <= set(
            SENSORS
        )
        require(known, "sensors", f"some of {', '.join(SENSORS)}", self.sensors)
        require(self.max_gap > 0, "max_gap", "positive", self.max_gap)


def read(paths: Sequence[Path], params: Params) -> Recording:
    """The recording in a file of detections, with or without one of the truth, or in their folder.

    Raises
    ------
    FormatError : a file is unreadable or breaks the format
    InputError : a file or the scans of a sensor are missing
    """
    documents = [read_json(path) for path in _files(paths)]
    true = [d for d in documents if isinstance(d.content, list) and _is_list(d.content[:1])]
    logs = [d for d in documents if d not in true]
    if len(logs) != 1 or len(true) > 1:
        reason = "autoferry reads one file of detections and at most one of ground truth"
        raise FormatError(documents[-1].file.path, f"{len(logs)} files of detections", reason)
    scans = _scans(logs[0])
    for name in params.sensors:
        if not scans[name].time:
            raise FormatError(
                logs[0].file.path, f"sensorID {SENSORS[name]}", f"no scan of the {name}"
            )
    built = {name: scans[name].build(name, logs[0]) for name in params.sensors}
    provenance = {
        "importer": "autoferry",
        "files": [d.file.provenance for d in documents],
        "parameters": as_dict(params),
    }
    recording = Recording(
        Meta(logs[0].file.path.stem.removesuffix(ENDINGS[0]), provenance=provenance),
        {name: sensor for name, (sensor, _) in built.items()},
        {name: stream for name, (_, stream) in built.items()},
        _truth(true[0], params.max_gap) if true else None,
    )
    check(recording, logs[0].file.path)
    return recording


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file, from its first bytes, or a folder is one of the benchmark."""
    if path.is_dir():
        return any(path.glob(f"*{ENDINGS[0]}.json"))
    return head.lstrip()[:1] == b"[" and b'"sensorID"' in head


def _files(paths: Sequence[Path]) -> list[Path]:
    if len(paths) == 1 and paths[0].is_dir():
        found = [f for ending in ENDINGS for f in sorted(paths[0].glob(f"*{ending}.json"))]
        if not found:
            raise InputError(f"{paths[0]}: there is no ...{ENDINGS[0]}.json")
        return found
    return list(paths)


def _is_list(values: list[object]) -> bool:
    return any(isinstance(value, list) for value in values)


@dataclass(slots=True)
class _Scans:
    """The scans of one sensor in the order of the file, each with its number there."""

    number: list[int] = field(default_factory=list)
    time: list[int] = field(default_factory=list)
    own: list[list[float]] = field(default_factory=list)
    points: list[Array] = field(default_factory=list)

    def build(self, name: str, log: Document) -> tuple[Sensor, Stream]:
        """Sensor and stream, sorted by time."""
        time = np.array(self.time, np.int64)
        order = np.argsort(time, kind="stable")
        again = order[1:][np.diff(time[order]) == 0]
        if len(again):
            log.fail(f"[{self.number[again[0]]}]", f"a second scan of the {name} at the same time")
        n = len(time)
        own = np.array(self.own)[order]
        position = np.column_stack((own[:, 1], own[:, 0], np.zeros(n)))
        quaternion = np.tile([0.0, 0.0, 0.0, 1.0], (n, 1))
        points = [self.points[i] for i in order]
        offset = np.cumsum([0, *map(len, points)])
        north, east = np.concatenate(points).T
        rows = {"x": np.ascontiguousarray(east), "y": np.ascontiguousarray(north)}
        stream = Stream("position", (name,), {}, time[order], offset, {}, rows)
        return Sensor("radar", time[order], position, quaternion), stream


def _scans(log: Document) -> dict[str, _Scans]:
    if not isinstance(log.content, list):
        log.fail("", "is not a list of records")
    found = {name: _Scans() for name in SENSORS}
    names = {number: name for name, number in SENSORS.items()}
    for i, record in enumerate(log.content):
        identity = _get(log, record, "sensorID", f"[{i}]")
        if identity in LEFT_OUT:
            continue
        if not isinstance(identity, Decimal) or identity not in names:
            known = ", ".join(map(str, sorted((*names, *LEFT_OUT))))
            log.fail(f"[{i}].sensorID", f"{shown(identity)} is not one of {known}")
        scans = found[names[int(identity)]]
        scans.number.append(i)
        scans.time.append(_time(log, record, f"[{i}]"))
        own = _get(log, record, "ownshipPosition", f"[{i}]")
        scans.own.append(log.vector(own, f"[{i}].ownshipPosition", 2))
        scans.points.append(_points(log, record, f"[{i}]"))
    return found


def _get(document: Document, record: object, key: str, where: str) -> object:
    if not isinstance(record, dict):
        document.fail(where, f"{shown(record)} is not a record")
    if key not in record:
        document.fail(where, f"{key!r} is missing")
    value: object = record[key]
    return value


def _time(document: Document, record: object, where: str) -> int:
    """The time of a record [ns]."""
    time = document.finite(_get(document, record, "time", where), f"{where}.time")
    if abs(time) > 9_000_000_000:
        document.fail(f"{where}.time", f"{shown(time)} s is beyond the years 1680 to 2260")
    return round(time.scaleb(9))


def _points(log: Document, record: object, where: str) -> Array:
    """The points (m, 2) of a record, north and east."""
    value = _get(log, record, "measurement", where)
    where += ".measurement"
    if value == []:
        return np.zeros((0, 2))
    if not isinstance(value, list) or not _is_list(value):
        return np.array([log.vector(value, where, 2)])
    if len(value) != 2:
        log.fail(where, f"has {len(value)} lists, needs north and east")
    north, east = (log.vector(row, f"{where}[{k}]") for k, row in enumerate(value))
    if len(north) != len(east):
        log.fail(where, f"{len(north)} north and {len(east)} east coordinates")
    return np.column_stack((north, east))


def _truth(document: Document, max_gap: float) -> Truth:
    fixes: Fixes = {}
    for i, targets in enumerate(document.content):
        if not isinstance(targets, list):
            document.fail(f"[{i}]", f"{shown(targets)} is not a list of targets")
        for k, target in enumerate(targets):
            where = f"[{i}][{k}]"
            label = _get(document, target, "targetID", where)
            if not isinstance(label, Decimal) or not 0 <= label < 2**31 or label != int(label):
                document.fail(f"{where}.targetID", f"{shown(label)} is not a label")
            position = _get(document, target, "position", where)
            north, east, *_ = document.vector(position, f"{where}.position", 2, 3)
            track = fixes.setdefault(int(label), {})
            time = _time(document, target, where)
            if track.setdefault(time, (east, north)) != (east, north):
                document.fail(where, "the same vessel elsewhere at the same time")
    if not fixes:
        document.fail("targetID", "there is no vessel")
    return Truth(align(fixes, max_gap))

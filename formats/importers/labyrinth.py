"""Importer of the text logs of libRSF: UWB two-way ranges of a robot, and its ground truth.

The Labyrinth Dataset, Tim Pfeifer, TU Chemnitz. Lines of fields separated by blanks::

    range2 time[s] range[m] variance[m2] anchor_x[m] anchor_y[m] anchor_id 0
    point2 time[s] x[m] y[m] covariance[m2] (4 values)

Ranges become active link events of one device, anchors sensors at rest, and points the truth:
``device_x device_y``, without an extent. The covariance of the points is not used, and lines of
wheel odometry (``odom2diff``) are skipped, as long as they are numbers. Lines that are late are
sorted stably by time; a clock that begins anew is refused. Two-way ranging tells one distance per
event, which the stream's model says as ``mean_los`` 1 and ``mean_scatter`` 0, and its distances
share an offset as long as the delays of the antennas are not calibrated: ``range_bias_std`` says
how well it is known beforehand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...models.checks import NAME, check
from ...models.columns import ACTIVE
from ...models.errors import FormatError
from ...models.parameters import as_dict, parameter, require
from ...models.records import Array, Meta, Objects, Recording, Sensor, Stream, Truth
from .rows import restart, to_stream
from .text import Table, TextFile, read_text

SUMMARY = "UWB two-way ranges and ground truth in the text form of libRSF (The Labyrinth Dataset)"
FIELDS: dict[str, tuple[str, ...] | None] = {
    "range2": ("time", "distance", "variance", "x", "y", "anchor", "last"),
    "point2": ("time", "x", "y", "xx", "xy", "yx", "yy"),
    "odom2diff": None,
}
"""The fields behind each keyword; those of wheel odometry may be any number, a time first."""
FOLDER = ("Indoor_UWB_Input.txt", "Indoor_UWB_GT.txt")


@dataclass(frozen=True, slots=True)
class Params:
    """What the files leave open."""

    device: str = parameter("device", "", "name of the device on the robot")
    sigma: float | None = parameter(
        None, "m", "standard deviation of the ranges in place of the file's variances"
    )

    range_bias_std: float = parameter(
        0.1, "m", "standard deviation of the offset that all ranges share; 0: they are calibrated"
    )

    def __post_init__(self) -> None:
        require(self.range_bias_std >= 0, "range_bias_std", "at least 0", self.range_bias_std)
        require(bool(NAME.fullmatch(self.device)), "device", "a plain name", self.device)
        require(self.sigma is None or self.sigma > 0, "sigma", "positive", self.sigma)


def read(paths: Sequence[Path], params: Params) -> Recording:
    """The recording in a file of ranges, with or without a file of points, or in their folder.

    Raises
    ------
    FormatError : a file is unreadable or has no range, or a line breaks the format or the physics
    """
    files = [read_text(path) for path in _files(paths)]
    ranges, points, _ = (_table(keyword, files) for keyword in FIELDS)
    if not len(ranges):
        raise FormatError(files[0].path, "range2", "there are no ranges")
    stream, sensors = _ranges(ranges, params)
    provenance = {
        "importer": "labyrinth",
        "files": [file.provenance for file in files],
        "parameters": as_dict(params),
    }
    meta = Meta(ranges.places[0][0].stem, provenance=provenance)
    truth = _truth(points) if len(points) else None
    recording = Recording(meta, sensors, {"uwb": stream}, truth)
    check(recording, ranges.places[0][0])
    return recording


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file, from its first bytes, or a folder is one of libRSF's."""
    if path.is_dir():
        return any((path / name).exists() for name in FOLDER)
    return head.split()[:1] in ([word.encode()] for word in FIELDS)


def _files(paths: Sequence[Path]) -> list[Path]:
    if len(paths) == 1 and paths[0].is_dir():
        return [path for name in FOLDER if (path := paths[0] / name).exists()] or [
            paths[0] / FOLDER[0]
        ]
    return list(paths)


def _table(keyword: str, files: Sequence[TextFile]) -> Table:
    """The lines of one keyword; all their fields but those of names are numbers."""
    names = FIELDS[keyword]
    rows, places = [], []
    for file in files:
        for number, line in enumerate(file.lines(), 1):
            word, *rest = line.split() or [""]
            if word == keyword:
                if not rest or (names and len(rest) != len(names)):
                    needs = len(names) + 1 if names else "a time and more"
                    reason = f"{word} has {len(rest) + 1} fields, needs {needs}"
                    raise FormatError(file.path, f"line {number}", reason)
                rows.append(rest)
                places.append((file.path, number))
            elif word and word not in FIELDS:
                reason = f"{word[:40]!r} is not one of {' '.join(FIELDS)}"
                raise FormatError(file.path, f"line {number}", reason)
    if names is None:
        owners = [place for place, row in zip(places, rows, strict=True) for _ in row]
        Table({"field": [field for row in rows for field in row]}, owners).numbers("field")
    keys = names or ("time",)
    table = Table({key: [row[i] for row in rows] for i, key in enumerate(keys)}, places)
    for name in table.columns:
        if name == "time":
            table.nanoseconds(name)
        elif name != "anchor":
            table.numbers(name)
    return table


def _once(table: Table, time_ns: Array, key: Array, what: str) -> None:
    """Fail at the first line that repeats the (time, key) of another."""
    order = np.lexsort((key, time_ns))
    same = (np.diff(time_ns[order]) == 0) & (np.diff(key[order]) == 0)
    again = np.zeros(len(order), bool)
    again[order[1:][same]] = True
    table.none("time", again, f"a second {what} at the same time")


def _ranges(table: Table, params: Params) -> tuple[Stream, dict[str, Sensor]]:
    time = table.nanoseconds("time")
    distance, variance = table.numbers("distance"), table.numbers("variance")
    position = np.column_stack([table.numbers("x"), table.numbers("y")])
    table.none("distance", distance < 0, "the range is negative")
    table.none("variance", variance <= 0, "the variance is not positive")
    ids = table.columns["anchor"]
    anchors, first, index = np.unique(ids, return_index=True, return_inverse=True)
    for i in first.tolist():
        if not NAME.fullmatch(ids[i]) or ids[i] == params.device:
            table.fail("anchor", i, f"{ids[i][:40]!r} cannot name an anchor")
    table.none("x", (position != position[first][index]).any(axis=1), "the anchor has moved")
    _once(table, time, index, "range of this anchor")
    again = restart(time, index)
    if again is not None:
        table.fail("time", again, "the clock goes back and on again: are these two runs?")
    sensors = {params.device: Sensor.device(0)}
    sensors |= {
        str(a): Sensor.static("anchor", position[i]) for a, i in zip(anchors, first, strict=True)
    }
    std = np.sqrt(variance) if params.sigma is None else np.full(len(time), params.sigma)
    keys: dict[str, Array] = {
        "mode": np.full(len(time), ACTIVE, np.uint8),
        "rx": (index + 1).astype(np.int32),
        "tx": np.zeros(len(time), np.int32),
    }
    bias = params.range_bias_std
    model = {"mean_los": 1.0, "mean_scatter": 0.0, "range_bias_std": bias}
    rows = {"distance": distance, "std": std}
    return to_stream("uwb", tuple(sensors), model, time, keys, rows), sensors


def _truth(table: Table) -> Truth:
    time = table.nanoseconds("time")
    _once(table, time, np.zeros_like(time), "point")
    order = np.argsort(time, kind="stable")
    state = np.column_stack([table.numbers("x"), table.numbers("y")])[order]
    n = len(time)
    names, units = ("device_x", "device_y"), ("m", "m")
    label = np.zeros(n, np.int64)
    return Truth(Objects(time[order], np.arange(n + 1), label, names, units, state))

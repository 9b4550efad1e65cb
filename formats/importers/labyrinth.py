"""Importer of the text logs of libRSF: UWB two-way ranges of a robot, and its ground truth.

The Labyrinth Dataset, Tim Pfeifer, TU Chemnitz. Lines of fields separated by blanks::

    range2 time[s] range[m] variance[m2] anchor_x[m] anchor_y[m] anchor_id 0
    point2 time[s] x[m] y[m] covariance[m2] (4 values)

Ranges become active link events of one device, anchors sensors at rest, and points the truth:
``device_x device_y``, without an extent. The covariance of the points is not used, and lines of
wheel odometry (``odom2diff``) are skipped, as long as they are numbers. Lines in any order are
sorted stably by time. Two-way ranging tells one distance per event, which the stream's model says
as ``mean_los`` 1 and ``mean_scatter`` 0, and its distances share an offset as long as the delays of
the antennas are not calibrated: ``range_bias_std`` says how well it is known beforehand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from ...models.checks import NAME, check
from ...models.columns import ACTIVE
from ...models.errors import FormatError
from ...models.parameters import as_dict, parameter, require
from ...models.records import Array, Meta, Objects, Recording, Sensor, Stream, Truth
from .rows import assemble
from .text import TextFile, nanoseconds, numbers, read_text

SUMMARY = "UWB two-way ranges and ground truth in the text form of libRSF (The Labyrinth Dataset)"
FIELDS = {"range2": 8, "point2": 8, "odom2diff": None}
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
    ranges, points, odometry = (_Lines.of(keyword, files) for keyword in FIELDS)
    for lines in (points, odometry):
        lines.check_numbers()
        lines.time()
    if not ranges.fields:
        raise FormatError(files[0].path, "range2", "there are no ranges")
    stream, sensors = _ranges(ranges, params)
    provenance = {
        "importer": "labyrinth",
        "files": [file.provenance for file in files],
        "parameters": as_dict(params),
    }
    meta = Meta(ranges.places[0][0].stem, provenance=provenance)
    truth = _truth(points) if points.fields else None
    recording = Recording(meta, sensors, {"uwb": stream}, truth)
    check(recording, ranges.places[0][0])
    return recording


def _files(paths: Sequence[Path]) -> list[Path]:
    if len(paths) == 1 and paths[0].is_dir():
        return [path for name in FOLDER if (path := paths[0] / name).exists()] or [
            paths[0] / FOLDER[0]
        ]
    return list(paths)


@dataclass(frozen=True, slots=True)
class _Lines:
    """The lines of one keyword: their fields without it, and where they stand."""

    fields: list[list[str]]
    places: list[tuple[Path, int]]

    @staticmethod
    def of(keyword: str, files: Sequence[TextFile]) -> _Lines:
        fields, places = [], []
        for file in files:
            for number, line in enumerate(file.lines, 1):
                word, *rest = line.split() or [""]
                if word == keyword:
                    if len(rest) + 1 != (FIELDS[word] or max(len(rest) + 1, 2)):
                        needs = FIELDS[word] or "a time and more"
                        reason = f"{word} has {len(rest) + 1} fields, needs {needs}"
                        raise FormatError(file.path, f"line {number}", reason)
                    fields.append(rest)
                    places.append((file.path, number))
                elif word and word not in FIELDS:
                    reason = f"{word[:40]!r} is not one of {' '.join(FIELDS)}"
                    raise FormatError(file.path, f"line {number}", reason)
        return _Lines(fields, places)

    def fail(self, index: int, reason: str) -> NoReturn:
        path, number = self.places[index]
        raise FormatError(path, f"line {number}", reason)

    def none(self, bad: Array, reason: str) -> None:
        """Fail at the first true element of ``bad`` (m,)."""
        if bad.any():
            self.fail(int(bad.argmax()), reason)

    def check_numbers(self) -> None:
        """Fail at the first field that is no number, whether or not it is used."""
        owner = [i for i, fields in enumerate(self.fields) for _ in fields]
        text = [field for fields in self.fields for field in fields]
        numbers(text, lambda k, reason: self.fail(owner[k], reason))

    def column(self, index: int) -> list[str]:
        return [fields[index] for fields in self.fields]

    def time(self) -> Array:
        return nanoseconds(self.column(0), self.fail)

    def numbers(self, index: int) -> Array:
        return numbers(self.column(index), self.fail)

    def once(self, time_ns: Array, key: Array, what: str) -> None:
        """Fail at the first line that repeats the (time, key) of another."""
        order = np.lexsort((key, time_ns))
        same = (np.diff(time_ns[order]) == 0) & (np.diff(key[order]) == 0)
        again = np.zeros(len(order), bool)
        again[order[1:][same]] = True
        self.none(again, f"a second {what} at the same time")


def _ranges(lines: _Lines, params: Params) -> tuple[Stream, dict[str, Sensor]]:
    time, distance, variance = lines.time(), lines.numbers(1), lines.numbers(2)
    position = np.column_stack([lines.numbers(3), lines.numbers(4)])
    lines.none(distance < 0, "the range is negative")
    lines.none(variance <= 0, "the variance is not positive")
    lines.numbers(6)
    ids = lines.column(5)
    anchors, first, index = np.unique(ids, return_index=True, return_inverse=True)
    for i in first.tolist():
        if not NAME.fullmatch(ids[i]) or ids[i] == params.device:
            lines.fail(i, f"{ids[i][:40]!r} cannot name an anchor")
    lines.none((position != position[first][index]).any(axis=1), "the anchor has moved")
    lines.once(time, index, "range of this anchor")
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
    return assemble("uwb", tuple(sensors), model, time, keys, rows), sensors


def _truth(lines: _Lines) -> Truth:
    time = lines.time()
    lines.once(time, np.zeros_like(time), "point")
    order = np.argsort(time, kind="stable")
    state = np.column_stack([lines.numbers(1), lines.numbers(2)])[order]
    n = len(time)
    names, units = ("device_x", "device_y"), ("m", "m")
    label = np.zeros(n, np.int64)
    return Truth(Objects(time[order], np.arange(n + 1), label, names, units, state))

"""Importer of the text logs of libRSF: UWB two-way ranges of a robot, and its ground truth.

The Labyrinth Dataset, Tim Pfeifer, TU Chemnitz. Lines of fields separated by blanks::

    range2 time[s] range[m] variance[m2] anchor_x[m] anchor_y[m] anchor_id (and perhaps 0)
    odom2diff time[s] left[m/s] right[m/s] sideways[m/s] wheel_to_centre[m] variances (3)
    odom2 time[s] forward[m/s] sideways[m/s] turn_rate[rad/s] variances (3)
    angle time[s] heading[rad] variance[rad2]
    point2 time[s] x[m] y[m] covariance[m2] (4 values)

Ranges become active link events of one device, anchors sensors at rest, velocities and headings a
stream of odometry, and points the truth: ``device_x device_y``, without an extent. libRSF turns a
body after it has moved, which the stream says as ``turn`` after. The covariance of the points is
not used. Ranges below zero are left out, counted and said. Lines that are late are sorted stably by
time; a clock that begins anew is refused. Two-way ranging tells one distance per
event, which the stream's model says as ``mean_los`` 1 and ``mean_scatter`` 0, and its distances
share an offset as long as the delays of the antennas are not calibrated: ``range_bias_std`` says
how well it is known beforehand.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...models.checks import NAME, check
from ...models.columns import ACTIVE
from ...models.errors import FormatError
from ...models.parameters import as_dict, parameter, require
from ...models.records import Array, Meta, Objects, Recording, Sensor, Stream, Truth
from .rows import restart, to_stream
from .text import Table, TextFile, read_text

_log = logging.getLogger(__name__)
SUMMARY = "UWB ranges, odometry and ground truth in the text form of libRSF (The Labyrinth Dataset)"
FIELDS: dict[str, tuple[str, ...]] = {
    "range2": ("time", "distance", "variance", "x", "y", "anchor", "last"),
    "point2": ("time", "x", "y", "xx", "xy", "yx", "yy"),
    "odom2diff": ("time", "left", "right", "y", "arm", "var_left", "var_right", "var_y"),
    "odom2": ("time", "x", "y", "turn", "var_x", "var_y", "var_turn"),
    "angle": ("time", "heading", "variance"),
}
"""The fields behind each keyword; ``last`` may be absent."""


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
    ranges, points, wheels, velocities, angles = (_table(word, files) for word in FIELDS)
    if not len(ranges):
        raise FormatError(files[0].path, "range2", "there are no ranges")
    stream, sensors, negative = _ranges(ranges, params)
    streams = {"uwb": stream}
    moved = _odometry(wheels, velocities, angles, params)
    if moved is not None:
        streams["odometry"] = moved
    provenance: dict[str, Any] = {
        "importer": "labyrinth",
        "files": [file.provenance for file in files],
        "parameters": as_dict(params),
    }
    if negative:
        provenance["left_out"] = {"range2": {"range < 0": negative}}
    meta = Meta(ranges.places[0][0].stem, provenance=provenance)
    truth = _truth(points) if len(points) else None
    recording = Recording(meta, sensors, streams, truth)
    check(recording, ranges.places[0][0])
    return recording


def recognises(path: Path, head: bytes) -> bool:
    """Whether a file, from its first bytes, or a folder is one of libRSF's."""
    if path.is_dir():
        return bool(_inside(path))
    return head.split()[:1] in ([word.encode()] for word in FIELDS)


def _inside(folder: Path) -> list[Path]:
    """The files of a folder that begin as libRSF's do."""
    found = []
    for path in sorted(folder.glob("*.txt")):
        with path.open("rb") as file:
            if recognises(path, file.read(64)):
                found.append(path)
    return found


def _files(paths: Sequence[Path]) -> list[Path]:
    """The files, or those in the only folder."""
    if len(paths) != 1 or not paths[0].is_dir():
        return list(paths)
    found = _inside(paths[0])
    if not found:
        raise FormatError(paths[0], "", "no file (*.txt) in it begins as those of libRSF do")
    return found


def _table(keyword: str, files: Sequence[TextFile]) -> Table:
    """The lines of one keyword; all their fields but those of names are numbers."""
    names = FIELDS[keyword]
    least = len(names) - (names[-1] == "last")
    rows, places = [], []
    for file in files:
        for number, line in enumerate(file.lines(), 1):
            word, *rest = line.split() or [""]
            if word == keyword:
                if not least <= len(rest) <= len(names):
                    reason = f"{word} has {len(rest) + 1} fields, needs {len(names) + 1}"
                    raise FormatError(file.path, f"line {number}", reason)
                rows.append([*rest, "0"][: len(names)])
                places.append((file.path, number))
            elif word and word not in FIELDS:
                reason = f"{word[:40]!r} is not one of {' '.join(FIELDS)}"
                raise FormatError(file.path, f"line {number}", reason)
    table = Table({key: [row[i] for row in rows] for i, key in enumerate(names)}, places)
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


def _ranges(table: Table, params: Params) -> tuple[Stream, dict[str, Sensor], int]:
    """The stream, its nodes, and how many ranges were below zero and left out."""
    time = table.nanoseconds("time")
    distance, variance = table.numbers("distance"), table.numbers("variance")
    position = np.column_stack([table.numbers("x"), table.numbers("y")])
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
    kept = distance >= 0
    negative = int((~kept).sum())
    if negative:
        path = table.places[0][0]
        _log.warning("%s: %d of %d ranges are below zero: left out", path, negative, len(time))
    rows, keys = ({k: v[kept] for k, v in group.items()} for group in (rows, keys))
    stream = to_stream("uwb", tuple(sensors), model, time[kept], keys, rows)
    return stream, sensors, negative


def _odometry(wheels: Table, velocities: Table, angles: Table, params: Params) -> Stream | None:
    """Velocities and headings as one stream, or None."""
    parts = [part for part in (_of_wheels(wheels), _of_body(velocities)) if len(part["time"])]
    if len(parts) > 1:
        velocities.fail("time", 0, "there are wheels already (odom2diff): keep one of both")
    told = parts[0] if parts else {}
    absolute = {
        "time": angles.nanoseconds("time"),
        "heading": angles.numbers("heading"),
        "std_heading": np.sqrt(angles.numbers("variance").clip(0)),
    }
    _once(angles, absolute["time"], np.zeros(len(angles)), "angle")
    groups = [group for group in (told, absolute) if len(group.get("time", ()))]
    if not groups:
        return None
    time = np.unique(np.concatenate([group["time"] for group in groups]))
    scan = {}
    for group in groups:
        at = np.searchsorted(time, group.pop("time"))
        for name, values in group.items():
            scan[name] = np.full(len(time), np.nan)
            scan[name][at] = values
    offset = np.zeros(len(time) + 1, np.int64)
    return Stream("odometry", (params.device,), {"turn": "after"}, time, offset, scan, {})


def _of_wheels(table: Table) -> dict[str, Array]:
    """Velocity and turn rate of a body on two wheels."""
    time = table.nanoseconds("time")
    _once(table, time, np.zeros(len(time)), "odometry")
    left, right, arm = (table.numbers(key) for key in ("left", "right", "arm"))
    table.none("arm", arm <= 0, "the distance of a wheel from the centre is not positive")
    variance = table.numbers("var_left") + table.numbers("var_right")
    table.none("var_left", variance < 0, "the variance is negative")
    return {
        "time": time,
        "velocity_x": (right + left) / 2,
        "velocity_y": table.numbers("y"),
        "turn_rate": (right - left) / (2 * arm),
        "std_velocity_x": np.sqrt(variance) / 2,
        "std_velocity_y": np.sqrt(table.numbers("var_y").clip(0)),
        "std_turn_rate": np.sqrt(variance) / (2 * arm),
    }


def _of_body(table: Table) -> dict[str, Array]:
    """Velocity and turn rate as they stand."""
    time = table.nanoseconds("time")
    _once(table, time, np.zeros(len(time)), "odometry")
    names = {"x": "velocity_x", "y": "velocity_y", "turn": "turn_rate"}
    found = {"time": time}
    for key, name in names.items():
        variance = table.numbers(f"var_{key}")
        table.none(f"var_{key}", variance < 0, "the variance is negative")
        found[name], found[f"std_{name}"] = table.numbers(key), np.sqrt(variance)
    return found


def _truth(table: Table) -> Truth:
    time = table.nanoseconds("time")
    _once(table, time, np.zeros_like(time), "point")
    order = np.argsort(time, kind="stable")
    state = np.column_stack([table.numbers("x"), table.numbers("y")])[order]
    n = len(time)
    names, units = ("device_x", "device_y"), ("m", "m")
    label = np.zeros(n, np.int64)
    return Truth(Objects(time[order], np.arange(n + 1), label, names, units, state))

"""The truth of a recording from a table of its own, on a clock and in a frame of its own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ....models.errors import ParameterError
from ....models.parameters import require, resolve
from ....models.records import Array, Objects, Truth
from . import plausible
from .align import MODES
from .log import Log, loose
from .mapping import Tables
from .poses import QUATERNION, quaternions
from .reading import Reading
from .units import quantity, turn

STATE = {"x": "m", "y": "m", "z": "m", "vx": "m s-1", "vy": "m s-1", "vz": "m s-1"}
STATE |= {"device_x": "m", "device_y": "m"}
REPEATS = ("error", "first", "last")


@dataclass(frozen=True, slots=True)
class TruthReading(Reading):
    """A table of true objects: beside what all tables have, what leads to our clock and frame."""

    labels: Any = field(default_factory=dict)
    repeats: str = "error"
    align: str = ""
    clock: Any = field(default_factory=dict)
    transform: Any = field(default_factory=dict)
    device: Any = None

    def __post_init__(self) -> None:
        Reading.__post_init__(self)
        require(self.repeats in REPEATS, "repeats", f"one of {' '.join(REPEATS)}", self.repeats)
        require(self.align in MODES, "align", "rigid, time or both", self.align)
        ok = isinstance(self.labels, Mapping) and all(
            isinstance(v, int) and not isinstance(v, bool) and v >= 0 for v in self.labels.values()
        )
        ok = ok and len(set(self.labels.values())) == len(self.labels)
        require(ok, "labels", "a mapping of names to different whole numbers", self.labels)
        ok = self.device is None or (isinstance(self.device, list | tuple))
        ok = ok and (self.device is None or len(self.device) in (2, 3))
        require(ok, "device", "[x, y] or [x, y, z] on the body", self.device)
        for key in ("clock", "transform"):
            value = getattr(self, key)
            require(isinstance(value, Mapping), key, "a mapping", value)


@dataclass(frozen=True, slots=True)
class Clock:
    """Our time is ``scale`` times that of the table, plus ``offset``."""

    offset: Any = 0.0
    scale: float = 1.0

    def to_ours(self, time: Array) -> Array:
        """Times [ns] on our clock."""
        require(self.scale > 0, "truth.clock.scale", "positive", self.scale)
        offset = round(quantity(self.offset, "time", "truth.clock.offset") * 1e9)
        scaled = time if self.scale == 1.0 else np.rint(time * self.scale).astype(np.int64)
        return np.asarray(scaled + offset)


@dataclass(frozen=True, slots=True)
class Transform:
    """Our position is that of the table, scaled, turned from its x to its y axis, and shifted."""

    rotation: Any = 0.0
    translation: Any = (0.0, 0.0)
    scale: float = 1.0

    def to_ours(self, columns: dict[str, Array]) -> None:
        """Change positions and velocities, in place."""
        where = "truth.transform"
        require(self.scale > 0, f"{where}.scale", "positive", self.scale)
        ok = isinstance(self.translation, list | tuple) and len(self.translation) in (2, 3)
        require(ok, f"{where}.translation", "[x, y] or [x, y, z]", self.translation)
        angle = quantity(self.rotation, "yaw", f"{where}.rotation")
        shift = [quantity(v, "x", f"{where}.translation") for v in self.translation]
        c, s = self.scale * np.cos(angle), self.scale * np.sin(angle)
        for x, y, moved in (("x", "y", 1), ("device_x", "device_y", 1), ("vx", "vy", 0)):
            if x in columns:
                a, b = columns[x], columns[y]
                columns[x] = c * a - s * b + moved * shift[0]
                columns[y] = s * a + c * b + moved * shift[1]
        if "heading" in columns:
            columns["heading"] = columns["heading"] + angle
        for z, moved in (("z", 1), ("vz", 0)):
            if z in columns:
                columns[z] = self.scale * columns[z] + moved * (*shift, 0.0)[2]


def read(spec: object, F: Array, tables: Tables) -> Truth:
    """The true objects that the part ``truth`` of a mapping describes.

    A row whose state is empty is no object: its time is known, and without it.
    """
    reading = tables.reading(spec, TruthReading, "truth")
    table = tables.log(reading, ("time",), (*STATE, "label", "yaw", *QUATERNION), "truth")
    names = [name for name in STATE if name in table]
    for x, y in (("x", "y"), ("vx", "vy"), ("device_x", "device_y")):
        if (x in names) != (y in names):
            raise ParameterError(f"truth: columns need both {x} and {y}, or neither")
    if not names:
        raise ParameterError(f"truth: columns need some of {' '.join(STATE)}")
    columns, there = table.detections(names, ())
    if reading.device is not None:
        names += [n for n in _mounted(table, reading, columns) if n not in names]
    if "x" in columns and (heading := _heading(table)) is not None:
        names.append("heading")
        columns["heading"] = heading
    if reading.transform:
        resolve(Transform, ("truth.transform", reading.transform)).to_ours(columns)
    for x, y in (("x", "y"), ("vx", "vy"), ("device_x", "device_y")):
        if x in columns:
            columns[x], columns[y] = turn(F, columns[x], columns[y])
    if "heading" in columns:
        c, s = np.cos(columns["heading"]), np.sin(columns["heading"])
        c, s = turn(F, c, s)
        columns["heading"] = np.arctan2(s, c)
    for z in ("z", "vz"):
        if z in columns:
            columns[z] = F[2, 2] * columns[z]
    time = table.time()
    if reading.clock:
        time = resolve(Clock, ("truth.clock", reading.clock)).to_ours(time)
    label = _labels(table, reading, there)
    plausible.rows(table, time)
    for x, y in (("x", "y"), ("device_x", "device_y")):
        if x in columns:
            place = np.column_stack([columns[x], columns[y]])
            plausible.path(table, time, label, place)
    kept = _kept(table, reading, time, label, there)
    order = kept[np.lexsort((label[kept], time[kept]))]
    times = np.unique(time)
    offset = np.append(np.searchsorted(time[order], times), len(order)).astype(np.int64)
    state = np.column_stack([columns[name] for name in names])[order]
    units = tuple((STATE | {"heading": "rad"})[name] for name in names)
    return Truth(Objects(times, offset, label[order], tuple(names), units, state))


def _heading(table: Log) -> Array | None:
    """The heading of the body (m,) [rad], from yaw or quaternion, if the table tells it."""
    q = quaternions(table)
    if q is not None:
        x, y, z, w = q.T
        return np.asarray(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
    return table.values("yaw") if "yaw" in table else None


def _mounted(table: Log, reading: TruthReading, columns: dict[str, Array]) -> tuple[str, str]:
    """Add to ``columns`` where the device on the body is, by the heading of the body."""
    if "x" not in columns or "device_x" in columns:
        raise ParameterError("truth: device needs x and y of the body, not device_x and device_y")
    at = [quantity(v, "x", "truth.device") for v in reading.device]
    q = quaternions(table)
    if q is None and "yaw" not in table:
        raise ParameterError("truth: device needs the heading of the body, yaw or qx qy qz qw")
    if q is None:
        yaw = table.values("yaw")
        R = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        off = np.einsum("ijm,j->mi", R, np.array(at[:2]))
    else:
        from scipy.spatial.transform import Rotation

        off = Rotation.from_quat(q).apply(np.array([*at, 0.0][:3]))
    columns["device_x"], columns["device_y"] = columns["x"] + off[:, 0], columns["y"] + off[:, 1]
    return "device_x", "device_y"


def _labels(table: Log, reading: TruthReading, there: Array) -> Array:
    """The label of each row (m,), int64: a whole number, or a name of the table ``labels``."""
    if "label" not in table:
        return np.zeros(len(table), np.int64)
    text = table.columns["label"]
    hint = "is no whole number: give names their numbers, labels: {NAME: 1, ..}"
    if reading.labels:
        known = {str(name): str(label) for name, label in reading.labels.items()}
        text, hint = [known.get(f, "") for f in text], "is not one of those in labels"
    number = loose(text, reading)
    whole = (np.abs(number) <= 2**53) & (number == np.rint(number))
    table.refuse("label", there & ~whole, hint)
    return np.where(whole, number, 0).astype(np.int64)


def _kept(table: Log, reading: TruthReading, time: Array, label: Array, there: Array) -> Array:
    """Rows that are objects; of those of one object at one time, the one that is wanted."""
    rows = np.flatnonzero(there)
    if reading.repeats == "last":
        rows = rows[::-1]
    order = rows[np.lexsort((np.arange(len(rows)), time[rows], label[rows]))]
    again = np.zeros(len(table), bool)
    same = (np.diff(time[order]) == 0) & (np.diff(label[order]) == 0)
    again[order[1:][same]] = True
    if reading.repeats == "error":
        hint = "is the time of another row of this object: to keep one of them, repeats: first"
        table.refuse("time", again, hint)
    return np.sort(rows[~again[rows]])

"""Messages of radars as columns: point clouds, scans of returns, single ranges."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ....models.errors import FormatError, ParameterError
from ....models.records import Array
from ..csv.units import to_si

NAMES = {
    "x": ("x",),
    "y": ("y",),
    "z": ("z",),
    "doppler": (
        "doppler", "doppler_velocity", "velocity", "radial_velocity", "radial_speed", "vel",
        "v_r", "vr", "v", "speed",
    ),
    "power": (),
    "rcs": (),
}  # fmt: skip
"""What drivers call the fields of points, without regard to case; powers have no usual unit."""
KINDS = {
    "sensor_msgs/PointCloud2": "position",
    "radar_msgs/RadarScan": "range_bearing",
    "sensor_msgs/Range": "range_bearing",
}
"""The types that become streams, and their kinds."""
_TYPES = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 8: "f8"}
Rows = tuple[dict[str, Array], int]
_BOUND = 1 << 26
"""Points of one message."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """The field of points that a column is taken from, its unit and what multiplies it."""

    field: str = ""
    unit: str = ""
    scale: float = 1.0


def columns(
    kind: str, message: Any, wanted: Mapping[str, Wanted], path: object
) -> tuple[dict[str, Array], int]:
    """The rows of a message of the type ``kind`` in SI, and how many points were no numbers.

    ``wanted`` tells the field of a column where it is not called as drivers do, and its unit.
    """
    if kind == "sensor_msgs/PointCloud2":
        return _cloud(message, wanted, path)
    if kind == "radar_msgs/RadarScan":
        fields = ("range", "azimuth", "elevation", "doppler_velocity", "amplitude")
        rows = np.array([[getattr(r, f) for f in fields] for r in message.returns], float)
        rows = rows.reshape(-1, len(fields))
        # Amplitudes are in dB; elevation is 0 where a radar has none.
        made = {"range": rows[:, 0], "azimuth": rows[:, 1], "elevation": rows[:, 2]}
        made |= {"doppler": rows[:, 3], "power": 10 ** (rows[:, 4] / 10)}
        return _finite(made)
    distance, width = float(message.range), float(message.field_of_view)
    inside = math.isfinite(distance) and message.min_range <= distance <= message.max_range
    n = int(inside)
    made = {"range": np.full(n, distance), "azimuth": np.zeros(n)}
    return {**made, "std_azimuth": np.full(n, width / math.sqrt(12))}, 0


def _cloud(message: Any, wanted: Mapping[str, Wanted], path: object) -> Rows:
    fields = tuple((f.name, f.offset, f.datatype, f.count) for f in message.fields)
    step, big = int(message.point_step), bool(message.is_bigendian)
    kind = _layout(fields, tuple(wanted.items()), step, big, str(path))
    count, row, height = int(message.width) * int(message.height), message.row_step, message.height
    data = np.asarray(message.data, np.uint8)
    if count > _BOUND or (count and (row < step * int(message.width) or len(data) < row * height)):
        raise FormatError(path, "", f"a cloud of {count} points holds {len(data)} bytes")
    if height > 1 and row != step * int(message.width):
        data = data[: row * height].reshape(height, row)[:, : step * int(message.width)]
    points = np.frombuffer(np.ascontiguousarray(data), kind, count)
    rows = {}
    for name in kind.names or ():
        own = wanted.get(name)
        values = points[name].astype(np.float64)
        rows[name] = values if own is None else to_si(values, own.unit, name) * own.scale
    return _finite(rows)


@lru_cache(64)
def _layout(
    fields: tuple[tuple[str, int, int, int], ...],
    wanted: tuple[tuple[str, Wanted], ...],
    step: int,
    big: bool,
    path: str,
) -> np.dtype[Any]:
    """Where the columns of points stand in ``step`` bytes, from name, offset, type and count."""
    known = {name: (offset, datatype, count) for name, offset, datatype, count in fields}
    names = found(list(known), dict(wanted), path)
    for key in ("x", "y"):
        if key not in names:
            raise FormatError(path, "", f"points have no field {key}: there are {_listed(known)}")
    for name in names.values():
        offset, datatype, count = known[name]
        size = int(_TYPES.get(datatype, "f0")[1:])
        if not size or count not in (0, 1) or offset + size > step:
            raise FormatError(path, "", f"field {name} of points is no number in them")
    order = ">" if big else "<"
    return np.dtype(
        {
            "names": list(names),
            "formats": [order + _TYPES[known[name][1]] for name in names.values()],
            "offsets": [known[name][0] for name in names.values()],
            "itemsize": step,
        }
    )


def _listed(fields: Mapping[str, object]) -> str:
    return " ".join(fields) or "none"


def found(fields: list[str], wanted: Mapping[str, Wanted], path: object) -> dict[str, str]:
    """The field of each column: the one that is told, or else one that is called as usual."""
    lower = {name.lower(): name for name in reversed(fields)}
    names = {}
    for column, usual in NAMES.items():
        if column in wanted:
            if wanted[column].field not in fields:
                reason = f"{wanted[column].field!r} is no field of the points: {' '.join(fields)}"
                raise ParameterError(f"columns.{column}: {reason}")
            names[column] = wanted[column].field
            continue
        name = next((lower[n] for n in usual if n in lower), None)
        if name is not None:
            names[column] = name
    return names


def _finite(rows: dict[str, Array]) -> tuple[dict[str, Array], int]:
    """The rows whose numbers are all finite, and how many are left out."""
    ok = np.logical_and.reduce([np.isfinite(values) for values in rows.values()])
    if ok.all():
        return rows, 0
    return {name: values[ok] for name, values in rows.items()}, int((~ok).sum())

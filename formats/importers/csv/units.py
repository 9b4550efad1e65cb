"""Units and axes of foreign logs, turned into SI and into the frames of a recording."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ....models.columns import COLUMNS
from ....models.errors import ParameterError
from ....models.parameters import require, suggestion
from ....models.records import Array

NAMES = ("anchor", "device", "tx", "rx", "reference", "sensor", "scan", "id", "label")
"""The quantities that are names: they have no unit."""
_LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0}
_LENGTHS |= {"ft": 0.3048, "in": 0.0254, "nmi": 1852.0}
_FACTORS: dict[str, dict[str, float]] = {
    "m": _LENGTHS,
    "rad": {"rad": 1.0, "deg": math.pi / 180},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "deg": {"deg": 1.0, "rad": 180 / math.pi},
    "m s-1": {"m/s": 1.0, "km/h": 1 / 3.6, "ft/s": 0.3048, "kn": 1852 / 3600},
    "rad s-1": {"rad/s": 1.0, "deg/s": math.pi / 180},
    "1": {"1": 1.0},
}
_AXES = {
    "east": (0, 1),
    "forward": (0, 1),
    "west": (0, -1),
    "back": (0, -1),
    "north": (1, 1),
    "left": (1, 1),
    "south": (1, -1),
    "right": (1, -1),
    "up": (2, 1),
    "down": (2, -1),
}
"""Directions: the axis of a recording's frames that they lie on, and their sign there."""
_STATE = {"yaw": "rad", "vx": "m s-1", "vy": "m s-1", "vz": "m s-1"}
_STATE |= {"left": "m s-1", "right": "m s-1"}
_STATE |= {"device_x": "m", "device_y": "m", "time": "s", "height": "m"}
_STATE |= dict.fromkeys(("lat", "lon", "device_lat", "device_lon"), "deg")


def si_unit(column: str) -> str:
    """The CF unit of a column of detections, poses or truth."""
    return COLUMNS[column].unit if column in COLUMNS else _STATE.get(column, "1")


def check_unit(unit: str, column: str, where: str) -> None:
    """Raise ParameterError unless ``column`` can be in ``unit``; empty is SI."""
    known = [*_FACTORS[si_unit(column)], *(["dB"] if column in ("power", "amplitude") else [])]
    if unit and unit not in known:
        hint = suggestion(unit, known)
        raise ParameterError(f"{where}: unit {unit!r} is not one of {' '.join(known)}{hint}")


def to_si(values: Array, unit: str, column: str) -> Array:
    """``values`` of ``column`` in ``unit`` (empty: SI already) in SI.

    Decibels become a linear power, or an amplitude where the column is called so.
    """
    if not unit:
        return values
    if unit == "dB":
        return np.asarray(10.0 ** (values / (20.0 if column == "amplitude" else 10.0)))
    return np.asarray(values * _FACTORS[si_unit(column)][unit])


def split_unit(value: Any, column: str, where: str) -> tuple[str, str]:
    """The number, as text, and the unit (or nothing) of a value such as ``0.5`` or ``30 deg``."""
    number, _, unit = str(value).strip().partition(" ")
    try:
        found = math.nan if isinstance(value, bool) or "_" in number else float(number)
    except ValueError:
        found = math.nan
    require(math.isfinite(found), where, "a number, with or without a unit", value)
    check_unit(unit.strip(), column, where)
    return number, unit.strip()


def quantity(value: Any, column: str, where: str) -> float:
    """A number in SI, or the text of a number and a unit such as ``30 deg``."""
    number, unit = split_unit(value, column, where)
    return float(to_si(np.asarray(float(number)), unit, column))


def axes(words: Sequence[str], where: str) -> Array:
    """The matrix (3, 3) from axes along the directions ``words`` to those of a recording."""
    for word in words:
        hint = suggestion(word, _AXES)
        require(word in _AXES, where, f"made of {' '.join(_AXES)}{hint}", word)
    found = [_AXES[word] for word in words]
    horizontal = len(words) in (2, 3) and {axis for axis, _ in found[:2]} == {0, 1}
    vertical = all(axis == 2 for axis, _ in found[2:])
    rule = "two horizontal directions, then perhaps up or down"
    require(horizontal and vertical, where, rule, list(words))
    F = np.eye(3)
    F[:2, :2] = 0.0
    for column, (axis, sign) in enumerate(found):
        F[axis, column] = sign
    return F


def turn(F: Array, x: Array, y: Array) -> tuple[Array, Array]:
    """Horizontal coordinates in the frame that ``F`` leads to, without rounding."""
    (a, b), (c, d) = F[:2, :2]
    return (a * x if a else b * y), (d * y if d else c * x)

"""Tables of velocity and turn rate, of a body or of its two wheels, as a stream of odometry."""

from __future__ import annotations

import numpy as np

from ....models.errors import ParameterError
from ....models.parameters import require
from ....models.records import Array, Sensor, Stream
from .log import Log
from .mapping import ODOMETRY, Mapping, Tables
from .units import quantity

Built = tuple[dict[str, Sensor], dict[str, Stream]]
WHEELS = ("left", "right")


def odometry(
    mapping: Mapping, table: Log, F: Array, tables: Tables, carried: bool, name: str
) -> Built:
    """The stream ``name``, of the only one of ``devices``, or of one called ``device``.

    Raises
    ------
    ParameterError : the columns tell no motion, or wheels without their distance
    """
    devices = list(mapping.devices) or ["device"]
    require(len(devices) == 1, "devices", "one, whose body moves", devices)
    scan = {
        key: table.values(key, missing=True)
        for key in ODOMETRY
        if key in table and key not in WHEELS
    }
    if any(key in table for key in WHEELS):
        scan |= _of_wheels(table, mapping, scan)
    told = {"velocity_x", "turn_rate"} <= scan.keys() or "heading" in scan
    if not told:
        raise ParameterError(
            f"{table.path.name}: columns need velocity_x and turn_rate, left and right, or heading"
        )
    if "velocity_x" in scan:
        scan.setdefault("velocity_y", np.where(np.isnan(scan["velocity_x"]), np.nan, 0.0))
    time = table.time()
    order = np.argsort(time, kind="stable")
    same = np.zeros(len(time), bool)
    same[order[1:]] = np.diff(time[order]) == 0
    table.refuse("time", same, "is the time of a second event")
    scan = {key: values[order] for key, values in scan.items()}
    offset = np.zeros(len(time) + 1, np.int64)
    stream = Stream("odometry", (devices[0],), mapping.model, time[order], offset, scan, {})
    return {}, {name: stream}


def _of_wheels(table: Log, mapping: Mapping, scan: dict[str, Array]) -> dict[str, Array]:
    """Velocity and turn rate of a body on two wheels."""
    if not all(key in table for key in WHEELS) or {"velocity_x", "turn_rate"} & scan.keys():
        raise ParameterError("mapping: wheels are left and right, without velocity_x or turn_rate")
    if mapping.wheel_distance is None:
        raise ParameterError("mapping: left and right need wheel_distance, from wheel to wheel")
    width = quantity(mapping.wheel_distance, "x", "wheel_distance")
    require(width > 0, "wheel_distance", "positive", mapping.wheel_distance)
    left, right = (table.values(key, missing=True) for key in WHEELS)
    return {"velocity_x": (left + right) / 2, "turn_rate": (right - left) / width}

"""Tables of radar points as the scans of streams."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....models.errors import ParameterError
from ....models.records import Array, Sensor, Stream
from ..rows import pad, to_stream
from . import plausible
from .log import Log
from .mapping import MEASUREMENT, VIEW, Mapping, Tables
from .poses import sensor
from .units import axes, turn

Built = tuple[dict[str, Sensor], dict[str, Stream]]


_OTHERS = 8
"""Other scans between two of one id, from which on these are two."""


def radar(
    mapping: Mapping, table: Log, F: Array, tables: Tables, carried: bool, name: str
) -> Built:
    """The radars and their streams of the points in ``table``; a stream is called as its radar."""
    S = axes(mapping.sensor_frame, "sensor_frame", any_order=True) if mapping.sensor_frame else F
    sensors = {
        str(name): sensor(pose, "radar", F, S, tables, f"sensors.{name}")
        for name, pose in mapping.sensors.items()
    }
    moved = any(p.position.any() or p.quaternion[:, :3].any() for p in sensors.values())
    if "lat" in table and (moved or mapping.sensor_frame):
        reason = "detections at lat lon are places: sensors stand at [0, 0], without sensor_frame"
        raise ParameterError(f"mapping: {reason}")
    names = tuple(sensors)
    parts = [table]
    views = tuple(key for key in VIEW if key in table)
    if mapping.scans is not None:
        if "scan" in table:
            raise ParameterError("mapping: give either scans or the column 'scan'")
        parts.append(tables.read(mapping.scans, ("time", *views), ("sensor",), "scans"))
    for part in parts:
        if len(names) > 1 and "sensor" not in part:
            raise ParameterError("mapping: several sensors need the column 'sensor'")
    which = np.concatenate(
        [p.index("sensor", names) if "sensor" in p else np.zeros(len(p), np.int32) for p in parts]
    )
    time = np.concatenate([part.time() for part in parts])
    table.check_shared(time[: len(table)])
    plausible.rows(table, time[: len(table)])
    plausible.scans(table, time, which, mapping.model)
    main = [key for key in (*MEASUREMENT[mapping.kind], "z") if key in table]
    others = [key for key in table.fields if key not in (*main, *views, "time", "scan", "sensor")]
    rows, detected = pad(*table.detections(main, others), len(time) - len(table))
    _to_sensor_frame(rows, S)
    keys = {key: np.concatenate([part.values(key) for part in parts]) for key in views}
    _view(keys, S)
    if "scan" in table:
        keys["scan"] = _scan(table, which, time)
        start = np.full(keys["scan"].max(initial=-1) + 1, np.iinfo(np.int64).max)
        np.minimum.at(start, keys["scan"], time)
        time, late = start[keys["scan"]], time - start[keys["scan"]]
        if late.any() and "time_offset" not in rows:
            rows["time_offset"] = late * 1e-9
    streams = {}
    for i, name in enumerate(names):
        own = which == i
        key, row = ({k: v[own] for k, v in columns.items()} for columns in (keys, rows))
        stream = to_stream(mapping.kind, (name,), mapping.model, time[own], key, row, detected[own])
        streams[name] = replace(stream, scan={key: stream.scan[key] for key in views})
    return sensors, streams


def _view(views: dict[str, Array], S: Array) -> None:
    """Turn the azimuths of fields of view along the axes ``S`` into the sensor frame, in place."""
    names = ("view_azimuth_min", "view_azimuth_max")
    if not any(name in views for name in names):
        return
    if S[2, :2].any() or not all(name in views for name in names):
        raise ParameterError("columns: a view needs both azimuths, and two level directions")
    sense = S[0, 0] * S[1, 1] - S[0, 1] * S[1, 0]
    ends = [np.arctan2(S[1, 0], S[0, 0]) + sense * views[name] for name in names]
    views[names[0]], views[names[1]] = ends if sense > 0 else ends[::-1]


def _to_sensor_frame(rows: dict[str, Array], S: Array) -> None:
    """Turn measurements along the axes ``S`` of the log into the sensor frame, in place."""
    if S[2, :2].any():
        if "azimuth" in rows:
            raise ParameterError(
                "sensor_frame: azimuths need two level directions, then up or down"
            )
        if "z" not in rows:
            raise ParameterError("sensor_frame: this order of directions needs x, y and z")
        moved = [sum(S[k, j] * rows["xyz"[j]] for j in range(3) if S[k, j]) for k in range(3)]
        rows["x"], rows["y"], rows["z"] = moved
        return
    if "x" in rows:
        rows["x"], rows["y"] = turn(S, rows["x"], rows["y"])
    if "azimuth" in rows:
        sense = S[0, 0] * S[1, 1] - S[0, 1] * S[1, 0]
        angle = np.arctan2(S[1, 0], S[0, 0]) + sense * rows["azimuth"]
        wrapped = np.remainder(angle + np.pi, 2 * np.pi) - np.pi
        rows["azimuth"] = np.where(np.abs(angle) > np.pi, wrapped, angle)
    for key in ("z", "elevation"):
        if key in rows:
            rows[key] = S[2, 2] * rows[key]


def _scan(table: Log, which: Array, time: Array) -> Array:
    """Number of the scan of every row, counted over all sensors.

    An id that comes back later, after :data:`_OTHERS` other scans and more, is that of a counter
    that began anew: another scan.
    """
    known: dict[tuple[int, str], int] = {}
    last: dict[int, int] = {}
    ends: list[int] = []
    number = np.zeros(len(table), np.int64)
    for i, key in enumerate(zip(which.tolist(), table.columns["scan"], strict=True)):
        k = known.setdefault(key, len(ends))
        before = last.get(key[0], k)
        if before > k and len(ends) - k > _OTHERS and time[i] > ends[k]:
            k = known[key] = len(ends)
        elif before > k:
            table.fail("scan", i, f"scan {key[1]!r} comes back: the rows of a scan stand together")
        if k == len(ends):
            ends.append(int(time[i]))
        number[i] = last[key[0]] = k
        ends[k] = max(ends[k], int(time[i]))
    return number

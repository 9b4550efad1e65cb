"""Poses of sensors as a mapping gives them: at rest, or from a table over time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ....models.errors import ParameterError
from ....models.parameters import require, shown, suggestion
from ....models.records import Array, Sensor
from .log import Log
from .mapping import Tables
from .units import quantity, turn

QUATERNION = ("qx", "qy", "qz", "qw")


def sensor(spec: Any, kind: str, F: Array, S: Array, tables: Tables, where: str) -> Sensor:
    """The sensor at the pose ``spec``.

    ``F`` (3, 3) leads from the log's frame to the map, ``S`` from what the log calls the sensor's
    axes to those of a recording (see :func:`echoset.formats.importers.csv.units.axes`). A pose
    that tells a yaw or nothing is level, whichever way the axes call up.
    """
    if isinstance(spec, Mapping) and "file" in spec:
        optional = ("z", "yaw", *QUATERNION)
        return _moving(tables.read(spec, ("time", "x", "y"), optional, where), kind, F, S)
    yaw = np.zeros(1)
    if isinstance(spec, Mapping) and ("lat" in spec or "lon" in spec):
        own = {"yaw": spec["yaw"]} if "yaw" in spec else {}
        fix = {key: value for key, value in spec.items() if key != "yaw"}
        spec = {"position": tables.plane.place(fix, where), **own}
    if isinstance(spec, Mapping):
        for key in spec:
            if key not in ("position", "yaw"):
                hint = suggestion(str(key), ("position", "yaw", "file", "lat", "lon"))
                raise ParameterError(f"{where}: unknown key {shown(key)}{hint}")
        yaw[0] = quantity(spec.get("yaw", 0.0), "yaw", f"{where}.yaw")
        spec = spec.get("position", [0.0, 0.0])
    ok = isinstance(spec, list | tuple) and len(spec) in (2, 3)
    require(ok, where, "a position [x, y] or [x, y, z]", spec)
    values = [quantity(v, axis, where) for v, axis in zip(spec, "xyz", strict=False)]
    p = _position(F, *(np.array([v]) for v in values))
    return Sensor(kind, np.zeros(1, np.int64), p, _level(yaw, F, S))


def anchors(spec: Mapping[str, Any], F: Array, tables: Tables) -> dict[str, Sensor]:
    """The anchors by id, from the mapping or from a table of them."""
    if isinstance(spec.get("file"), str):
        table = tables.read(spec, ("id", "x", "y"), ("z",), "anchors")
        ids = list(table.columns["id"])
        for i, name in enumerate(ids):
            if name in ids[:i]:
                table.fail("id", i, f"{name!r} occurs twice")
        p = _position(F, *(table.values(axis) for axis in "xyz" if axis in table))
        return {name: Sensor.static("anchor", p[i]) for i, name in enumerate(ids)}
    return {
        str(name): sensor(pose, "anchor", F, F, tables, f"anchors.{name}")
        for name, pose in spec.items()
    }


def _moving(table: Log, kind: str, F: Array, S: Array) -> Sensor:
    time = table.time()
    order = np.argsort(time, kind="stable")
    again = np.zeros(len(time), bool)
    again[order[1:]] = np.diff(time[order]) == 0
    table.refuse("time", again, "is the time of another pose")
    p = _position(F, *(table.values(axis) for axis in "xyz" if axis in table))
    q = quaternions(table)
    if q is not None:
        q = _turned(q, F, S)
    else:
        q = _level(table.values("yaw") if "yaw" in table else np.zeros(len(time)), F, S)
    return Sensor(kind, time[order], p[order], q[order])


def quaternions(table: Log) -> Array | None:
    """Unit quaternions (m, 4), x y z w, of a table that tells any, or None."""
    if not any(key in table for key in QUATERNION):
        return None
    if "yaw" in table or not all(key in table for key in QUATERNION):
        raise ParameterError("poses need yaw or all of qx qy qz qw")
    q = np.column_stack([table.values(key) for key in QUATERNION])
    norm = np.linalg.norm(q, axis=1)
    table.refuse("qw", np.abs(norm - 1) > 1e-3, "belongs to a quaternion of norm other than 1")
    return np.asarray(q / norm[:, None])


def _position(F: Array, x: Array, y: Array, z: Array | None = None) -> Array:
    e, n = turn(F, x, y)
    return np.column_stack([e, n, np.zeros_like(x) if z is None else F[2, 2] * z])


def _about_z(yaw: Array) -> Array:
    zero = np.zeros_like(yaw)
    return np.column_stack([zero, zero, np.sin(yaw / 2), np.cos(yaw / 2)])


def _level(yaw: Array, F: Array, S: Array) -> Array:
    """Quaternions (k, 4) of level sensors whose first level axis lies at ``yaw`` (k,) in ``F``."""
    if np.linalg.det(F[:2, :2]) * np.linalg.det(S[:2, :2]) > 0 and F[2, 2] == S[2, 2]:
        return _turned(_about_z(yaw), F, S)
    k = int(np.argmin(np.abs(S[2])))
    ahead = F[:2, :2] @ np.array([np.cos(yaw), np.sin(yaw)])
    return _about_z(np.arctan2(ahead[1], ahead[0]) - np.arctan2(S[1, k], S[0, k]))


def _turned(q: Array, F: Array, S: Array) -> Array:
    """Quaternions (k, 4) of the rotations F R S^T, exactly those of R where F = S = 1."""
    if np.array_equal(F, S) and np.array_equal(F, np.eye(3)):
        return q
    from scipy.spatial.transform import Rotation

    if np.linalg.det(F) * np.linalg.det(S) < 0:
        raise ParameterError("frame and sensor_frame: one is right-handed, the other is not")
    R = F @ Rotation.from_quat(q).as_matrix() @ S.T
    return np.asarray(Rotation.from_matrix(R).as_quat(canonical=True))

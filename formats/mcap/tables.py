"""The growing parts of a record as tables of MCAP messages: one message per scan or step.

A table knows its topic, which leaves of the record have one value per message
and which have one per row, and how a message is encoded: JSON for link events and objects,
``foxglove.PointCloud`` for detections, ``foxglove.Grid`` for maps. Time is the message's
``log_time``. Fields that viewers need besides are derived when writing and ignored when reading.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.PackedElementField_pb2 import PackedElementField
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp

from ...models.columns import MODES
from ...models.records import Array
from .. import leaves

ColumnType = tuple[str, tuple[int, ...]]
"""Type and shape of one value of a column."""

MAP = "map"
NODES = ("tx", "rx", "reference")
"""Scan columns that count into the nodes."""
_POINT_TYPES: Any = {"u1": 1, "i1": 2, "u2": 3, "i2": 4, "u4": 5, "i4": 6, "f4": 7, "f8": 8}
"""Numbers of ``foxglove.PackedElementField``'s types."""


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """One topic: its schema, the paths of its leaves by column name, and the types by path.

    ``group`` holds ``time_ns`` and, if ``ragged``, ``row_offset``. A table that is not ``primary``
    brings scan columns for the message of the primary one of its group that follows.
    """

    group: str
    topic: str
    schema: str
    scan: Mapping[str, str]
    rows: Mapping[str, str]
    types: Mapping[str, ColumnType]
    nodes: tuple[str, ...] = ()
    ragged: bool = True
    primary: bool = True

    def encode(self, scan: Mapping[str, Any], rows: Mapping[str, Array], time_ns: int) -> bytes:
        """The message of one scan: values by scan column, arrays by row column."""
        if self.schema == "foxglove.PointCloud":
            return _encode_points(rows, self.nodes[0], time_ns)
        if self.schema == "foxglove.Grid":
            return _encode_grid(scan[MAP], self.nodes[0], time_ns)
        message: dict[str, Any] = {"stamp": {"sec": time_ns // 10**9, "nsec": time_ns % 10**9}}
        for name, value in scan.items():
            message[name] = self._to_json(name, value)
        for name, values in rows.items():
            message[name] = _lossless(values)
        return json.dumps(message, allow_nan=False, separators=(",", ":")).encode()

    def _to_json(self, name: str, value: Any) -> Any:
        if name == "mode":
            return MODES[value]
        if name in NODES and self.nodes:
            return None if value < 0 else self.nodes[value]
        if isinstance(value, float) and math.isnan(value):
            return None
        return _lossless(np.asarray(value))

    def decode(self, data: bytes) -> tuple[dict[str, Any], dict[str, Array], int]:
        """Scan values, row arrays and the number of rows of one message.

        Raises
        ------
        ValueError, KeyError, DecodeError : the message is not one of this table
        """
        if self.schema == "foxglove.PointCloud":
            return {}, *self._decode_points(data)
        if self.schema == "foxglove.Grid":
            return {MAP: self._decode_grid(data)}, {}, 0
        message = json.loads(data)
        scan = {name: self._from_json(name, message[name]) for name in self.scan}
        rows = {name: self._array(name, message[name]) for name in self.rows}
        counts = {len(values) for values in rows.values()} or {0}
        if len(counts) != 1:
            raise ValueError("columns of differing length")
        return scan, rows, counts.pop()

    def _from_json(self, name: str, value: Any) -> Any:
        if name == "mode":
            value = MODES.index(value)
        elif name in NODES and self.nodes:
            value = -1 if value is None else self.nodes.index(value)
        dtype, tail = self.types[self.scan[name]]
        return np.array(value, dtype).reshape(tail)[()]

    def _array(self, name: str, values: Any) -> Array:
        dtype, tail = self.types[self.rows[name]]
        return np.array(values, dtype).reshape(len(values), *tail)

    def _decode_points(self, data: bytes) -> tuple[dict[str, Array], int]:
        cloud = PointCloud()
        cloud.ParseFromString(data)
        fields = {f.name: f for f in cloud.fields}
        rows = {}
        for name in self.rows:
            dtype = np.dtype(self.types[self.rows[name]][0])
            at = fields[name]
            if at.type != _POINT_TYPES[dtype.str[1:]]:
                raise ValueError(f"field {name} is not {dtype}")
            points = np.dtype(
                {
                    "names": [name],
                    "formats": [dtype],
                    "offsets": [at.offset],
                    "itemsize": cloud.point_stride,
                }
            )
            rows[name] = np.frombuffer(cloud.data, points)[name].copy()
        return rows, len(cloud.data) // cloud.point_stride

    def _decode_grid(self, data: bytes) -> Array:
        grid = Grid()
        grid.ParseFromString(data)
        dtype, tail = self.types[self.scan[MAP]]
        return np.frombuffer(grid.data, dtype).reshape(tail)


def _lossless(values: Array) -> Any:
    """Nested lists; a column in which NaN stands for what is missing has null there."""
    if values.dtype.kind == "f" and np.isnan(values).any():
        return [None if math.isnan(v) else v for v in values.ravel().tolist()]
    return values.tolist()


def timestamp(time_ns: int) -> Timestamp:
    """A protobuf time stamp."""
    return Timestamp(seconds=time_ns // 10**9, nanos=time_ns % 10**9)


def drawn(values: Array) -> Array:
    """Values as viewers draw them, in single precision; what exceeds it is infinitely far."""
    with np.errstate(over="ignore"):
        return values.astype("<f4")


def _encode_points(rows: Mapping[str, Array], frame: str, time_ns: int) -> bytes:
    columns = dict(rows)
    if "range" in rows:
        elevation = rows.get("elevation", np.zeros_like(rows["range"]))
        ground = rows["range"] * np.cos(elevation)
        columns["x"] = drawn(ground * np.cos(rows["azimuth"]))
        columns["y"] = drawn(ground * np.sin(rows["azimuth"]))
        columns["z"] = drawn(rows["range"] * np.sin(elevation))
    columns.setdefault("z", np.zeros(len(columns["x"]), "f4"))
    return point_cloud(columns, frame, time_ns)


def point_cloud(columns: Mapping[str, Array], frame: str, time_ns: int) -> bytes:
    """A ``foxglove.PointCloud`` with these fields, all of one length."""
    packed = np.dtype([(name, values.dtype.str) for name, values in columns.items()])
    points = np.empty(len(columns["x"]), packed)
    for name, values in columns.items():
        points[name] = values
    cloud = PointCloud(
        timestamp=timestamp(time_ns),
        frame_id=frame,
        point_stride=packed.itemsize,
        data=points.tobytes(),
    )
    cloud.pose.orientation.w = 1.0
    for name, (dtype, offset, *_) in (packed.fields or {}).items():
        cloud.fields.append(
            PackedElementField(name=name, offset=offset, type=_POINT_TYPES[dtype.str[1:]])
        )
    return serialize(cloud)


def _encode_grid(power: Array, frame: str, time_ns: int) -> bytes:
    columns = power.shape[1]
    grid = Grid(
        timestamp=timestamp(time_ns),
        frame_id=frame,
        column_count=columns,
        row_stride=4 * columns,
        cell_stride=4,
        fields=[PackedElementField(name="power", offset=0, type=_POINT_TYPES["f4"])],
        data=drawn(np.ascontiguousarray(power)).tobytes(),
    )
    grid.pose.orientation.w = grid.cell_size.x = grid.cell_size.y = 1.0
    return serialize(grid)


def serialize(message: Message) -> bytes:
    """Protobuf bytes that do not depend on hash order."""
    return bytes(message.SerializeToString(deterministic=True))


def column_types(found: Mapping[str, Array]) -> dict[str, ColumnType]:
    """Type and value shape of the columns at the paths of ``found``."""
    return {p: (a.dtype.str.lstrip("<|"), a.shape[1:]) for p, a in found.items()}


def tables(
    small: Mapping[str, Any], types: Mapping[str, ColumnType], estimator: str = ""
) -> list[Table]:
    """The tables of the record with these ``small`` leaves and growing leaves ``types``."""
    groups: dict[str, tuple[dict[str, str], dict[str, str]]] = {}
    for path in types:
        name = path.rpartition("/")[2]
        columns = groups.setdefault(leaves.table(path), ({}, {}))[leaves.per_row(path)]
        if name in columns or name in groups[leaves.table(path)][not leaves.per_row(path)]:
            raise ValueError("a diagnostic has the name of a column of objects")
        if name not in ("time_ns", "row_offset"):
            columns[name] = path
    found: list[Table] = []
    for group, (scan, rows) in groups.items():
        if group.startswith("streams/"):
            found += _of_stream(group, small, scan, rows, types)
        elif group == "truth/blocked":
            schema = "echoset.BlockedLink"
            found.append(Table(group, f"/{group}", schema, scan, rows, types, ragged=False))
        else:
            topic = (
                "/truth/objects" if group == "truth/objects" else f"/estimates/{estimator}/objects"
            )
            found.append(Table(group, topic, "echoset.ObjectSet", scan, rows, types))
    return found


def _of_stream(
    group: str,
    small: Mapping[str, Any],
    scan: dict[str, str],
    rows: dict[str, str],
    types: Mapping[str, ColumnType],
) -> list[Table]:
    """The tables of a stream: that of its scans, after one of their values where it has such."""
    name, nodes = group.removeprefix("streams/"), tuple(small[f"{group}/nodes"])
    if small[f"{group}/kind"] == "uwb":
        topic = "/uwb/measurements" if name == "uwb" else f"/uwb/{name}/measurements"
        return [Table(group, topic, "echoset.UwbMeasurement", scan, rows, types, nodes)]
    if small[f"{group}/kind"] == "odometry":
        return [Table(group, f"/odometry/{name}", "echoset.Odometry", scan, rows, types, nodes)]
    topic = f"/radar/{name}"
    maps = {c: scan.pop(c) for c in (MAP,) if c in scan}
    found = []
    if scan:
        table = Table(group, f"{topic}/scan", "echoset.Scan", scan, {}, types, nodes)
        found.append(replace(table, primary=False))
    if small[f"{group}/kind"] == "range_angle_map":
        found.append(
            Table(group, f"{topic}/range_angle", "foxglove.Grid", maps, rows, types, nodes)
        )
    else:
        schema = "foxglove.PointCloud"
        found.append(Table(group, f"{topic}/detections", schema, {}, rows, types, nodes))
    return found

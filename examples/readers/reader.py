"""Read recordings and estimates of echoset without echoset, and recompute their digest.

Written from the page on file formats with h5py and mcap alone, as a start for other languages::

    python reader.py FILE

A record is a dictionary of leaves by path: text, numbers, tuples of text, and arrays.
"""

from __future__ import annotations

import hashlib
import json
import sys
from typing import Any

import h5py
import numpy as np
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.PointCloud_pb2 import PointCloud
from mcap.reader import make_reader

ROOT_ATTRIBUTES = ("Conventions", "format_version", "content_digest", "observed_digest")
MODES = ("active", "passive", "tdoa")


def token(leaf: Any) -> str:
    """The token of a leaf: type, shape and digest of an array, type and JSON of all else."""
    if isinstance(leaf, np.ndarray):
        little = leaf.dtype.newbyteorder("<")
        shape = ",".join(str(n) for n in leaf.shape)
        data = np.ascontiguousarray(leaf, little).tobytes()
        return f"{little.str}[{shape}]:{hashlib.sha256(data).hexdigest()}"
    value = list(leaf) if isinstance(leaf, tuple) else leaf
    return f"{type(leaf).__name__}:{json.dumps(value)}"


def content_digest(leaves: dict[str, Any]) -> str:
    """The digest over all paths and tokens."""
    pairs = sorted([path, token(leaf)] for path, leaf in leaves.items())
    return hashlib.sha256(json.dumps(pairs).encode()).hexdigest()


def read_hdf5(path: str) -> tuple[dict[str, Any], str]:
    """The leaves of an HDF5 file, and the content digest that it states."""
    leaves: dict[str, Any] = {}

    def walk(group: h5py.Group, prefix: str) -> None:
        for name, value in group.attrs.items():
            plain = value.item() if isinstance(value, np.generic) else value
            leaves[prefix + name] = plain.decode() if isinstance(plain, bytes) else plain
        for name, item in group.items():
            if isinstance(item, h5py.Group):
                walk(item, f"{prefix}{name}/")
            elif item.dtype.kind != "S":
                leaves[prefix + name] = item[()]
            elif item.ndim == 0:
                leaves[prefix + name] = item[()].decode()
            else:
                leaves[prefix + name] = tuple(text.decode() for text in item[()])

    with h5py.File(path) as file:
        walk(file, "")
    stated = leaves["content_digest"]
    for name in (*ROOT_ATTRIBUTES, "tokens"):
        del leaves[name]
    return leaves, stated


class Section:
    """One record in an MCAP file: the leaves of its header, and columns that messages fill."""

    def __init__(self, header: dict[str, Any]) -> None:
        self.small = {path: self._leaf(value) for path, value in header["leaves"].items()}
        self.types = {path: (t, tuple(shape)) for path, (t, shape) in header["columns"].items()}
        self.values: dict[str, list[Any]] = {path: [] for path in self.types}
        self.tables: dict[str, tuple[str, tuple[str, ...]]] = {}
        for path, kind in self.small.items():
            if path.startswith("streams/") and path.endswith("/kind"):
                self._add_stream(path.split("/")[1], kind)
        if "truth/objects/time_ns" in self.types:
            self.tables["/truth/objects"] = ("truth/objects", ("truth/objects",))
            self.tables["/truth/blocked"] = ("truth/blocked", ("truth/blocked",))
        if self.small["kind"] == "estimates":
            topic = f"/estimates/{header['estimator']}/objects"
            self.tables[topic] = ("objects", ("objects", "steps"))

    @staticmethod
    def _leaf(value: Any) -> Any:
        if isinstance(value, dict):
            return np.array(value["data"], value["dtype"]).reshape(value["shape"])
        return tuple(value) if isinstance(value, list) else value

    def _add_stream(self, name: str, kind: str) -> None:
        group = f"streams/{name}"
        columns = (f"{group}/scan", f"{group}/rows")
        if kind == "uwb":
            topic = "/uwb/measurements" if name == "uwb" else f"/uwb/{name}/measurements"
        elif kind == "odometry":
            topic = f"/odometry/{name}"
        else:
            self.tables[f"/radar/{name}/scan"] = ("", columns[:1])
            last = "range_angle" if kind == "range_angle_map" else "detections"
            topic = f"/radar/{name}/{last}"
        self.tables[topic] = (group, columns)

    def take(self, topic: str, time_ns: int, data: bytes) -> None:
        """Take in a message; the group of its table has the times, its parents the columns."""
        group, parents = self.tables[topic]
        if topic.endswith("/range_angle"):
            columns: dict[str, Any] = {"map": self._map(group, data)}
        else:
            columns = points(data) if topic.endswith("/detections") else json.loads(data)
        rows = 0
        for path in self.types:
            parent, _, name = path.rpartition("/")
            if name not in columns or parent not in parents:
                continue
            if parent.endswith("/scan") or parent in ("steps", "truth/blocked"):
                self._append(path, [self._code(group, name, columns[name])])
            else:
                self._append(path, columns[name])
                rows = len(columns[name])
        if group:
            self._append(f"{group}/time_ns", [time_ns])
        if f"{group}/row_offset" in self.types:
            offset = self.values[f"{group}/row_offset"]
            offset.append((offset[-1] if offset else 0) + rows)

    def _append(self, path: str, values: Any) -> None:
        self.values[path].extend(values)

    def _code(self, group: str, name: str, value: Any) -> Any:
        """Indices in place of the names that link events have."""
        if isinstance(value, str):
            return (MODES if name == "mode" else self.small[f"{group}/nodes"]).index(value)
        return -1 if value is None and name == "reference" else value

    def _map(self, group: str, data: bytes) -> np.ndarray[Any, Any]:
        grid = Grid()
        grid.ParseFromString(data)
        return np.frombuffer(grid.data, "<f4").reshape(self.types[f"{group}/scan/map"][1])

    def leaves(self) -> dict[str, Any]:
        """All leaves; a null in a column of floats is NaN."""
        made = dict(self.small)
        for path, (dtype, shape) in self.types.items():
            first = [0] if path.endswith("/row_offset") else []
            made[path] = np.array(first + self.values[path], dtype).reshape(-1, *shape)
        return made


def points(data: bytes) -> dict[str, np.ndarray[Any, Any]]:
    """The fields of a point cloud by name."""
    cloud = PointCloud()
    cloud.ParseFromString(data)
    kinds = dict(enumerate(("u1", "i1", "<u2", "<i2", "<u4", "<i4", "<f4", "<f8"), 1))
    layout = np.dtype(
        {
            "names": [field.name for field in cloud.fields],
            "formats": [kinds[field.type] for field in cloud.fields],
            "offsets": [field.offset for field in cloud.fields],
            "itemsize": cloud.point_stride,
        }
    )
    packed = np.frombuffer(cloud.data, layout)
    return {name: packed[name] for name in packed.dtype.names}


def read_mcap(path: str) -> tuple[dict[str, Any], str]:
    """The leaves of an MCAP file, and the content digest that it states."""
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        headers = [a.data for a in reader.iter_attachments() if a.name == "echoset/header.json"]
        (trailer,) = (m.metadata for m in reader.iter_metadata() if m.name == "echoset")
        sections = [Section(json.loads(header)) for header in headers]
        for _, channel, message in reader.iter_messages(log_time_order=False):
            for section in sections:
                if channel.topic in section.tables:
                    section.take(channel.topic, message.log_time, message.data)
    leaves = {}
    for prefix, section in zip(("", "recording/"), sections, strict=False):
        leaves |= {prefix + name: leaf for name, leaf in section.leaves().items()}
    for section_name, text in json.loads(trailer["provenance"]).items():
        leaves[f"{section_name}/provenance".lstrip("/")] = text
    return leaves, trailer["content_digest"]


def read(path: str) -> tuple[dict[str, Any], str]:
    """The leaves of a file of either format, and the content digest that it states."""
    with open(path, "rb") as file:
        magic = file.read(8)
    return read_hdf5(path) if magic == b"\x89HDF\r\n\x1a\n" else read_mcap(path)


if __name__ == "__main__":
    found, digest = read(sys.argv[1])
    for name, leaf in sorted(found.items()):
        print(name, f"{leaf.dtype} {leaf.shape}" if isinstance(leaf, np.ndarray) else leaf)
    print("sound" if content_digest(found) == digest else "DAMAGED", digest)

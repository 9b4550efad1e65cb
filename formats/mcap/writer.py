"""MCAP: the stream, for pipes and viewers.

A file holds one section per record: the estimates, and the recording where it travels along. A
section starts with an attachment that holds the small leaves; its messages hold the tables of
:mod:`.tables`; a metadata record at the end of the file holds provenance and digests. ``/tf``,
``.../scene`` and ``.../outlines`` are for viewers and not read back.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import replace
from heapq import merge
from itertools import count
from math import inf
from pathlib import Path
from typing import IO, Any

import numpy as np
from mcap.writer import Writer as McapWriter
from mcap_protobuf.schema import build_file_descriptor_set

from ...models.errors import ParameterError
from ...models.records import Estimates, Meta, Recording
from .. import leaves
from ..leaves import ArrayDigest, Leaf
from .container import HEADER, MESSAGE, TRAILER
from .schemas import SCHEMAS
from .tables import Table, column_types, tables
from .viewers import outlines
from .viewers import shapes as scene

SUMMARY = "MCAP, for pipes and viewers"
SUFFIXES = (".mcap",)

_Message = tuple[int, str, int, bool, str, str, bytes]
"""Time, group, index, whether primary, topic, schema and data: sorted, the order in the file."""
_VIEWED = "~"
"""Group of the messages for viewers: after all others of the same time."""


class _Counting:
    """A binary output that knows its position, whether or not it can seek."""

    def __init__(self, target: IO[bytes]) -> None:
        self._target, self._position = target, 0

    def write(self, data: bytes) -> None:
        self._target.write(data)
        self._position += len(data)

    def tell(self) -> int:
        return self._position

    def flush(self) -> None:
        self._target.flush()


class _File:
    """An open MCAP file."""

    def __init__(self, target: Path | IO[bytes]) -> None:
        file = target.open("wb") if isinstance(target, Path) else target
        self._close = file.close if isinstance(target, Path) else file.flush
        counting: Any = _Counting(file)
        self.mcap: Any = McapWriter(counting, enable_data_crcs=True)
        self.mcap.start(library="echoset")
        self._channels: dict[str, tuple[int, count[int]]] = {}
        self._schemas: dict[str, int] = {}

    def add(self, time_ns: int, topic: str, schema: str, data: bytes) -> None:
        """Write one message."""
        if len(data) > MESSAGE:
            reason = f"{len(data)} bytes at one time, {MESSAGE} are the limit: write HDF5"
            raise ParameterError(f"{topic}: {reason}")
        if topic not in self._channels:
            if schema not in self._schemas:
                self._schemas[schema] = self._register(schema)
            encoding = "protobuf" if schema in scene.MESSAGES else "json"
            channel = self.mcap.register_channel(topic, encoding, self._schemas[schema])
            self._channels[topic] = channel, count(1)
        channel, sequence = self._channels[topic]
        self.mcap.add_message(channel, time_ns, data, time_ns, next(sequence))

    def take(self, messages: Iterable[_Message]) -> None:
        """Write messages in their order."""
        for time_ns, *_, topic, schema, data in messages:
            self.add(time_ns, topic, schema, data)

    def _register(self, schema: str) -> int:
        if schema in SCHEMAS:
            text = json.dumps(SCHEMAS[schema])
            return int(self.mcap.register_schema(schema, "jsonschema", text.encode()))
        kind = build_file_descriptor_set(scene.MESSAGES[schema])
        data = kind.SerializeToString(deterministic=True)
        return int(self.mcap.register_schema(schema, "protobuf", data))

    def finish(self, digests: dict[str, str], provenance: dict[str, str]) -> None:
        """Write the trailer; the file is complete after this and only after this."""
        header = leaves.header(digests)
        trailer = {
            "format_version": str(header["format_version"]),
            "content_digest": header["content_digest"],
            "observed_digest": header["observed_digest"],
            "tokens": json.dumps(digests, sort_keys=True),
            "provenance": json.dumps(provenance, sort_keys=True),
        }
        self.mcap.add_metadata(TRAILER, trailer)
        self.mcap.finish()
        self.close()

    def close(self) -> None:
        """Close what was opened here."""
        self._close()


class _Section:
    """One record being written: its tables and the digests of what was written so far."""

    def __init__(self, file: _File, record: Recording | Estimates) -> None:
        own = leaves.of(record)
        grow = {p: v for p, v in own.items() if leaves.grows(p) and isinstance(v, np.ndarray)}
        small = {p: v for p, v in own.items() if p not in grow and p != "provenance"}
        self._digests: dict[str, str | ArrayDigest] = dict(leaves.digests(small))
        self._rows: dict[str, int] = {}
        estimator = record.estimator if isinstance(record, Estimates) else ""
        types = column_types(grow)
        self._tables = tables(small, types, estimator)
        header = {
            "estimator": estimator,
            "leaves": {p: _to_json(v) for p, v in small.items()},
            "columns": types,
        }
        text = json.dumps(header, allow_nan=False, sort_keys=True)
        if len(text) > MESSAGE:
            raise ParameterError(f"MCAP: {len(text)} bytes of sensors and models, limit {MESSAGE}")
        file.mcap.add_attachment(0, 0, HEADER, "application/json", text.encode())
        self._poses = _poses_for_the_eye(record)
        self._pose = next(self._poses, None)

    def messages(self, record: Recording | Estimates) -> Iterator[_Message]:
        """All messages of ``record`` (the next steps, or the whole) in the order of time."""
        own = leaves.of(record)
        parts = [self._table(table, own) for table in self._tables]
        ends = (np.max(own[f"{t.group}/time_ns"], initial=0) for t in self._tables)
        end = max(map(int, ends), default=0)
        return merge(*parts, *_objects_for_the_eye(record), self._poses_until(end))

    def _poses_until(self, end: float) -> Iterator[_Message]:
        while self._pose is not None and self._pose[0] <= end:
            yield self._pose
            self._pose = next(self._poses, None)

    def rest(self) -> Iterator[_Message]:
        """Poses after the last message."""
        return self._poses_until(inf)

    def _table(self, table: Table, own: dict[str, Any]) -> Iterator[_Message]:
        times = own[f"{table.group}/time_ns"]
        offset = np.zeros(len(times) + 1, np.int64)
        if table.ragged:
            offset = own[f"{table.group}/row_offset"]
        if table.primary:
            self._index(table, times, offset)
        columns = {**table.scan, **table.rows}
        for path in columns.values():
            self._update(path, own[path])
        if len(times) and times[0] < 0:
            raise ParameterError(f"{table.topic}: MCAP has no times before the epoch")
        for k, time_ns in enumerate(times.tolist()):
            scan = {c: own[p][k] for c, p in table.scan.items()}
            rows = {c: own[p][offset[k] : offset[k + 1]] for c, p in table.rows.items()}
            data = table.encode(scan, rows, time_ns)
            yield time_ns, table.group, k, table.primary, table.topic, table.schema, data

    def _index(self, table: Table, times: Any, offset: Any) -> None:
        self._update(f"{table.group}/time_ns", times)
        if table.ragged:
            path = f"{table.group}/row_offset"
            first = self._rows.setdefault(path, 0)
            self._update(path, (offset[1:] if path in self._digests else offset) + first)
            self._rows[path] += int(offset[-1])

    def _update(self, path: str, part: Any) -> None:
        digest = self._digests.setdefault(path, ArrayDigest())
        assert isinstance(digest, ArrayDigest)
        digest.update(part)

    def digests(self, provenance: str) -> dict[str, str]:
        """The digests of everything written."""
        digests = {path: str(digest) for path, digest in self._digests.items()}
        return {**digests, "provenance": leaves.digest_of(provenance)}


def _to_json(leaf: Leaf) -> Any:
    if isinstance(leaf, np.ndarray):
        return {"dtype": leaf.dtype.str, "shape": leaf.shape, "data": leaf.ravel().tolist()}
    return leaf


def _named(topic: str, schema: str, messages: Iterable[tuple[int, bytes]]) -> Iterator[_Message]:
    for k, (time_ns, data) in enumerate(messages):
        yield time_ns, _VIEWED, k, True, topic, schema, data


def _objects_for_the_eye(record: Recording | Estimates) -> Iterator[Iterator[_Message]]:
    topic, objects, kind = "/truth", None, "truth"
    if isinstance(record, Estimates):
        topic, objects, kind = f"/estimates/{record.estimator}", record.objects, "estimates"
    elif record.truth is not None:
        objects = record.truth.objects
    if objects is not None:
        frame = record.meta.frame
        shapes = scene.shapes(objects, frame, kind)
        yield _named(f"{topic}/scene", "foxglove.SceneUpdate", shapes)
        points = outlines.clouds(objects, frame, kind)
        yield _named(f"{topic}/outlines", "foxglove.PointCloud", points)


def _poses_for_the_eye(record: Recording | Estimates) -> Iterator[_Message]:
    if isinstance(record, Estimates):
        return iter(())
    poses = sorted(scene.transforms(record.sensors, record.meta.frame))
    drawn = _named("/sensors/scene", "foxglove.SceneUpdate", scene.sensors(record.sensors))
    return merge(_named("/tf", "foxglove.FrameTransform", poses), drawn)


class Writer:
    """Writes a record window by window of time."""

    def __init__(self, target: Path | IO[bytes]) -> None:
        self._file = _File(target)
        self._section: _Section | None = None

    def append(self, window: Recording | Estimates) -> None:
        """Take the next scans and truth, or steps; sensors and models are those of the first."""
        if isinstance(window, Estimates):
            window = replace(window, recording=None)
        if self._section is None:
            self._section = _Section(self._file, window)
        self._file.take(self._section.messages(window))

    def close(self, meta: Meta, recording: Recording | None = None) -> None:
        """Finish the file with its ``meta`` and the recording that travels along, if any."""
        try:
            assert self._section is not None, "nothing was appended"
            self._file.take(self._section.rest())
            provenance = {"": leaves.json_of(meta.provenance)}
            digests = self._section.digests(provenance[""])
            if recording is not None:
                section = _Section(self._file, recording)
                self._file.take(section.messages(recording))
                self._file.take(section.rest())
                provenance["recording"] = leaves.json_of(recording.meta.provenance)
                beside = section.digests(provenance["recording"])
                digests |= {f"recording/{path}": digest for path, digest in beside.items()}
            self._file.finish(digests, provenance)
        finally:
            self.abort()

    def abort(self) -> None:
        """Close the file as it is."""
        self._file.close()

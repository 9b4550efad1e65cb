"""Reading HDF5 files, whole or scan by scan: attributes verified at once, datasets when read."""

from __future__ import annotations

import json
import zlib
from collections.abc import Container, Iterator
from dataclasses import replace
from heapq import merge
from itertools import islice
from pathlib import Path
from typing import IO, Any

import h5py
import numpy as np

from ...models.checks import check, check_stream
from ...models.errors import FormatError
from ...models.records import Estimates, Recording, Scan, Stream
from .. import layout
from .. import tree as trees
from ..steps import WINDOW
from ..tree import ArrayToken, Tree

HEADER = {"Conventions", "format_version", "content_digest", "observed_digest"}
_MAX_DEPTH, _MAX_NODES, _MAX_TEXT = 8, 20_000, 1 << 24
_MAX_CHUNK, _LARGE = 1 << 26, 1 << 18
"""Bytes of a chunk, which is read whole; and stored ones from which on it is looked into before,
as the library inflates it to whatever is in it, 1032 times what is stored."""
_ALLOWANCE, _RATIO = 1 << 28, 64
"""Bytes that a file may declare, and how many more for each that it has."""
_CHECKSUM = 4
_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}
ERRORS = (OSError, LookupError, RuntimeError, ValueError, TypeError, OverflowError, zlib.error)


def expect_header(names: Container[str], path: object) -> None:
    """Refuse a file that does not say what ours say at their root."""
    absent = sorted(name for name in HEADER if name not in names)
    if absent:
        reason = f"is HDF5, but no file of echoset: it has no {' '.join(absent)}"
        reason += ": no importer reads it, export it as a table of text"
        raise FormatError(path, "/", reason)


class TreeReader:
    """An open file: its leaves by path, its tokens, and verified reading of each."""

    def __init__(self, source: Path | IO[bytes], path: object) -> None:
        self.path = path
        self.leaves: dict[str, Any] = {}
        self._nodes = self._bytes = 0
        try:
            self._size = checked_size(source, path)
            self.file = h5py.File(source, "r")
        except ERRORS as error:
            raise FormatError(path, "superblock", one_line(error)) from error
        try:
            self._place = "/"
            self._walk(self.file, "", 0)
            self._place = "/"
            expect_header(self.leaves, path)
            self.header = {k: self.leaves.pop(k) for k in HEADER}
            self.tokens: dict[str, str] = json.loads(self._value("tokens"))
            del self.leaves["tokens"]
            self._verify_header()
        except ERRORS as error:
            self.file.close()
            raise FormatError(path, self._place, one_line(error)) from error
        except BaseException:
            self.file.close()
            raise

    def _walk(self, group: h5py.Group, prefix: str, depth: int) -> None:
        """Gather all leaves below ``group``: values of attributes, datasets still unread."""
        if depth > _MAX_DEPTH:
            raise FormatError(self.path, prefix, "groups nested too deeply")
        for name in group.attrs:
            self._visit(prefix + name)
            self.leaves[prefix + name] = attribute(group, name)
        for name in group:
            path = prefix + name
            self._visit(path)
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                raise FormatError(self.path, path, "soft and external links are refused")
            item = group[name]
            if isinstance(item, h5py.Group):
                self._walk(item, path + "/", depth + 1)
            elif isinstance(item, h5py.Dataset):
                self._check_size(path, item)
                self.leaves[path] = item
            else:
                raise FormatError(self.path, path, "neither group nor dataset")

    def _visit(self, path: str) -> None:
        self._place = path[:200]
        self._nodes += 1
        if self._nodes > _MAX_NODES:
            raise FormatError(self.path, path[:200], f"more than {_MAX_NODES} groups and datasets")

    def _check_size(self, path: str, data: h5py.Dataset) -> None:
        """Refuse types, links to other files and sizes that we never write."""
        kind = data.dtype.kind
        if kind not in "iufS" or data.ndim > 4 or data.is_virtual or data.external:
            raise FormatError(self.path, path, f"type {str(data.dtype)[:40]} is not expected")
        self._bytes += data.nbytes
        if self._bytes > _ALLOWANCE + _RATIO * self._size:
            raise FormatError(
                self.path, path, f"a file of {self._size} bytes declares {self._bytes}"
            )
        if kind == "S" and data.nbytes > _MAX_TEXT:
            raise FormatError(self.path, path, f"a text of {data.nbytes} bytes")
        if data.chunks:
            self._check_chunks(path, data)

    def _check_chunks(self, path: str, data: h5py.Dataset) -> None:
        room = int(np.prod(data.chunks, dtype=object)) * data.dtype.itemsize
        if room > _MAX_CHUNK:
            raise FormatError(self.path, path, f"chunks of {room} bytes")
        pipeline = data.id.get_create_plist()
        filters = [pipeline.get_filter(k)[0] for k in range(pipeline.get_nfilters())]
        if not _FILTERS.issuperset(filters):
            raise FormatError(self.path, path, "a filter that is not expected")
        sizes, large = [room], []

        def measure(chunk: Any) -> None:
            sizes.append(chunk.size if chunk.byte_offset + chunk.size <= self._size else 0)
            if chunk.size > _LARGE:
                large.append(chunk.chunk_offset)

        data.id.chunk_iter(measure)
        if max(sizes) > room + (room >> 6) + 64 or min(sizes) <= _CHECKSUM:
            odd = max(sizes, key=lambda size: abs(size - room))
            raise FormatError(self.path, path, f"a chunk of {room} bytes is stored in {odd}")
        for offset in large if h5py.h5z.FILTER_DEFLATE in filters else ():
            stored = data.id.read_direct_chunk(offset)[1]
            if len(zlib.decompressobj().decompress(stored, room + 1)) > room:
                raise FormatError(self.path, path, f"a chunk of {room} bytes holds more")

    def _verify_header(self) -> None:
        version = self.header["format_version"]
        if version != layout.FORMAT_VERSION:
            raise FormatError(self.path, "format_version", f"{version} is not known here")
        if self.header["Conventions"] != layout.CONVENTIONS:
            raise FormatError(self.path, "Conventions", f"is not {layout.CONVENTIONS}")
        if trees.digest(self.tokens) != self.header["content_digest"]:
            raise FormatError(self.path, "content_digest", "does not fit the content")
        if self.header["observed_digest"] != trees.observed_digest(self.tokens):
            raise FormatError(self.path, "observed_digest", "does not fit the content")
        if set(self.tokens) != set(self.leaves):
            odd = sorted(set(self.tokens) ^ set(self.leaves))[0]
            raise FormatError(self.path, odd[:200], "missing, or not part of the content")
        for path, leaf in self.leaves.items():
            self._place = path
            if not isinstance(leaf, h5py.Dataset):
                self.verify(path, trees.token(leaf))
            elif leaf.dtype.kind != "S" and _attributes(leaf) != layout.attributes(path):
                raise FormatError(self.path, path, "units or other attributes are not the expected")

    def verify(self, path: str, token: object) -> None:
        """Refuse a leaf whose token is not the stored one."""
        if str(token) != self.tokens[path]:
            raise FormatError(self.path, path, "does not fit its digest")

    def _value(self, path: str) -> Any:
        """The value of the leaf at ``path``."""
        leaf = self.leaves[path]
        if not isinstance(leaf, h5py.Dataset):
            return leaf
        value = leaf[()]
        if leaf.dtype.kind != "S":
            return value
        return tuple(v.decode() for v in value) if leaf.ndim else value.decode()

    def read(self, paths: list[str]) -> Tree:
        """The verified leaves at ``paths`` as a tree."""
        leaves = {}
        for path in paths:
            try:
                leaves[path] = self._value(path)
            except ERRORS as error:
                raise FormatError(self.path, path, one_line(error)) from error
            self.verify(path, trees.token(leaves[path]))
        return trees.unflatten(leaves)


def checked_size(source: Path | IO[bytes], path: object) -> int:
    """The size [bytes] of a file that has none after the end that its superblock states."""
    if isinstance(source, Path):
        with source.open("rb") as file:
            return checked_size(file, path)
    head = source.read(48)
    size = source.seek(0, 2)
    source.seek(0)
    if len(head) == 48 and head[8] == 0 and int.from_bytes(head[40:48], "little") < size:
        raise FormatError(path, f"byte {int.from_bytes(head[40:48], 'little')}", "data after end")
    return size


def _attributes(data: h5py.Dataset) -> dict[str, Any]:
    return {name: attribute(data, name) for name in islice(data.attrs, 10)}


def attribute(item: h5py.Group | h5py.Dataset, name: str) -> Any:
    """An attribute: a number, or a text of fixed length."""
    stored = item.attrs.get_id(name)
    if stored.shape != () or stored.dtype.kind not in "iufbS":
        raise ValueError(f"the attribute {name[:40]!r} is no number or text of fixed length")
    value = item.attrs[name]
    if isinstance(value, bytes):
        return value.decode()
    return value.item() if isinstance(value, np.generic) else value


def one_line(error: Exception) -> str:
    return " ".join(str(error).split())[:300] or type(error).__name__


def read(source: Path | IO[bytes], path: object) -> Recording | Estimates:
    """Read and verify a whole record.

    Raises
    ------
    FormatError : the file is damaged, or holds something else
    """
    reader = TreeReader(source, path)
    try:
        record = layout.from_tree(reader.read(list(reader.leaves)), path)
    finally:
        reader.file.close()
    check(record, path)
    return record


def summary(source: Path | IO[bytes], path: object) -> dict[str, Any]:
    """Digests, attributes and the shapes of all datasets, without reading the data."""
    reader = TreeReader(source, path)
    try:
        small = [p for p, v in reader.leaves.items() if getattr(v, "ndim", 0) == 0]
        shapes = {p: v.shape for p, v in reader.leaves.items() if getattr(v, "ndim", 0)}
        return {**reader.header, **trees.flatten(reader.read(small)), "shapes": shapes}
    finally:
        reader.file.close()


class Column:
    """A dataset that is read in parts, in order, and verified once all of it was."""

    def __init__(self, reader: TreeReader, path: str) -> None:
        self._reader, self._path = reader, path
        self._data = reader.leaves[path]
        index = path.endswith(("/time_ns", "/row_offset"))
        if index and (self._data.dtype != np.int64 or self._data.ndim != 1):
            raise FormatError(reader.path, path, "is no column of integers")
        self._token = ArrayToken()
        self._token.update(np.zeros((0, *self._data.shape[1:]), self._data.dtype))

    def __len__(self) -> int:
        return len(self._data)

    def take(self, start: int, stop: int) -> Any:
        """The rows ``start:stop``, which follow those taken before."""
        try:
            values = self._data[start:stop]
        except ERRORS as error:
            raise FormatError(self._reader.path, self._path, one_line(error)) from error
        if len(values) != stop - start:
            raise FormatError(self._reader.path, self._path, f"ends before row {stop}")
        self._token.update(values)
        return values

    def whole(self) -> Any:
        """All rows, verified."""
        values = self.take(0, len(self))
        self.verify()
        return values

    def verify(self) -> None:
        """Refuse the column unless what was taken is all of what was written."""
        self._reader.verify(self._path, self._token)


class Source:
    """A recording that is read scan by scan in windows."""

    unit = "scan"

    def __init__(self, source: Path | IO[bytes], path: object, keep: bool = False) -> None:
        self._reader = TreeReader(source, path)
        self._keep, self._done = keep, 0
        self.observed_digest = str(self._reader.header["observed_digest"])
        try:
            if self._reader.leaves["kind"] != "recording":
                raise FormatError(path, "", f"holds {self._reader.leaves['kind']}, not a recording")
            self.setup = self._setup()
        except BaseException:
            self.close()
            raise

    def _setup(self) -> Recording:
        paths = trees.observed(self._reader.leaves)
        grows = [p for p in paths if layout.grows(p)]
        tree = self._reader.read([p for p in paths if p not in set(grows)])
        empty = {p: np.zeros((0, *d.shape[1:]), d.dtype) for p in grows if (d := self._data(p))}
        empty |= {p: np.zeros(1, np.int64) for p in grows if p.endswith("/row_offset")}
        whole = trees.unflatten({**trees.flatten(tree), **empty})
        setup = layout.from_tree({**whole, "kind": "recording", "provenance": "{}"}, self.path)
        assert isinstance(setup, Recording)
        check(setup, self.path)
        return setup

    @property
    def path(self) -> object:
        """The file as the user named it."""
        return self._reader.path

    def _data(self, path: str) -> Any:
        return self._reader.leaves[path]

    def scans(self) -> Iterator[Scan]:
        """All scans in the order of (time, stream), verified by the time the last is out."""
        streams = (self._stream(name, s) for name, s in sorted(self.setup.streams.items()))
        for scan in merge(*streams, key=lambda scan: (scan.time_ns, scan.stream)):
            self._done += 1
            yield scan

    @property
    def progress(self) -> tuple[int, int]:
        """Scans that were read, and that there are."""
        return self._done, sum(len(self._data(f"streams/{n}/time_ns")) for n in self.setup.streams)

    def _stream(self, name: str, empty: Stream) -> Iterator[Scan]:
        top = f"streams/{name}"
        scan = {c: Column(self._reader, f"{top}/scan/{c}") for c in empty.scan}
        rows = {c: Column(self._reader, f"{top}/rows/{c}") for c in empty.rows}
        times, offsets = (Column(self._reader, f"{top}/{c}") for c in ("time_ns", "row_offset"))
        previous = None
        offset = offsets.take(0, 1)
        for start in range(0, len(times), WINDOW):
            stop = min(start + WINDOW, len(times))
            offset = np.concatenate((offset[-1:], offsets.take(start + 1, stop + 1)))
            first, last = int(offset[0]), int(offset[-1])
            stream = replace(
                empty,
                time_ns=times.take(start, stop),
                row_offset=offset - first,
                scan={c: column.take(start, stop) for c, column in scan.items()},
                rows={c: column.take(first, last) for c, column in rows.items()},
            )
            check_stream(stream, self.setup.sensors, name, self.path, previous)
            previous = int(stream.time_ns[-1])
            yield from stream.scans(name)
        for column in (times, offsets, *scan.values(), *rows.values()):
            column.verify()

    def recording(self) -> Recording | None:
        """The whole recording, truth included, where it was asked to be kept."""
        if not self._keep:
            return None
        record = layout.from_tree(self._reader.read(list(self._reader.leaves)), self.path)
        assert isinstance(record, Recording)
        return record

    def close(self) -> None:
        """Close the file."""
        self._reader.file.close()

"""Reading HDF5 files, whole or scan by scan: attributes verified at once, datasets when read."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from heapq import merge
from pathlib import Path
from typing import IO, Any

import h5py
import numpy as np

from ..models.checks import check, check_stream
from ..models.errors import FormatError
from ..models.records import Estimates, Recording, Scan, Stream
from . import layout
from . import tree as trees
from .tree import ArrayToken, Tree

WINDOW = 1024
"""Scans that are read at once."""

_ROOT = {"Conventions", "format_version", "content_digest", "observed_digest"}
_MAX_DEPTH, _MAX_LEAVES, _MAX_RATIO = 8, 100_000, 1100
_ERRORS = (OSError, KeyError, RuntimeError, ValueError, TypeError, OverflowError)


class TreeReader:
    """An open file: its leaves by path, its tokens, and verified reading of each."""

    def __init__(self, source: Path | IO[bytes], path: object) -> None:
        self.path = path
        try:
            _check_end(source, path)
            self.file = h5py.File(source, "r")
            try:
                self.leaves = self._walk(self.file, "", 0)
                self.header = {k: self.leaves.pop(k) for k in _ROOT}
                self.tokens: dict[str, str] = json.loads(self._value("tokens"))
                del self.leaves["tokens"]
                self._verify_header()
            except BaseException:
                self.file.close()
                raise
        except _ERRORS as error:
            raise FormatError(path, "", _one_line(error)) from error

    def _walk(self, group: h5py.Group, prefix: str, depth: int) -> dict[str, Any]:
        """All leaves below ``group``: values of attributes, datasets still unread."""
        if depth > _MAX_DEPTH:
            raise FormatError(self.path, prefix, "groups nested too deeply")
        leaves: dict[str, Any] = {prefix + k: _scalar(v) for k, v in group.attrs.items()}
        for name in group:
            path = prefix + name
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                raise FormatError(self.path, path, "soft and external links are refused")
            item = group[name]
            if isinstance(item, h5py.Group):
                leaves |= self._walk(item, path + "/", depth + 1)
            elif isinstance(item, h5py.Dataset):
                leaves[path] = item
            else:
                raise FormatError(self.path, path, "neither group nor dataset")
            if len(leaves) > _MAX_LEAVES:
                raise FormatError(self.path, path, f"more than {_MAX_LEAVES} datasets")
        return leaves

    def _verify_header(self) -> None:
        version = self.header["format_version"]
        if version != layout.FORMAT_VERSION:
            raise FormatError(self.path, "format_version", f"{version} is not known here")
        if trees.digest(self.tokens) != self.header["content_digest"]:
            raise FormatError(self.path, "content_digest", "does not fit the content")
        if set(self.tokens) != set(self.leaves):
            odd = sorted(set(self.tokens) ^ set(self.leaves))[0]
            raise FormatError(self.path, odd, "missing, or not part of the content")
        for path, leaf in self.leaves.items():
            if isinstance(leaf, h5py.Dataset):
                self._verify_dataset(path, leaf)
            else:
                self.verify(path, trees.token(leaf))

    def _verify_dataset(self, path: str, data: h5py.Dataset) -> None:
        """Refuse types, links to other files, sizes and attributes that we never write."""
        kind = data.dtype.kind
        if kind not in "iufS" or data.ndim > 4 or data.is_virtual or data.external:
            raise FormatError(self.path, path, f"type {data.dtype} is not expected")
        if kind != "S" and dict(data.attrs) != layout.attributes(path):
            raise FormatError(self.path, path, "units or other attributes are not the expected")
        stored = data.id.get_storage_size()
        if data.nbytes > _MAX_RATIO * stored + (1 << 20):
            raise FormatError(self.path, path, f"declares {data.nbytes} bytes but stores {stored}")

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
            except _ERRORS as error:
                raise FormatError(self.path, path, _one_line(error)) from error
            self.verify(path, trees.token(leaves[path]))
        return trees.unflatten(leaves)


def _check_end(source: Path | IO[bytes], path: object) -> None:
    """Refuse bytes after the end that the superblock (version 0) states."""
    if isinstance(source, Path):
        with source.open("rb") as file:
            _check_end(file, path)
        return
    head = source.read(48)
    size = source.seek(0, 2)
    source.seek(0)
    if len(head) == 48 and head[8] == 0 and int.from_bytes(head[40:48], "little") < size:
        raise FormatError(path, f"byte {int.from_bytes(head[40:48], 'little')}", "data after end")


def _scalar(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split()) or type(error).__name__


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


def inspect(source: Path | IO[bytes], path: object) -> dict[str, Any]:
    """Digests, attributes and the shapes of all datasets, without reading the data."""
    reader = TreeReader(source, path)
    try:
        small = [p for p, v in reader.leaves.items() if getattr(v, "ndim", 0) == 0]
        shapes = {p: v.shape for p, v in reader.leaves.items() if getattr(v, "ndim", 0)}
        return {**reader.header, **trees.flatten(reader.read(small)), "shapes": shapes}
    finally:
        reader.file.close()


class Source:
    """A recording that is read scan by scan in windows."""

    def __init__(self, source: Path | IO[bytes], path: object, keep: bool = False) -> None:
        self._reader = TreeReader(source, path)
        self._keep = keep
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
        yield from merge(*streams, key=lambda scan: (scan.time_ns, scan.stream))

    def _stream(self, name: str, empty: Stream) -> Iterator[Scan]:
        top = f"streams/{name}"
        per_scan = {c: f"{top}/scan/{c}" for c in empty.scan}
        per_row = {c: f"{top}/rows/{c}" for c in empty.rows}
        times, offsets = f"{top}/time_ns", f"{top}/row_offset"
        tokens = {p: ArrayToken() for p in (times, offsets, *per_scan.values(), *per_row.values())}

        def part(path: str, start: int, stop: int) -> Any:
            try:
                values = self._data(path)[start:stop]
            except _ERRORS as error:
                raise FormatError(self.path, path, _one_line(error)) from error
            tokens[path].update(values)
            return values

        for path in tokens:
            part(path, 0, 0)
        previous = None
        offset = part(offsets, 0, 1)
        for start in range(0, len(self._data(times)), WINDOW):
            stop = start + WINDOW
            offset = np.concatenate((offset[-1:], part(offsets, start + 1, stop + 1)))
            rows = int(offset[0]), int(offset[-1])
            stream = replace(
                empty,
                time_ns=part(times, start, stop),
                row_offset=offset - rows[0],
                scan={c: part(p, start, stop) for c, p in per_scan.items()},
                rows={c: part(p, *rows) for c, p in per_row.items()},
            )
            check_stream(stream, self.setup.sensors, name, self.path, previous)
            previous = int(stream.time_ns[-1])
            yield from stream.scans(name)
        for path, token in tokens.items():
            self._reader.verify(path, token)

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

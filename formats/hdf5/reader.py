"""The leaves of HDF5 files, read within bounds that a file cannot set itself.

Attributes are verified when the file is opened, datasets when they are read.
"""

from __future__ import annotations

import json
import zlib
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import IO, Any

import h5py
import numpy as np

from ...models.errors import FormatError
from .. import leaves
from ..damage import damage
from ..foreign import hint
from ..leaves import ArrayDigest, Leaf

HEADER = ("Conventions", "format_version", "content_digest", "observed_digest")
_MAX_DEPTH, _MAX_NODES, _MAX_TEXT = 8, 20_000, 1 << 24
_MAX_CHUNK, _LARGE = 1 << 26, 1 << 18
"""Bytes of a chunk, which is read whole; and stored ones from which on it is looked into before,
as the library inflates it to whatever is in it, 1032 times what is stored."""
_ALLOWANCE, _RATIO = 1 << 28, 64
"""Bytes that a file may declare, and how many more for each that it has."""
_CHECKSUM = 4
_FILTERS = {h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32}


class LeafReader:
    """An open file: its leaves by path, their digests, and verified reading of each."""

    def __init__(self, source: Path | IO[bytes], path: object) -> None:
        self.path = path
        self.leaves: dict[str, Any] = {}
        self._nodes = self._bytes = 0
        with damage(path, "superblock"):
            if not isinstance(source, Path) and not source.seekable():
                source = BytesIO(source.read())
            self._size = checked_size(source, path)
            self.file = h5py.File(source, "r")
        self._place = "/"
        try:
            with damage(path, lambda: self._place):
                if not any(name in self.file.attrs for name in HEADER):
                    raise FormatError(path, "/", foreign(HEADER[0], path))
                self._walk(self.file, "", 0)
                self._place = "/"
                absent = [name for name in (*HEADER, "tokens") if name not in self.leaves]
                if absent:
                    raise FormatError(path, "/", foreign(absent[0], path))
                self.header = {k: self.leaves.pop(k) for k in HEADER}
                self.digests: dict[str, str] = json.loads(self._value("tokens"))
                del self.leaves["tokens"]
                self._verify_header()
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
            if group.id.links.get_info(name.encode()).type != h5py.h5l.TYPE_HARD:
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
        if data.is_virtual or data.external:
            way = "a virtual dataset: its" if data.is_virtual else "an external dataset: its"
            raise FormatError(self.path, path, f"{way} values stand in other files, none is read")
        if kind not in "biufS" or data.ndim > 4:
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
        for name, value in leaves.header(self.digests).items():
            verify_header(self.path, name, self.header[name], value)
        if set(self.digests) != set(self.leaves):
            odd = sorted(set(self.digests) ^ set(self.leaves))[0]
            raise FormatError(self.path, odd[:200], "missing, or not part of the content")
        for path, leaf in self.leaves.items():
            self._place = path
            if not isinstance(leaf, h5py.Dataset):
                self.verify(path, leaves.digest_of(leaf))
            elif leaf.dtype.kind != "S" and not leaves.states(path, _attributes(leaf)):
                raise FormatError(self.path, path, "units or other attributes are not the expected")

    def verify(self, path: str, digest: object) -> None:
        """Refuse a leaf whose digest is not the stored one."""
        if str(digest) != self.digests[path]:
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

    def read(self, paths: list[str]) -> dict[str, Leaf]:
        """The verified leaves at ``paths``."""
        found = {}
        for path in paths:
            with damage(self.path, path):
                found[path] = self._value(path)
            self.verify(path, leaves.digest_of(found[path]))
        return found


def foreign(absent: str, path: object) -> str:
    """What is said of a file without what all of ours have, and what may read it."""
    end = hint(path) or " (logs of others: convert --from)"
    return f"not a file of echoset: {absent} is missing{end}"


def verify_header(path: object, name: str, stated: object, value: object) -> None:
    """Refuse what a file states of itself unless it is the ``value`` that its leaves give."""
    if stated == value:
        return
    if name == "format_version":
        raise FormatError(path, name, f"{stated} is not known here")
    if name.endswith("_digest"):
        raise FormatError(path, name, "does not fit the content")
    raise FormatError(path, name, f"is {str(stated)[:80]}, not {value}")


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
    data = np.empty((), stored.dtype)
    stored.read(data)
    value = data.item()
    return value.decode() if isinstance(value, bytes) else value


class Column:
    """A dataset that is read in parts, in order, and verified once all of it was."""

    def __init__(self, reader: LeafReader, path: str) -> None:
        self._reader, self._path = reader, path
        self._data = reader.leaves[path]
        self._digest = ArrayDigest()
        self._digest.update(np.zeros((0, *self._data.shape[1:]), self._data.dtype))

    def __len__(self) -> int:
        return len(self._data)

    def take(self, start: int, stop: int) -> Any:
        """The rows ``start:stop``, which follow those taken before."""
        with damage(self._reader.path, self._path):
            values = self._data[start:stop]
        if len(values) != stop - start:
            raise FormatError(self._reader.path, self._path, f"ends before row {stop}")
        self._digest.update(values)
        return values

    def whole(self) -> Any:
        """All rows, verified."""
        values = self.take(0, len(self))
        self.verify()
        return values

    def verify(self) -> None:
        """Refuse the column unless what was taken is all of what was written."""
        self._reader.verify(self._path, self._digest)

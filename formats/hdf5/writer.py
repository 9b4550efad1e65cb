"""HDF5: the random-access archive. Groups and datasets follow the paths of the leaves.

Strings and numbers are attributes (long strings and tuples of strings fixed-length datasets),
arrays are chunked datasets with gzip, shuffle and fletcher32 and CF ``units``. The digests of all
leaves stand in ``/tokens``, those of the whole in attributes of the root.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import h5py
import numpy as np

from ...models.records import Estimates, Meta, Recording
from .. import leaves
from ..leaves import ArrayDigest, Leaf
from ..windows import WINDOW, Blocks
from .fallback import SpilledFile
from .packed import PackedColumn

SUMMARY = "HDF5, random access and archive"
SUFFIXES = (".h5", ".hdf5")
MAGIC = b"\x89HDF\r\n\x1a\n"
_CHUNK_BYTES = 1 << 16
_LONG_TEXT = 1024


class LeafWriter:
    """Puts leaves into an open file and keeps their digests."""

    def __init__(self, target: Path | IO[bytes]) -> None:
        self._disk = SpilledFile(target) if isinstance(target, Path) else None
        self.file = h5py.File(self._disk or target, "w")
        self.digests: dict[str, str | ArrayDigest] = {}
        self._packed: dict[str, PackedColumn] = {}

    def put(self, path: str, leaf: Leaf) -> None:
        if isinstance(leaf, np.ndarray):
            self.extend(path, leaf)
            return
        self.digests[path] = leaves.digest_of(leaf)
        group, _, name = path.rpartition("/")
        if isinstance(leaf, tuple):
            self.file[path] = np.array([text.encode() for text in leaf])
        elif isinstance(leaf, str) and (len(leaf) > _LONG_TEXT or name == "provenance"):
            self.file[path] = np.bytes_(leaf.encode())
        else:
            _attribute(self.file.require_group(group or "/"), name, leaf)

    def extend(self, path: str, part: np.ndarray[Any, Any]) -> None:
        """Append ``part`` to the dataset at ``path``, a ``row_offset`` shifted to fit."""
        if self._disk:
            self._disk.check()
        if path not in self.digests:
            size = part.itemsize * int(np.prod(part.shape[1:]))
            rows = max(1, _CHUNK_BYTES // max(1, size))
            data = self.file.create_dataset(
                path,
                (0, *part.shape[1:]),
                part.dtype,
                maxshape=(None, *(n or None for n in part.shape[1:])),
                chunks=(rows, *(max(1, n) for n in part.shape[1:])),
                compression="gzip",
                shuffle=True,
                fletcher32=True,
            )
            for name, text in leaves.attributes(path).items():
                _attribute(data, name, text)
            self.digests[path] = ArrayDigest()
            if "/rows/" in path and part.dtype == np.float64 and part.ndim == 1:
                self._packed[path] = PackedColumn(data)
        else:
            data = self.file[path]
            if path.endswith("row_offset"):
                part = part[1:] + data[-1]
        digest = self.digests[path]
        assert isinstance(digest, ArrayDigest)
        digest.update(part)
        if path in self._packed:
            self._packed[path].add(part)
            return
        start = len(data)
        data.resize(start + len(part), axis=0)
        data[start:] = part
        # Space in the file is given out as chunks leave memory: here, not whenever the last
        # reference to the dataset goes, which a profiler's look at this frame may hold back.
        data.flush()

    def close(self) -> None:
        """Write the digests; the file is complete after this and only after this."""
        for column in self._packed.values():
            column.close()
        digests = {path: str(digest) for path, digest in sorted(self.digests.items())}
        self.file["tokens"] = np.bytes_(json.dumps(digests).encode())
        for name, value in leaves.header(digests).items():
            _attribute(self.file, name, value)
        self.abort()

    def abort(self) -> None:
        """Close the file as it is."""
        self.file.close()
        if self._disk:
            self._disk.close()


def _attribute(item: h5py.Group | h5py.Dataset, name: str, value: Any) -> None:
    """Set an attribute; texts have a fixed length, as those of any length stand in a heap, in
    whose damage the library gets lost.
    """
    if isinstance(value, str):
        data = value.encode()
        item.attrs.create(name, data, dtype=h5py.string_dtype("utf-8", max(1, len(data))))
    else:
        item.attrs[name] = value


class Writer:
    """Writes a record window by window of time; of estimates :data:`WINDOW` steps at once."""

    def __init__(self, target: Path | IO[bytes]) -> None:
        self._out = LeafWriter(target)
        self._blocks = Blocks(WINDOW)
        self._single = True

    def append(self, window: Recording | Estimates) -> None:
        """Take the next scans and truth, or steps; sensors and models are those of the first."""
        if isinstance(window, Recording):
            own = leaves.of(window)
            self._put({path: leaf for path, leaf in own.items() if path != "provenance"})
            return
        self._single = False
        for block in self._blocks.add(window):
            self._put(_steps(block))

    def _put(self, own: dict[str, Leaf]) -> None:
        for path, leaf in own.items():
            if leaves.grows(path) and isinstance(leaf, np.ndarray):
                self._out.extend(path, leaf)
            elif path not in self._out.digests:
                self._out.put(path, leaf)

    def close(self, meta: Meta, recording: Recording | None = None) -> None:
        """Finish the file with its ``meta`` and the recording that travels along, if any."""
        try:
            rest: dict[str, Leaf] = {"provenance": leaves.json_of(meta.provenance)}
            if not self._single:
                last = replace(self._blocks.rest(), meta=meta, recording=recording)
                self._put(own := _steps(last))
                rest = {path: leaf for path, leaf in leaves.of(last).items() if path not in own}
            for path, leaf in rest.items():
                self._out.put(path, leaf)
            self._out.close()
        finally:
            self.abort()

    def abort(self) -> None:
        """Close the file as it is."""
        self._out.abort()


def _steps(estimates: Estimates) -> dict[str, Leaf]:
    """The leaves that steps have, without those of the record."""
    own = leaves.of(replace(estimates, recording=None))
    return {path: leaf for path, leaf in own.items() if path.startswith(("objects/", "steps/"))}

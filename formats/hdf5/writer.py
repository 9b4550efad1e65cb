"""HDF5: the random-access archive. Groups and datasets follow the tree of :mod:`.layout`.

Strings and numbers are attributes (long strings and tuples of strings fixed-length datasets),
arrays are chunked datasets with gzip, shuffle and fletcher32 and CF ``units``. Tokens of all
leaves stand in ``/tokens``, their digests in attributes of the root.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import h5py
import numpy as np

from ...models.records import Estimates, Meta, Recording
from .. import layout
from .. import tree as trees
from ..steps import WINDOW, Blocks, windows
from ..tree import ArrayToken, Leaf
from .fallback import SpilledFile
from .header import header
from .reader import Source, read, summary
from .windows import Windows

__all__ = [
    "EstimatesWriter",
    "Windows",
    "RecordingWriter",
    "Source",
    "TreeWriter",
    "summary",
    "read",
    "header",
    "write",
]

SUMMARY = "HDF5, random access and archive"
SUFFIXES = (".h5", ".hdf5")
MAGIC = b"\x89HDF\r\n\x1a\n"
_CHUNK_BYTES = 1 << 16
_LONG_TEXT = 1024


class TreeWriter:
    """Puts leaves into an open file and keeps their tokens."""

    def __init__(self, target: Path | IO[bytes]) -> None:
        self._disk = SpilledFile(target) if isinstance(target, Path) else None
        self.file = h5py.File(self._disk or target, "w")
        self.tokens: dict[str, str | ArrayToken] = {}

    def put(self, path: str, leaf: Leaf) -> None:
        if isinstance(leaf, np.ndarray):
            self.extend(path, leaf)
            return
        self.tokens[path] = trees.token(leaf)
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
        if path not in self.tokens:
            size = part.itemsize * int(np.prod(part.shape[1:]))
            rows = max(1, _CHUNK_BYTES // max(1, size))
            data = self.file.create_dataset(
                path,
                (0, *part.shape[1:]),
                part.dtype,
                maxshape=(None, *part.shape[1:]),
                chunks=(rows, *(max(1, n) for n in part.shape[1:])),
                compression="gzip",
                shuffle=True,
                fletcher32=True,
            )
            for name, text in layout.attributes(path).items():
                _attribute(data, name, text)
            self.tokens[path] = ArrayToken()
        else:
            data = self.file[path]
            if path.endswith("row_offset"):
                part = part[1:] + data[-1]
        token = self.tokens[path]
        assert isinstance(token, ArrayToken)
        token.update(part)
        start = len(data)
        data.resize(start + len(part), axis=0)
        data[start:] = part
        # Space in the file is given out as chunks leave memory: here, not whenever the last
        # reference to the dataset goes, which a profiler's look at this frame may hold back.
        data.flush()

    def close(self) -> None:
        """Write tokens and digests; the file is complete after this and only after this."""
        tokens = {path: str(token) for path, token in sorted(self.tokens.items())}
        self.file["tokens"] = np.bytes_(json.dumps(tokens).encode())
        header = {
            "Conventions": layout.CONVENTIONS,
            "format_version": layout.FORMAT_VERSION,
            "content_digest": trees.digest(tokens),
            "observed_digest": trees.observed_digest(tokens),
        }
        for name, value in header.items():
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


def write(record: Recording | Estimates, target: Path | IO[bytes]) -> None:
    """Write ``record`` whole."""
    writer: EstimatesWriter | RecordingWriter
    if isinstance(record, Estimates):
        writer = EstimatesWriter(target)
        try:
            writer.append(record)
            writer.close(record.meta, record.recording)
        finally:
            writer.abort()
        return
    writer = RecordingWriter(target)
    try:
        for window in windows(record):
            writer.append(window)
        writer.close(record.meta)
    finally:
        writer.abort()


class RecordingWriter:
    """Writes a recording window by window of time."""

    def __init__(self, target: Path | IO[bytes]) -> None:
        self._out = TreeWriter(target)

    def append(self, window: Recording) -> None:
        """Take the next scans and truth; sensors and models are those of the first window."""
        for path, leaf in trees.flatten(layout.to_tree(window)).items():
            if layout.grows(path) and isinstance(leaf, np.ndarray):
                self._out.extend(path, leaf)
            elif path not in self._out.tokens and path != "provenance":
                self._out.put(path, leaf)

    def close(self, meta: Meta) -> None:
        """Finish the file with its ``meta``."""
        try:
            self._out.put("provenance", layout.provenance(meta))
            self._out.close()
        finally:
            self.abort()

    def abort(self) -> None:
        """Close the file as it is."""
        self._out.abort()


class EstimatesWriter:
    """Writes estimates step by step, in windows of :data:`WINDOW` steps."""

    def __init__(self, target: Path | IO[bytes]) -> None:
        self._out = TreeWriter(target)
        self._blocks = Blocks(WINDOW)

    def append(self, estimates: Estimates) -> None:
        """Take the next steps."""
        for window in self._blocks.add(estimates):
            self._flush(window)

    def _flush(self, window: Estimates) -> None:
        tree = layout.to_tree(replace(window, recording=None))
        for path, leaf in trees.flatten({k: tree[k] for k in ("objects", "steps")}).items():
            if isinstance(leaf, np.ndarray):
                self._out.extend(path, leaf)
            elif path not in self._out.tokens:
                self._out.put(path, leaf)

    def close(self, meta: Meta, recording: Recording | None = None) -> None:
        """Finish the file with its ``meta`` and the recording that travels along, if any."""
        try:
            rest = self._blocks.rest()
            self._flush(rest)
            tree = layout.to_tree(replace(rest, meta=meta, recording=recording))
            del tree["objects"], tree["steps"]
            for path, leaf in trees.flatten(tree).items():
                self._out.put(path, leaf)
            self._out.close()
        finally:
            self.abort()

    def abort(self) -> None:
        """Close the file as it is."""
        self._out.abort()

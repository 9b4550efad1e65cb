"""Reading HDF5 files in windows of time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import h5py
import numpy as np

from ...models.checks import WindowChecks, check
from ...models.errors import FormatError
from ...models.records import Array, Estimates, Meta, Recording
from ...models.where import Where
from .. import leaves
from ..windows import span, spans
from .reader import Column, LeafReader


class Windows:
    """A record that is read in windows of time, or with ``recording`` that beside estimates.

    ``head`` is the record without steps or scans.
    """

    def __init__(
        self,
        source: Path | IO[bytes],
        path: object,
        recording: bool = False,
        size: int | None = None,
    ) -> None:
        self.path, self._size, self._done = path, size, 0
        self._reader = LeafReader(source, path)
        try:
            self._top = "recording/" * recording
            self.has_recording = any(p.startswith("recording/") for p in self._reader.leaves)
            if recording and not self.has_recording:
                raise FormatError(path, "recording", "holds no recording beside estimates")
            own = [p for p in self._reader.leaves if p.startswith("recording/") == recording]
            grow = {p for p in own if leaves.grows(p) and self._is_array(p)}
            self._small = self._reader.read([p for p in own if p not in grow])
            self._empty = {p: self._none(p) for p in own if p in grow}
            self.head = self._record({})
            check(self.head, path)
            self.unit = "scan" if isinstance(self.head, Recording) else "step"
            self._columns = {p: Column(self._reader, p) for p in own if p in grow}
        except BaseException:
            self.close()
            raise

    def _is_array(self, path: str) -> bool:
        leaf = self._reader.leaves[path]
        return isinstance(leaf, h5py.Dataset) and leaf.dtype.kind != "S" and leaf.ndim > 0

    def _none(self, path: str) -> Array:
        data = self._reader.leaves[path]
        if path.endswith("/row_offset"):
            return np.zeros(1, np.int64)
        return np.zeros((0, *data.shape[1:]), data.dtype)

    def _record(self, window: dict[str, Any]) -> Recording | Estimates:
        found = {**self._small, **self._empty, **window}
        return leaves.record({p[len(self._top) :]: leaf for p, leaf in found.items()}, self.path)

    @property
    def meta(self) -> Meta:
        """What the record is called and where it comes from."""
        return self.head.meta

    @property
    def digests(self) -> dict[str, str]:
        """The digests of all leaves by path."""
        return self._reader.digests

    @property
    def progress(self) -> tuple[int, int]:
        """Scans and times of truth, or steps, that were read, and that there are."""
        times = (column for path, column in self._columns.items() if path.endswith("/time_ns"))
        return self._done, sum(map(len, times))

    def _index(self, name: str) -> dict[str, Array]:
        """The columns called ``name`` by their table, read whole."""
        own = {p: column for p, column in self._columns.items() if p.endswith(f"/{name}")}
        found = {leaves.table(p): column.whole() for p, column in own.items()}
        for table, values in found.items():
            at = Where(self.path, table) / name
            at.increasing(at.array(values, "i8", (len(values),)), strictly=False)
        return found

    def __iter__(self) -> Iterator[Recording | Estimates]:
        """The windows in order, verified by the time the last is out."""
        times, offsets = self._index("time_ns"), self._index("row_offset")
        for table, offset in offsets.items():
            at = Where(self.path, table) / "row_offset"
            at.array(offset, "i8", (len(times[table]) + 1,))
        rest = {
            p: c for p, c in self._columns.items() if not p.endswith(("/time_ns", "/row_offset"))
        }
        checks = WindowChecks(self.path)
        for first, last in spans(times.values(), self._size):
            window: dict[str, Any] = {}
            inside = {table: span(t, first, last) for table, t in times.items()}
            for table, (start, stop) in inside.items():
                window[f"{table}/time_ns"] = times[table][start:stop]
                if table in offsets:
                    offset = offsets[table][start : stop + 1]
                    window[f"{table}/row_offset"] = offset - offset[0]
            for path, column in rest.items():
                start, stop = inside[leaves.table(path)]
                if leaves.per_row(path):
                    start, stop = offsets[leaves.table(path)][[start, stop]].tolist()
                window[path] = column.take(start, stop)
            record = self._record(window)
            checks.check(record)
            yield record
            self._done += sum(stop - start for start, stop in inside.values())
        for column in rest.values():
            column.verify()

    def close(self) -> None:
        """Close the file."""
        self._reader.file.close()

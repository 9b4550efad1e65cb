"""Reading HDF5 files in windows of time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import h5py
import numpy as np

from ...models.checks import check
from ...models.errors import FormatError
from ...models.place import Place
from ...models.records import Estimates, Recording
from .. import layout
from .. import tree as trees
from ..steps import spans
from ..watch import Watch
from .reader import Column, TreeReader


class Windows:
    """A record that is read in windows of time; ``carried``: the recording beside estimates.

    ``head`` is the record without steps or scans. Without ``scans`` the streams stay empty.
    """

    unit = "step"

    def __init__(
        self, source: Path | IO[bytes], path: object, carried: bool = False, scans: bool = True
    ) -> None:
        self.path, self._done = path, 0
        self._reader = TreeReader(source, path)
        try:
            self._top = "recording/" if carried else ""
            self.carries = any(p.startswith("recording/") for p in self._reader.leaves)
            if carried and not self.carries:
                raise FormatError(path, "recording", "holds no recording beside estimates")
            own = [p for p in self._reader.leaves if p.startswith("recording/") == carried]
            grows = [p for p in own if layout.grows(p) and self._is_array(p)]
            self._read = [p for p in grows if scans or not p.startswith(f"{self._top}streams/")]
            self._small = self._reader.read([p for p in own if p not in set(grows)])
            self._empty = {p: self._none(p) for p in grows}
            self.head = self._record({})
            check(self.head, path)
        except BaseException:
            self.close()
            raise

    def _is_array(self, path: str) -> bool:
        leaf = self._reader.leaves[path]
        return isinstance(leaf, h5py.Dataset) and leaf.dtype.kind != "S"

    def _none(self, path: str) -> Any:
        data = self._reader.leaves[path]
        if path.endswith("/row_offset"):
            return np.zeros(1, np.int64)
        return np.zeros((0, *data.shape[1:]), data.dtype)

    def _record(self, leaves: dict[str, Any]) -> Recording | Estimates:
        tree = trees.unflatten({**trees.flatten(self._small), **self._empty, **leaves})
        return layout.from_tree(tree["recording"] if self._top else tree, self.path)

    @property
    def progress(self) -> tuple[int, int]:
        """Scans and times of truth, or steps, that were read, and that there are."""
        return self._done, sum(len(v) for v in self._times().values())

    def _times(self) -> dict[str, Any]:
        paths = (p for p in self._read if p.endswith("/time_ns"))
        return {layout.table(p): self._reader.leaves[p] for p in paths}

    def __iter__(self) -> Iterator[Recording | Estimates]:
        """The windows in order, verified by the time the last is out."""
        columns = {path: Column(self._reader, path) for path in self._read}
        times = {table: Column(self._reader, f"{table}/time_ns").whole() for table in self._times()}
        offsets = {
            table: Column(self._reader, f"{table}/row_offset").whole()
            for table in times
            if f"{table}/row_offset" in columns
        }
        for table, time in times.items():
            at = Place(self.path, table)
            (at / "time_ns").increasing(time, strictly=False)
            if table in offsets:
                (at / "row_offset").array(offsets[table], "i8", (len(time) + 1,))
                (at / "row_offset").increasing(offsets[table], strictly=False)
        watch = Watch(self.path)
        for first, last in spans(times.values()):
            leaves = {}
            for path, column in columns.items():
                table = layout.table(path)
                start, stop = np.searchsorted(times[table], (first, last)).tolist()
                if layout.per_row(path):
                    start, stop = offsets[table][[start, stop]].tolist()
                if path.endswith("/row_offset"):
                    offset = column.take(start + 1 if start else 0, stop + 1)
                    base = offsets[table][start]
                    leaves[path] = (np.append(base, offset) if start else offset) - base
                else:
                    leaves[path] = column.take(start, stop)
            record = self._record(leaves)
            watch.check(record)
            yield record
            self._done += sum(len(leaves[f"{table}/time_ns"]) for table in times)
        for column in columns.values():
            column.verify()

    def close(self) -> None:
        """Close the file."""
        self._reader.file.close()

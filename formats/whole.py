"""Windows of time for formats that read and write only whole records."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO

import numpy as np

from ..models.errors import FormatError
from ..models.records import Estimates, Meta, Objects, Recording, Stream, Truth
from .steps import part, spans, windows


class WholeWindows:
    """The windows of ``record``; ``carried``: of the recording beside estimates.

    ``head`` is the record without steps or scans. Without ``scans`` the streams stay empty.
    """

    unit = "step"

    def __init__(
        self, record: Recording | Estimates, path: object, carried: bool, scans: bool = True
    ) -> None:
        self._done = 0
        beside = record.recording if isinstance(record, Estimates) else None
        self.carries = beside is not None
        if carried:
            if beside is None:
                raise FormatError(path, "recording", "holds no recording beside estimates")
            record = beside
        self._record: Recording | Estimates
        self.head: Recording | Estimates
        if isinstance(record, Estimates):
            self._record = replace(record, recording=None)
            self.head = part(self._record, 0, 0)
            return
        empty = {name: s.part(0, 0) for name, s in record.streams.items()}
        self._record = record if scans else replace(record, streams=empty)
        truth = None if record.truth is None else Truth(record.truth.objects.part(0, 0))
        self.head = replace(record, streams=empty, truth=truth)

    @property
    def progress(self) -> tuple[int, int]:
        """Scans and times of truth, or steps, that are out, and that there are."""
        return self._done, _length(self._record)

    def __iter__(self) -> Iterator[Recording | Estimates]:
        """The windows in order."""
        whole = self._record
        for window in windows(whole) if isinstance(whole, Recording) else _of_steps(whole):
            yield window
            self._done += _length(window)

    def close(self) -> None:
        """Nothing is open."""


class WholeWriter:
    """Gathers the windows of a recording, and has ``write`` put it whole into ``target``."""

    def __init__(
        self, write: Callable[[Recording, Path | IO[bytes]], None], target: Path | IO[bytes]
    ) -> None:
        self._write, self._target = write, target
        self._windows: list[Recording] = []

    def append(self, window: Recording) -> None:
        """Take the next scans and truth; sensors and models are those of the first window."""
        self._windows.append(window)

    def close(self, meta: Meta) -> None:
        """Write the file with its ``meta``."""
        first = self._windows[0]
        streams = {
            name: _joined([w.streams[name] for w in self._windows]) for name in first.streams
        }
        truths = [w.truth for w in self._windows if w.truth is not None]
        truth = None
        if truths:
            links = ("blocked_time_ns", "blocked_tx", "blocked_rx")
            columns = (np.concatenate([getattr(t, name) for t in truths]) for name in links)
            truth = Truth(Objects.join([t.objects for t in truths]), *columns)
        self._write(Recording(meta, first.sensors, streams, truth), self._target)

    def abort(self) -> None:
        """Nothing is open."""


def _of_steps(whole: Estimates) -> Iterator[Estimates]:
    time = whole.objects.time_ns
    for span in spans([time]):
        yield part(whole, *np.searchsorted(time, span).tolist())


def _length(record: Recording | Estimates) -> int:
    if isinstance(record, Estimates):
        return len(record.objects.time_ns)
    times = [s.time_ns for s in record.streams.values()]
    if record.truth is not None:
        times += [record.truth.objects.time_ns, record.truth.blocked_time_ns]
    return sum(map(len, times))


def _joined(parts: list[Stream]) -> Stream:
    """Consecutive scans of one stream as one."""
    first = parts[0]
    counts = np.concatenate([np.diff(p.row_offset) for p in parts])
    return replace(
        first,
        time_ns=np.concatenate([p.time_ns for p in parts]),
        row_offset=np.append(np.int64(0), np.cumsum(counts)),
        scan={key: np.concatenate([p.scan[key] for p in parts]) for key in first.scan},
        rows={key: np.concatenate([p.rows[key] for p in parts]) for key in first.rows},
    )

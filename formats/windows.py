"""Records in windows of consecutive steps, so that files grow and are read in blocks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TypeVar, cast

import numpy as np

from ..models.records import Array, Estimates, Objects, Recording, Stream, Truth

WINDOW = 1024
"""Scans or steps that are read or written at once."""
NONE = (0, -1)
"""First and last time of a window without any."""
Record = TypeVar("Record", bound=Recording | Estimates)


class Blocks:
    """Takes estimates of any number of steps, gives out windows of ``size`` steps."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._pending: list[Estimates] = []
        self._count = 0

    def add(self, estimates: Estimates) -> Iterator[Estimates]:
        """Take ``estimates`` and yield every window that is full."""
        self._pending.append(estimates)
        self._count += len(estimates.objects.time_ns)
        while self._count > self._size:
            whole = concatenate(self._pending)
            yield part(whole, 0, self._size)
            self._pending = [part(whole, self._size, self._count)]
            self._count -= self._size

    def rest(self) -> Estimates:
        """What has not been given out; at least one step, once anything was added."""
        return concatenate(self._pending)


def concatenate(parts: Sequence[Record]) -> Record:
    """Consecutive windows, one at least, as one record."""
    first = parts[0]
    if len(parts) == 1:
        return first
    if isinstance(first, Estimates):
        return cast(Record, _steps(cast(Sequence[Estimates], parts)))
    return cast(Record, _scans(cast(Sequence[Recording], parts)))


def _steps(parts: Sequence[Estimates]) -> Estimates:
    steps = {k: np.concatenate([p.steps[k] for p in parts]) for k in parts[0].steps}
    return replace(parts[0], objects=Objects.join([p.objects for p in parts]), steps=steps)


def _scans(parts: Sequence[Recording]) -> Recording:
    streams = {name: _joined([w.streams[name] for w in parts]) for name in parts[0].streams}
    truths = [w.truth for w in parts if w.truth is not None]
    truth = None
    if truths:
        links = ("blocked_time_ns", "blocked_tx", "blocked_rx")
        columns = (np.concatenate([getattr(t, name) for t in truths]) for name in links)
        truth = Truth(Objects.join([t.objects for t in truths]), *columns)
    return replace(parts[0], streams=streams, truth=truth)


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


def part(whole: Estimates, start: int, stop: int) -> Estimates:
    """The steps ``start:stop`` as a record of their own."""
    steps = {k: v[start:stop] for k, v in whole.steps.items()}
    return replace(whole, objects=whole.objects.part(start, stop), steps=steps)


def between(whole: Record, first: int, last: int) -> Record:
    """What ``whole`` holds of the times from ``first`` up to ``last`` [ns]."""

    def inside(time_ns: Array) -> tuple[int, int]:
        return span(time_ns, first, last)

    if isinstance(whole, Estimates):
        return cast(Record, part(whole, *inside(whole.objects.time_ns)))
    streams = {name: s.part(*inside(s.time_ns)) for name, s in whole.streams.items()}
    truth = whole.truth
    if truth is not None:
        b = slice(*inside(truth.blocked_time_ns))
        objects = truth.objects.part(*inside(truth.objects.time_ns))
        links = (truth.blocked_time_ns, truth.blocked_tx, truth.blocked_rx)
        truth = Truth(objects, *(column[b] for column in links))
    return cast(Record, replace(whole, streams=streams, truth=truth))


def span(time_ns: Array, first: int, last: int) -> tuple[int, int]:
    """Which of these times are from ``first`` up to ``last`` [ns]: start, and stop behind them."""
    return int(np.searchsorted(time_ns, first)), int(np.searchsorted(time_ns, last, "right"))


def times(record: Recording | Estimates) -> list[Array]:
    """The times of all tables of ``record``."""
    if isinstance(record, Estimates):
        return [record.objects.time_ns]
    found = [s.time_ns for s in record.streams.values()]
    if record.truth is not None:
        found += [record.truth.objects.time_ns, record.truth.blocked_time_ns]
    return found


def windows(whole: Record) -> Iterator[Record]:
    """The record in windows of time, one at least."""
    for first, last in spans(times(whole)):
        yield between(whole, first, last)


def spans(times: Iterable[Array], size: int | None = None) -> Iterator[tuple[int, int]]:
    """First and last time [ns] of windows of tables with these ``times``.

    A window ends as soon as it has ``size`` entries (:data:`WINDOW`), all those of one time in it.
    """
    size = size or WINDOW
    merged = np.sort(np.concatenate([np.zeros(0, np.int64), *times]))
    start = 0
    while start + size < len(merged):
        last = int(merged[start + size - 1])
        yield int(merged[start]), last
        start = int(np.searchsorted(merged, last, "right"))
    if start < len(merged) or not start:
        yield (int(merged[start]), int(merged[-1])) if len(merged) else NONE

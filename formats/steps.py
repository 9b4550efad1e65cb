"""Records in windows of consecutive steps, so that files grow and are read in blocks."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..models.records import Array, Estimates, Objects, Recording, Truth

WINDOW = 1024
"""Scans or steps that are read or written at once."""


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


def concatenate(parts: Sequence[Estimates]) -> Estimates:
    """Estimates of consecutive steps as one record."""
    if len(parts) == 1:
        return parts[0]
    steps = {k: np.concatenate([p.steps[k] for p in parts]) for k in parts[0].steps}
    return replace(parts[0], objects=Objects.join([p.objects for p in parts]), steps=steps)


def part(whole: Estimates, start: int, stop: int) -> Estimates:
    """The steps ``start:stop`` as a record of their own."""
    steps = {k: v[start:stop] for k, v in whole.steps.items()}
    return replace(whole, objects=whole.objects.part(start, stop), steps=steps)


def windows(whole: Recording) -> Iterator[Recording]:
    """The recording in windows of time, one at least."""
    truth = whole.truth
    times = [s.time_ns for s in whole.streams.values()]
    if truth is not None:
        times += [truth.objects.time_ns, truth.blocked_time_ns]
    for first, last in spans(times):
        streams = {
            name: s.part(*np.searchsorted(s.time_ns, (first, last)))
            for name, s in whole.streams.items()
        }
        window = replace(whole, streams=streams)
        if truth is not None:
            b = slice(*np.searchsorted(truth.blocked_time_ns, (first, last)))
            inside = np.searchsorted(truth.objects.time_ns, (first, last)).tolist()
            objects = truth.objects.part(*inside)
            links = (truth.blocked_time_ns, truth.blocked_tx, truth.blocked_rx)
            window = replace(window, truth=Truth(objects, *(column[b] for column in links)))
        yield window


def spans(times: Iterable[Array]) -> Iterator[tuple[int, int]]:
    """First time and the time behind the last [ns] of windows of tables with these ``times``.

    A window ends as soon as it has :data:`WINDOW` entries, all those of one time in it.
    """
    merged = np.sort(np.concatenate([np.zeros(0, np.int64), *times]))
    start = 0
    while start + WINDOW < len(merged):
        last = int(merged[start + WINDOW - 1])
        yield int(merged[start]), last + 1
        start = int(np.searchsorted(merged, last, "right"))
    if start < len(merged) or not start:
        yield (int(merged[start]), int(merged[-1]) + 1) if len(merged) else (0, 0)

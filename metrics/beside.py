"""The truth beside windows of estimates, from files that are read in windows of their own."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..models.records import Array, Estimates, Objects, Recording, Truth


class TruthWindow:
    """The recording ``head`` with the truth of ``windows`` around the steps that are asked for.

    That is all within ``gap`` [ns] of them, and the times before and after.
    """

    def __init__(self, head: Recording, windows: Iterator[Recording], gap: int) -> None:
        self._head, self._windows, self._gap = head, windows, gap
        truth = head.truth
        self._known: Objects | None = None if truth is None else truth.objects

    def around(self, time_ns: Array) -> Recording:
        """The recording around the times (n,) of steps, none of which is before those of before."""
        if self._known is None or not len(time_ns):
            return self._head
        first, last = int(time_ns[0]) - self._gap, int(time_ns[-1]) + self._gap
        parts = [self._known]
        while not len(parts[-1].time_ns) or parts[-1].time_ns[-1] <= last:
            window = next(self._windows, None)
            if window is None:
                break
            assert window.truth is not None
            if len(window.truth.objects.time_ns):
                parts.append(window.truth.objects)
        known = Objects.join([p for p in parts if len(p.time_ns)] or parts[:1])
        start = max(0, int(np.searchsorted(known.time_ns, first)) - 1)
        stop = int(np.searchsorted(known.time_ns, last, "right")) + 1
        self._known = known.part(start, len(known.time_ns))
        here = known.part(start, min(stop, len(known.time_ns)))
        return replace(self._head, truth=Truth(here))

    def rest(self) -> None:
        """Read the remaining windows, which verifies them."""
        deque(self._windows, maxlen=0)


def is_one_object(estimates: Estimates, recording: Recording) -> bool:
    """Whether truth and estimates hold exactly one object all the time."""
    sets = [estimates.objects, *([recording.truth.objects] if recording.truth else [])]
    return all((np.diff(o.row_offset) == 1).all() for o in sets)

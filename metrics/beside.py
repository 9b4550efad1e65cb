"""The truth beside windows of estimates, from files that are read in windows of their own."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..models.records import Array, Estimates, Objects, Recording, Truth
from .kit.alignment import HEAD


class TruthWindow:
    """The recording ``head`` with the truth of ``windows`` around the steps that are asked for.

    That is all within a gap of them, and the times before and after. ``start`` is the truth at so
    many first times as tell its rate, if there is a truth.
    """

    def __init__(self, head: Recording, windows: Iterator[Recording]) -> None:
        self._head, self._windows = head, windows
        self._known = None if head.truth is None else head.truth.objects
        self.start = None if self._known is None else self._read(HEAD, -(1 << 63))

    def around(self, time_ns: Array, gap: float) -> Recording:
        """The recording within ``gap`` [s] of the times (n,) of steps, later than those before."""
        if self._known is None or not len(time_ns):
            return self._head
        self.start = None
        reach = min(int(gap * 1e9) + 1, 1 << 60)
        first, last = int(time_ns[0]) - reach, int(time_ns[-1]) + reach
        known = self._read(1, last)
        start = max(0, int(np.searchsorted(known.time_ns, first)) - 1)
        stop = int(np.searchsorted(known.time_ns, last, "right")) + 1
        self._known = known.part(start, len(known.time_ns))
        here = known.part(start, min(stop, len(known.time_ns)))
        return replace(self._head, truth=Truth(here))

    def _read(self, times: int, last: int) -> Objects:
        """Read on until ``times`` times are known, and one behind ``last``; all that is known."""
        assert self._known is not None
        parts = [self._known]
        count = len(self._known.time_ns)
        while count < times or parts[-1].time_ns[-1] <= last:
            window = next(self._windows, None)
            if window is None:
                break
            assert window.truth is not None
            if len(window.truth.objects.time_ns):
                parts.append(window.truth.objects)
                count += len(parts[-1].time_ns)
        self._known = Objects.join([p for p in parts if len(p.time_ns)] or parts[:1])
        return self._known

    def rest(self) -> None:
        """Read the remaining windows, which verifies them."""
        deque(self._windows, maxlen=0)


def is_one_object(estimates: Estimates, recording: Recording) -> bool:
    """Whether truth and estimates hold exactly one object all the time."""
    sets = [estimates.objects, *([recording.truth.objects] if recording.truth else [])]
    return all((np.diff(o.row_offset) == 1).all() for o in sets)

"""Maps of stations that are not synchronous, collected in windows: one of a station at most.

A window begins with a map. It ends before the first map of a station that it has already, or that
comes later than ``within`` after its first; its maps then count as of their mean time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from ...models.records import Scan

STAMP = "map_time_ns"
"""The scan column that keeps the time at which a map was taken."""
SHARE = 0.9
"""The window without ``within``: this share of the shortest period of a station seen so far."""


def frames(scans: Iterable[Scan], streams: frozenset[str], within: float | None) -> Iterator[Scan]:
    """The ``scans`` in order of time, those of ``streams`` at the time of their window.

    ``within`` [s] is the length of a window; None: :data:`SHARE` of the shortest period.
    """
    waiting: list[Scan] = []
    last: dict[str, int] = {}
    first, have, period = 0, set[str](), None
    for scan in scans:
        is_map = scan.stream in streams
        limit = within * 1e9 if within is not None else SHARE * period if period else None
        late = have and limit is not None and scan.time_ns - first > limit
        if late or (is_map and scan.stream in have):
            yield from _closed(waiting, have)
            waiting, have = [], set()
        if is_map:
            if scan.stream in last and scan.time_ns > last[scan.stream]:
                gap = scan.time_ns - last[scan.stream]
                period = gap if period is None else min(period, gap)
            last[scan.stream] = scan.time_ns
            first = first if have else scan.time_ns
            have.add(scan.stream)
        if have:
            waiting.append(scan)
        else:
            yield scan
    yield from _closed(waiting, have)


def _closed(waiting: list[Scan], have: set[str]) -> Iterator[Scan]:
    """The scans of a window, its maps at their mean time."""
    times = [scan.time_ns for scan in waiting if scan.stream in have]
    if not times:
        return
    mean = times[0] + sum(t - times[0] for t in times) // len(times)
    moved = [
        replace(scan, time_ns=mean, scan={**scan.scan, STAMP: scan.time_ns})
        if scan.stream in have and scan.time_ns != mean
        else scan
        for scan in waiting
    ]
    yield from sorted(moved, key=lambda scan: scan.time_ns)

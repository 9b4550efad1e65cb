"""Scans at the times at which they were true, which is before their stamps where sensors are late.

Stamps of different sensors are late by different amounts, so that scans change places.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from heapq import heappop, heappush

from ...models.records import Scan
from .model.sensing import SensorParams


def true_times(scans: Iterable[Scan], params: Mapping[str, SensorParams]) -> Iterator[Scan]:
    """The ``scans``, in the order of their stamps, in that of when they were true.

    ``params`` of their streams tell the latencies. Only those wait that others may overtake.
    """
    late = {name: round(own.latency * 1e9) for name, own in params.items()}
    if not any(late.values()):
        yield from scans
        return
    most = max(late.values())
    waiting: list[tuple[int, str, int, Scan]] = []
    for number, scan in enumerate(scans):
        while waiting and waiting[0][0] < scan.time_ns - most:
            yield heappop(waiting)[3]
        true = scan.time_ns - late[scan.stream]
        heappush(waiting, (true, scan.stream, number, replace(scan, time_ns=true)))
    while waiting:
        yield heappop(waiting)[3]

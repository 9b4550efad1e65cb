"""All ranges of a recording as columns, and what odometry tells between their times."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ....models.records import Array, Scan
from ..links import Network, link_steps
from ..odometry import Increment, Odometer
from .params import Params

PER_RANGE = ("step", "anchor", "place", "z", "std")
"""Columns of :class:`Data` with a value for each range."""


@dataclass(frozen=True, slots=True, eq=False)
class Data:
    """Ranges (M,) of the n times ``time_ns``, in their order.

    ``step`` (M,) is the time of each, ``anchor`` (M,) the index of its anchor among ``anchors``,
    ``place`` (M, 3) [m] where that stood, ``z`` and ``std`` (M,) [m] the range. Where odometry
    tells, ``increments`` (n) lead to each time.
    """

    time_ns: Array
    anchors: int
    step: Array
    anchor: Array
    place: Array
    z: Array
    std: Array
    increments: tuple[Increment, ...]

    @property
    def seconds(self) -> Array:
        """Intervals (n - 1,) [s]."""
        return np.asarray(np.diff(self.time_ns) * 1e-9)

    def head(self, span: float, most: int) -> Data:
        """The first ``span`` [s], at ``most`` so many times."""
        n = int(np.searchsorted(self.time_ns, self.time_ns[0] + span * 1e9, side="right"))
        n = min(n, most)
        m = int(np.searchsorted(self.step, n))
        rows = {name: getattr(self, name)[:m] for name in PER_RANGE}
        return replace(self, time_ns=self.time_ns[:n], increments=self.increments[:n], **rows)


def gather(net: Network, scans: Iterable[Scan], odometry: str | None, params: Params) -> Data:
    """The ranges of the device in ``scans``, and the odometry of the stream of that name."""
    odometer = Odometer(params)
    seen: list[Scan] = []

    def uwb() -> Iterable[Scan]:
        for scan in scans:
            if scan.stream == odometry:
                odometer.take([scan])
            elif scan.stream == net.stream:
                seen.append(scan)
        return seen

    times: list[int] = []
    parts: list[tuple[Array, ...]] = []
    for k, (time_ns, (active, _)) in enumerate(link_steps(net, uwb())):
        times.append(time_ns)
        rx = np.repeat(active.rx, np.diff(active.offset))
        place = net.anchors(time_ns)[rx]
        parts.append((np.full(len(rx), k), rx, place, active.z, np.sqrt(active.variance)))
    increments = tuple(odometer.until(t) for t in times) if odometry is not None else ()
    columns = [np.concatenate(c) for c in zip(*parts, strict=True)] or [np.zeros(0)] * 5
    step, anchor, place, z, std = columns
    time = np.array(times, np.int64)
    return Data(time, len(net.sensors), step, anchor, place, z, std, increments)

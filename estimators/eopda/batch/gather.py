"""All ranges of a recording as columns, and what odometry tells between their times."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ....models.records import Array, Scan
from ..links import Links, Network, link_steps
from ..odometry import Increment, Odometer
from .params import Params

PER_RANGE = ("step", "anchor", "place", "z", "std", "reference", "other", "shared")
"""Columns of :class:`Data` with a value for each range."""


@dataclass(frozen=True, slots=True, eq=False)
class Data:
    """Ranges (M,) of the n times ``time_ns``, in their order.

    ``step`` (M,) is the time of each, ``anchor`` (M,) the index of its anchor among ``anchors``,
    ``place`` (M, 3) [m] where that stood, ``z`` and ``std`` (M,) [m] the range. Of a difference
    ``reference`` (M,) is the anchor, at ``other`` (M, 3) [m], whose distance is taken off; of a
    range it is -1. ``shared`` (M,) [m] is the standard deviation of the noise that all differences
    of a time share; it is not in ``std``. Where odometry tells, ``increments`` (n) lead to each
    time.
    """

    time_ns: Array
    anchors: int
    step: Array
    anchor: Array
    place: Array
    z: Array
    std: Array
    reference: Array
    other: Array
    shared: Array
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
    for k, (time_ns, (active, _, differences)) in enumerate(link_steps(net, uwb())):
        times.append(time_ns)
        anchors = net.anchors(time_ns)
        parts.append(_columns(k, active, np.full(len(active.tx), -1), anchors, 0.0))
        # the noise of one anchor can be shared, that of several would need one each
        c = params.tdoa_correlation if len(np.unique(differences.tx)) == 1 else 0.0
        parts.append(_columns(k, differences, differences.tx, anchors, c))
    increments = tuple(odometer.until(t) for t in times) if odometry is not None else ()
    columns = [np.concatenate(c) for c in zip(*parts, strict=True)] if parts else [np.zeros(0)] * 8
    rows = dict(zip(PER_RANGE, columns, strict=True))
    return Data(np.array(times, np.int64), len(net.sensors), increments=increments, **rows)


def _columns(
    step: int, links: Links, reference: Array, anchors: Array, correlation: float
) -> tuple[Array, ...]:
    """The columns of one time, as :data:`PER_RANGE` names them."""
    count = np.diff(links.offset)
    rx, of = np.repeat(links.rx, count), np.repeat(reference, count)
    std = np.sqrt(links.variance)
    return (
        np.full(len(rx), step),
        rx,
        anchors[rx],
        links.z,
        std * np.sqrt(1 - correlation),
        of,
        anchors[of],
        std * np.sqrt(correlation),
    )

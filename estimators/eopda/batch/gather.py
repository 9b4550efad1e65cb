"""All ranges of a recording as columns, and what odometry tells between their times."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....models.records import Array, Scan
from ..links import NO_LINKS, Links, Network, link_steps
from ..odometry import Increment, Odometer
from .params import Params

PER_RANGE = ("step", "anchor", "place", "z", "std", "reference", "other", "shared", "offset")
"""Columns of :class:`Data` with a value for each range."""


@dataclass(frozen=True, slots=True, eq=False)
class Data:
    """Ranges (M,) of the n times ``time_ns``, in their order.

    ``step`` (M,) is the time of each, ``anchor`` (M,) the index of its anchor among ``anchors``,
    ``place`` (M, 3) [m] where that stood, ``z`` and ``std`` (M,) [m] the range. Of a difference
    ``reference`` (M,) is the anchor, at ``other`` (M, 3) [m], whose distance is taken off; of a
    range it is -1. ``shared`` (M,) [m] is the standard deviation of the noise that all differences
    of a time share; it is not in ``std``. On a body the tag is at
    ``offset`` (M, 2) [m] from its centre. Where odometry tells, ``increments`` (n) lead to each
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
    offset: Array
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


def gather(
    nets: Sequence[tuple[Network, Array]],
    scans: Iterable[Scan],
    odometry: str | None,
    params: Params,
) -> Data:
    """The ranges in ``scans`` of devices, each with its place (2,) [m] on the body, and what the
    stream ``odometry`` tells between them."""
    odometer = Odometer(params)
    kept: list[Scan] = []
    for scan in scans:
        if scan.stream == odometry:
            odometer.take([scan])
        elif scan.stream == nets[0][0].stream:
            kept.append(scan)
    parts: list[tuple[Array, ...]] = []
    for net, offset in nets:
        for time_ns, (active, _, differences) in link_steps(net, kept):
            anchors = net.anchors(time_ns)
            none = np.full(len(active.tx), -1)
            parts.append(_columns(time_ns, active, none, anchors, 0.0, offset))
            # the noise of one anchor can be shared, that of several would need one each
            c = params.tdoa_correlation if len(np.unique(differences.tx)) == 1 else 0.0
            parts.append(_columns(time_ns, differences, differences.tx, anchors, c, offset))
    times = np.unique(np.array([scan.time_ns for scan in kept], np.int64))
    increments = tuple(odometer.until(t) for t in times.tolist()) if odometry is not None else ()
    if not parts:
        parts = [_columns(0, NO_LINKS, NO_LINKS.tx, np.zeros((1, 3)), 0.0, np.zeros(2))]
    rows = dict(zip(PER_RANGE, (np.concatenate(c) for c in zip(*parts, strict=True)), strict=True))
    order = np.argsort(rows["step"], kind="stable")
    rows = {name: values[order] for name, values in rows.items()}
    rows["std"] = rows["std"] * _shared_by(rows, params.noise_time)
    rows["step"] = np.searchsorted(times, rows["step"])
    return Data(times, len(nets[0][0].sensors), increments=increments, **rows)


def _shared_by(rows: dict[str, Array], noise_time: float) -> Array:
    """Factors (M,) of standard deviations: of n ranges in ``noise_time`` [s] each counts 1 / n."""
    keys = [rows[name] for name in ("anchor", "reference")] + list(rows["offset"].T)
    _, link = np.unique(np.stack(keys), axis=1, return_inverse=True)
    factor = np.ones(len(rows["z"]))
    for one in range(link.max(initial=-1) + 1):
        own = np.flatnonzero(link == one)
        if len(own) > 1:
            usual = max(float(np.median(np.diff(rows["step"][own]))) * 1e-9, 1e-9)
            factor[own] = np.sqrt(max(noise_time / usual, 1.0))
    return factor


def _columns(
    time_ns: int,
    links: Links,
    reference: Array,
    anchors: Array,
    correlation: float,
    offset: Array,
) -> tuple[Array, ...]:
    """The columns of one time, as :data:`PER_RANGE` names them; the step is still the time."""
    count = np.diff(links.offset)
    rx, of = np.repeat(links.rx, count), np.repeat(reference, count)
    std = np.sqrt(links.variance)
    return (
        np.full(len(rx), time_ns, np.int64),
        rx,
        anchors[rx],
        links.z,
        std * np.sqrt(1 - correlation),
        of,
        anchors[of],
        std * np.sqrt(correlation),
        np.tile(offset, (len(rx), 1)),
    )

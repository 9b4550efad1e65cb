"""Ranges that come faster than their errors change count for less.

The errors of a kit's ranges stay for a while: how the tag is turned, what reflects nearby. Taken
for independent, a hundred ranges a second make any filter sure of what is wrong. A range that
comes ``dt`` after the one before of its link counts for ``dt / noise_time``: over any time all that
come count for as many as are independent, however often they are read. The time is told, or found
from residuals ``e`` by the integral of their autocorrelation, ``noise_time = 2 int rho(t) dt``;
Sokal, "Monte Carlo methods in statistical mechanics", lecture notes (1996), on autocorrelation
times.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from ...models.records import Array
from .links import Links
from .state import Event, Step
from .weighing import distances, excess

LONGEST = 0.5
"""Time [s] up to which errors are compared; what stays longer is an offset that walks."""
LEAST = 1e-3
"""A range counts at least for so much."""
PAIRS = 200
"""Pairs of residuals without which nothing is said of their correlation."""
SURE = 4.0
"""Standard deviations, were the errors independent, that their correlation must exceed."""
OUTLIER = 3.0
"""Residuals beyond so many standard deviations are cut off there."""


def spaced(events: Iterable[Event], noise_time: float) -> Iterator[Event]:
    """The events, variances of ranges wider where they come within ``noise_time`` [s]."""
    if noise_time == 0.0:
        yield from events
        return
    last: dict[tuple[int, int], int] = {}

    def counted(links: Links, time_ns: int) -> Links:
        counts = np.ones(len(links.tx))
        for k, link in enumerate(zip(links.tx.tolist(), links.rx.tolist(), strict=True)):
            if link in last:
                counts[k] = min(max((time_ns - last[link]) * 1e-9 / noise_time, LEAST), 1.0)
            last[link] = time_ns
        return links._replace(variance=links.variance / np.repeat(counts, np.diff(links.offset)))

    for event in events:
        yield event._replace(
            active=counted(event.active, event.time_ns),
            differences=counted(event.differences, event.time_ns),
        )


def residuals(events: Iterable[Event], steps: Iterable[Step]) -> tuple[list[Array], list[Array]]:
    """Times [s] of the ranges of each anchor, and what the filter's ``steps`` leave of them [m]."""
    time: dict[int, list[float]] = {}
    left: dict[int, list[float]] = {}
    states = {step.time_ns: step.state for step in steps}
    for event in events:
        links = event.active
        if links.empty or event.time_ns not in states:
            continue
        state = states[event.time_ns]
        shift, _ = excess(state, event.anchors, links)
        own = distances(state, event.anchors)[links.rx]
        expected = (own + shift if len(shift) else own) @ state.w
        rx = np.repeat(links.rx, np.diff(links.offset))
        e = links.z - np.repeat(expected, np.diff(links.offset))
        for j, value in zip(rx.tolist(), e.tolist(), strict=True):
            time.setdefault(j, []).append(event.time_ns * 1e-9)
            left.setdefault(j, []).append(value)
    return [np.array(t) for t in time.values()], [np.array(e) for e in left.values()]


def noise_time(time: Sequence[Array], e: Sequence[Array]) -> float:
    """How long [s] errors stay, from residuals ``e`` (n,) [m] of each link at ``time`` (n,) [s].

    It is 0 where too few of them are closer than :data:`LONGEST`, or no more alike than by chance,
    and at most that: what stays longer is an offset that walks.
    """
    spread = 1.4826 * float(np.median(np.abs(np.concatenate([np.zeros(1), *e]))))
    if spread == 0.0:
        return 0.0
    cut = [np.clip(one / spread, -OUTLIER, OUTLIER) for one in e]
    total, pairs = 0.0, 0
    cut = [one - one.mean() for one in cut]
    for t, own in zip(time, cut, strict=True):
        for lag in range(1, len(t)):
            near = t[lag:] - t[:-lag] <= LONGEST
            if not near.any():
                break
            total += float((own[lag:] * own[:-lag])[near].sum())
            pairs += int(near.sum())
    variance = float(np.mean(np.square(np.concatenate(cut))))
    if pairs < PAIRS or total < SURE * np.sqrt(pairs) * variance:
        return 0.0
    return min(2 * LONGEST * total / pairs / variance, LONGEST)

"""Noticing that the device is lost: lines of sight that the particles do not explain.

For each line of sight the particles say how likely its range should be, and how likely it was. The
difference is summed up as in Page's cumulative test; where the sum is large, the device is sought
anew in the events since it was zero (:mod:`.start`). Whether it was lost is decided by the evidence
of both, so that a false alarm costs nothing but time. E. S. Page, "Continuous inspection schemes",
Biometrika 41 (1954).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import pi

import numpy as np

from ....models.records import Array
from ..links import Links
from ..params import Params
from ..state import Belief, Event, State, Target
from ..weighing import BODY, distances, excess, rates
from .resampling import systematic
from .start import start

LOG_PRIOR = -7.0
"""Log probability, before the ranges are seen, that a device has been lost."""
ALLOWED = 1.0
"""Surprise [nats] per line of sight that is expected, of outliers."""
ALARM = 6.0
"""Sum of surprises [nats] at which the device is sought anew; twice as much after a false alarm."""
MOST_ALARM = 200.0
MEMORY = 3.0
"""Time [s] of the last events that are kept."""
EVENTS = 12
"""Number of last events that are kept."""
LEAST = 3
"""Events with lines of sight without which there is no start anew."""


@dataclass(frozen=True, slots=True)
class Doubt:
    """The last events with their evidence [nats], and the sum of surprises [nats].

    The sum was zero before ``begun`` [ns], the first event of a search. At ``since`` [ns] lines of
    sight had not surprised for the last time: if the device was lost, then after it.
    """

    recent: tuple[tuple[Event, float], ...] = ()
    total: float = 0.0
    alarm: float = ALARM
    begun: int = 0
    since: int = 0

    def after(self, event: Event, evidence: float, surprise: float) -> Doubt:
        """The doubt after an event."""
        recent = [kept for kept in self.recent if event.time_ns - kept[0].time_ns <= MEMORY * 1e9]
        recent = [*recent[1 - EVENTS :], (event, evidence)]
        total = max(0.0, self.total + surprise)
        alarm = max(ALARM, self.alarm * (0.98 if total == 0 else 1.0))
        begun = self.begun if self.total > 0 else event.time_ns
        since = event.time_ns if total == 0 and _is_seen(event) else self.since
        return Doubt(tuple(recent), total, alarm, begun, since)

    @property
    def doubtful(self) -> list[tuple[Event, float]]:
        """The events since the device may have been lost, with their evidence."""
        return [kept for kept in self.recent if kept[0].time_ns >= self.begun]

    @property
    def is_alarm(self) -> bool:
        """Whether the device should be sought anew."""
        seen = sum(_is_seen(event) for event, _ in self.doubtful)
        return self.total > self.alarm and seen >= LEAST

    def found(self, odds: float) -> Doubt:
        """The doubt after a search, with the probability that the device had been lost."""
        if odds > 0.5:
            return Doubt(since=self.since)
        return replace(self, total=0.0, alarm=min(2 * self.alarm, MOST_ALARM))


def _is_seen(event: Event) -> bool:
    """Whether the event has lines of sight."""
    return not (event.active.empty and event.differences.empty)


def search(
    doubt: Doubt, target: Target, params: Params, before: Belief, rng: np.random.Generator
) -> tuple[State, float]:
    """Particles of a start from the doubtful events, and the probability that they are right."""
    events = [event for event, _ in doubt.doubtful]
    states, log_z = start(events, target, params, before, rng)
    log_z -= sum(rates(event, params) for event in events)
    log_odds = LOG_PRIOR + log_z - sum(evidence for _, evidence in doubt.doubtful)
    return states[-1], float(1 / (1 + np.exp(-np.clip(log_odds, -500, 500))))


def merge(state: State, fresh: State, share: float, rng: np.random.Generator) -> State:
    """Particles of both, those of ``fresh`` with the probability ``share``."""
    n = len(state.w)
    w = np.concatenate(((1 - share) * state.w, share * fresh.w))
    index = systematic(w, rng.random(), n)

    def join(a: Array, b: Array, axis: int) -> Array:
        return np.take(np.concatenate((a, b), axis), index, axis)

    return State(
        join(state.y, fresh.y, 1),
        np.full(n, 1 / n),
        join(state.mean, fresh.mean, 0),
        join(state.covariance, fresh.covariance, 0),
        # the odometry's heading is not lost with the position
        heading=np.tile(state.heading, 2)[index] if len(state.heading) else state.heading,
    )


def surprise(state: State, event: Event, params: Params) -> float:
    """How much less likely lines of sight are than particles ``state`` said before, and allowed."""
    links, anchors = event.active, event.anchors
    d = distances(state, anchors)
    total = 0.0
    if not links.empty:
        shift, loose = excess(state, anchors, links)
        spread = loose @ state.w if len(loose) else np.zeros(len(links.rx))
        own = d[links.rx] + shift if len(shift) else d[links.rx]
        total += _surprise(own, spread, links, state, params)
    links = event.differences
    if not links.empty:
        theta = range(1, state.mean.shape[1])
        spread = np.zeros(len(links.rx))
        own = d[links.rx] - d[links.tx]
        if len(theta):
            own = own + (state.mean[:, 1 + links.rx] - state.mean[:, 1 + links.tx]).T
            P = np.tensordot(state.w, state.covariance, 1)
            i, j = 1 + links.rx, 1 + links.tx
            spread = P[i, i] + P[j, j] - 2 * P[i, j]
        total += _surprise(own, spread, links, state, params)
    return total


def _surprise(d: Array, spread: Array, links: Links, state: State, params: Params) -> float:
    """The surprise of links of which particles expect ``d`` (L, N), uncertain by ``spread``."""
    mean = d @ state.w
    spread = spread + (d - mean[:, None]) ** 2 @ state.w
    link = np.repeat(np.arange(len(d)), np.diff(links.offset))
    v = links.variance + spread[link]
    g = np.exp(-np.minimum((links.z - mean[link]) ** 2 / (2 * v), 32)) / np.sqrt(2 * pi * v)
    count = np.bincount(link, minlength=len(d))
    seen, hoped = (np.bincount(link, x, len(d)) for x in (g, 1 / np.sqrt(2 * pi * np.e * v)))
    floor = params.clutter + params.scatter / BODY
    seen, hoped = (np.log(1 + params.los * x / floor) for x in (seen, hoped / np.maximum(count, 1)))
    return float((np.clip(hoped - seen, -3.0, 8.0) - ALLOWED)[count > 0].sum())

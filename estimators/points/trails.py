"""Smoothing of labelled Bernoullis along their trails: means and covariances, existence, classes.

The moments by H. E. Rauch, F. Tung and C. T. Striebel, "Maximum likelihood estimates of linear
dynamic systems", AIAA Journal 3 (1965) 1445-1450; existence is that of a Markov chain, in which a
target appears once: one that is there later was there. So a trail reaches back to the first
detection that began it, and ends about where its last one is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ...models.parameters import parameter
from ...models.records import Array
from ..kernels.passes import SmoothParams
from .kernels.modes import Way
from .kernels.smoothing import existed, rts
from .source import Classes


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class TrailParams(SmoothParams):
    """How long estimates wait for what comes, and which are shown then."""

    TITLE = "smoothing"

    extract_smoothed: float = parameter(
        0.7,
        "1",
        "smoothed: least existence, given all that comes, of what is extracted",
        within="[0, 1)",
    )


@dataclass(frozen=True, slots=True, eq=False)
class Trail:
    """T Bernoullis at ``time_ns`` by label (T,), rising: r (T,), m (T, dx), P (T, dx, dx).

    F and Q (dx, dx) are the motion from the time before, or ``way`` of those that manoeuvre, from
    where targets ``survive`` with that probability; ``classes`` are those of targets that are known
    then or later.
    """

    time_ns: int
    label: Array
    r: Array
    m: Array
    P: Array
    F: Array
    Q: Array
    survive: float
    classes: Classes = field(default_factory=dict)
    way: Way | None = None


def back(later: Trail | None, now: Trail) -> Trail:
    """What is known of those ``now`` given what is known ``later``, the next time."""
    if later is None:
        return now
    at = np.searchsorted(later.label, now.label)
    known = np.append(later.label, -1)[at] == now.label
    here, there = np.flatnonzero(known), at[known]
    r, m, P = np.zeros(len(now.r)), now.m.copy(), now.P.copy()
    r[here] = later.r[there]
    r = existed(now.r, r, later.survive)
    ahead = later.m[there], later.P[there]
    if later.way is None:
        m[here], P[here] = rts(m[here], P[here], *ahead, later.F, later.Q)
    else:
        m[here], P[here] = later.way.back(here, m[here], P[here], *ahead)
    alive = set(now.label.tolist())
    kept: Mapping[int, Array] = {l: p for l, p in later.classes.items() if l in alive}
    return replace(now, r=r, m=m, P=P, classes={**now.classes, **kept})

"""Trajectories of the most probable global hypothesis, smoothed from their ends to their births.

The hypothesis is the one that is best at the end, followed back from time to time to what it was
before: so are tracks that died in it, from the last time that it had them. Moments by
:func:`.smoothing.rts`, existence by :func:`.smoothing.existed`. Before its first detection a track
is followed straight back.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

import numpy as np

from ....models.motion import backwards
from ....models.records import Array
from .bernoulli import Mixture
from .smoothing import Epoch, existed


@dataclass(frozen=True, slots=True, eq=False)
class Paths:
    """Tracks at ``epoch`` by label (n,): r (n,), m (n, dx), P (n, dx, dx), given the future.

    They are those of the hypothesis ``row`` (C,) of each group. ``origin`` (n,) is the Bernoulli
    that each was after the scans before, -1 where it began later; ``age`` (n,) [s] is negative
    before it began, else 0. Those ``hit`` (n,) were detected then; those that are ``given_up`` (n,)
    end with their last detection.
    """

    epoch: Epoch
    row: Array
    label: Array
    origin: Array
    age: Array
    r: Array
    m: Array
    P: Array
    hit: Array
    given_up: Array


def back(later: Paths | None, now: Epoch, retrodict: float, max_coast: float = inf) -> Paths:
    """The paths at ``now`` given those ``later``, the next time.

    Tracks that began at most ``retrodict`` [s] later are followed straight back. Of those that were
    given up since they had not been detected for ``max_coast`` [s] nobody knows when they died: as
    if after the last detection.
    """
    x = now.mixture
    row = np.zeros(x.w.shape[1], np.int64)
    row = row if later is None else _before(later, x)
    picked = x.table[row[x.group], np.arange(len(x.label))]
    carried = np.zeros(0, np.int64) if later is None else later.label
    new = (picked >= 0) & ~np.isin(x.label, carried)
    a = x.local.take(picked[new])
    given_up = np.zeros(len(a), bool)
    r = a.r
    if later is not None:
        given_up = a.unseen + (later.epoch.time_ns - now.time_ns) / 1e9 > max_coast
        given_up &= a.unseen > 0
        r = np.where(given_up, 0.0, existed(a.r, np.zeros(len(a)), later.epoch.survive))
    ends = x.label[new], a.origin, np.zeros(len(a)), r, a.m, a.P, a.unseen == 0, given_up
    if later is None:
        return Paths(now, row, *ends)
    both = zip(ends, _followed(later, now, retrodict), strict=True)
    return Paths(now, row, *(np.concatenate(pair) for pair in both))


def _before(later: Paths, x: Mixture) -> Array:
    """The hypotheses (C,) of the groups of ``x`` that have become those of ``later``.

    Groups that met and parted have come of it in several parts: a group's is that of the part in
    which most of its own tracks are there later, or if none is the likeliest then; and the same for
    all, so that what it excludes stays excluded. It is the best of a group that nothing has come
    of.
    """
    y, row = later.epoch.mixture, np.zeros(x.w.shape[1], np.int64)
    n = y.w.shape[1]
    before, now = _groups(x, later.label), _groups(y, later.label)
    both = (before >= 0) & (now >= 0)
    size = n * len(row)
    there = np.bincount(before[both] * n + now[both], later.r[both], size)[y.came * n + y.heir]
    part = y.parent[later.row[y.heir], np.arange(len(y.heir))]
    last = np.lexsort((part, -np.where(there > 0.5, there, 0.0)))[::-1]
    row[y.came[last]] = part[last]
    return row


def _groups(x: Mixture, label: Array) -> Array:
    """The groups (n,) of tracks with a ``label`` (n,), -1 for none."""
    order = np.argsort(x.label, kind="stable")
    at = np.append(order, -1)[np.searchsorted(x.label, label, sorter=order)]
    known = np.append(x.label, -1)[at] == label
    return np.where(known, np.append(x.group, -1)[at], -1)


def _followed(later: Paths, now: Epoch, retrodict: float) -> tuple[Array, ...]:
    F, Q = later.epoch.F, later.epoch.Q
    dt = (later.epoch.time_ns - now.time_ns) / 1e9
    age = np.where(later.origin >= 0, 0.0, np.minimum(later.age, 0.0) - dt)
    kept = np.flatnonzero(age >= -retrodict)
    before, age = later.origin[kept], age[kept]
    r, m, P = later.r[kept], later.m[kept], later.P[kept]
    inverse = backwards(F)
    m_out, P_out = m @ inverse.T, inverse @ (P + Q) @ inverse.T
    here = np.flatnonzero(before >= 0)
    a = now.mixture.local.take(before[here])
    m_out[here], P_out[here] = later.epoch.back(now.mixture, before[here], m[here], P[here])
    hit = np.zeros(len(kept), bool)
    hit[here] = a.unseen == 0
    given_up = later.given_up[kept]
    given_up[here] &= ~hit[here]
    r[here] = np.where(given_up[here], 0.0, existed(a.r, r[here], later.epoch.survive))
    origin = np.full(len(kept), -1)
    origin[here] = a.origin
    P_out = (P_out + P_out.swapaxes(1, 2)) / 2
    return later.label[kept], origin, age, r, m_out, P_out, hit, given_up

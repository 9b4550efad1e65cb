"""Trajectories of the most probable global hypothesis, smoothed from their ends to their births.

The hypothesis is the one that is best at the end, followed back from time to time to what it was
before: so are tracks that died in it, from the last time that it had them. Moments by
:func:`.smoothing.rts`; existence is the largest then or later. Before its first detection a track
is followed straight back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....models.records import Array
from .smoothing import Epoch, rts


@dataclass(frozen=True, slots=True, eq=False)
class Paths:
    """Tracks at ``epoch`` by label (n,): r (n,), m (n, dx), P (n, dx, dx), given the future.

    They are those of the hypothesis ``row`` (C,) of each group. ``origin`` (n,) is the Bernoulli
    that each was after the scans before, -1 where it began later; ``age`` (n,) [s] is negative
    before it began, else 0.
    """

    epoch: Epoch
    row: Array
    label: Array
    origin: Array
    age: Array
    r: Array
    m: Array
    P: Array


def back(later: Paths | None, now: Epoch, retrodict: float) -> Paths:
    """The paths at ``now`` given those ``later``, the next time.

    Tracks that began at most ``retrodict`` [s] later are followed straight back.
    """
    x = now.mixture
    row = np.zeros(x.w.shape[1], np.int64) if later is None else _before(later)
    picked = x.table[row[x.group], np.arange(len(x.label))]
    carried = np.zeros(0, np.int64) if later is None else later.label
    new = (picked >= 0) & ~np.isin(x.label, carried)
    a = x.local.take(picked[new])
    ends = x.label[new], a.origin, np.zeros(len(a)), a.r, a.m, a.P
    if later is None:
        return Paths(now, row, *ends)
    both = zip(ends, _followed(later, now, retrodict), strict=True)
    label, origin, age, r, m, P = (np.concatenate(pair) for pair in both)
    return Paths(now, row, label, origin, age, r, m, P)


def _before(later: Paths) -> Array:
    """The hypothesis (C0,) of each group before, the best of those that nothing has come of."""
    y = later.epoch.mixture
    known = y.heir >= 0
    here = np.where(known, y.heir, 0)
    if not len(later.row):
        return np.zeros(len(y.heir), np.int64)
    return np.where(known, y.parent[later.row[here], np.arange(len(y.heir))], 0)


def _followed(later: Paths, now: Epoch, retrodict: float) -> tuple[Array, ...]:
    F, Q = later.epoch.F, later.epoch.Q
    dt = (later.epoch.time_ns - now.time_ns) / 1e9
    age = np.where(later.origin >= 0, 0.0, np.minimum(later.age, 0.0) - dt)
    kept = np.flatnonzero(age >= -retrodict)
    before, age = later.origin[kept], age[kept]
    r, m, P = later.r[kept], later.m[kept], later.P[kept]
    inverse = np.linalg.inv(F)
    m_out, P_out = m @ inverse.T, inverse @ (P + Q) @ inverse.T
    here = np.flatnonzero(before >= 0)
    a = now.mixture.local.take(before[here])
    m_out[here], P_out[here] = rts(a.m, a.P, m[here], P[here], F, Q)
    r[here] = np.maximum(r[here], a.r)
    origin = np.full(len(kept), -1)
    origin[here] = a.origin
    return later.label[kept], origin, age, r, m_out, (P_out + P_out.swapaxes(1, 2)) / 2

"""The way back: targets of each time as all later maps see them.

The moments by H. E. Rauch, F. Tung and C. T. Striebel, "Maximum likelihood estimates of linear
dynamic systems", AIAA Journal 3 (1965) 1445-1450. What exists later, and was followed before,
existed before: it is shown from the scan in which it was first looked at. Its class is the one
that was known last, as classes do not change.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .params import Params
from .targets import Targets, motion, predict

MOVED = np.arange(4)
"""What of the state stays the same thing if a target is explained by another body: its motion."""


@dataclass(frozen=True, slots=True, eq=False)
class Trail:
    """All targets that are followed at ``time_ns``, shown or not."""

    time_ns: int
    targets: Targets


def back(later: Trail | None, now: Trail, params: Params) -> Trail:
    """What is known of the targets ``now`` given what is known ``later``, the next time."""
    if later is None:
        return now
    t, u = now.targets, later.targets
    _, here, there = np.intersect1d(t.label, u.label, return_indices=True)
    dt = (later.time_ns - now.time_ns) / 1e9
    m, P = t.m.copy(), t.P.copy()
    exists, vehicle = t.exists.copy(), t.vehicle.copy()
    ahead = predict(t.take(here), params, dt)
    F = motion(params, dt)
    for k, (i, j) in enumerate(zip(here, there, strict=True)):
        turn = abs((u.m[j, 4] - ahead.m[k, 4] + np.pi) % (2 * np.pi) - np.pi)
        same = t.kind[i] == u.kind[j] and turn < np.pi / 2
        some = np.arange(7) if same else MOVED
        at = np.ix_(some, some)
        gain = np.linalg.solve(ahead.P[k][at], (F @ t.P[i])[at]).T
        off = u.m[j] - ahead.m[k]
        off[4] = (off[4] + np.pi) % (2 * np.pi) - np.pi
        m[i, some] += gain @ off[some]
        S = P[i][at] + gain @ (u.P[j] - ahead.P[k])[at] @ gain.T
        P[i][at] = (S + S.T) / 2
    exists[here] = np.maximum(exists[here], u.exists[there])
    vehicle[here] = u.vehicle[there]
    return Trail(now.time_ns, replace(t, m=m, P=P, exists=exists, vehicle=vehicle))

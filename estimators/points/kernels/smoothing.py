"""Smoothing: a step back of Gaussians, and a fixed lag along the tracks of a mixture.

H. E. Rauch, F. Tung and C. T. Striebel, "Maximum likelihood estimates of linear dynamic systems",
AIAA Journal 3 (1965) 1445-1450.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....models.motion import backwards
from ....models.records import Array
from .bernoulli import Mixture
from .modes import Way


@dataclass(frozen=True, slots=True, eq=False)
class Epoch:
    """The mixture after the scans at ``time_ns``, how it came there: F, noise Q (dx, dx).

    Targets of the time before ``survive`` until then with that probability; ``way`` is how those
    that manoeuvre came.
    """

    time_ns: int
    mixture: Mixture
    F: Array
    Q: Array
    survive: float
    way: Way | None = None

    def back(
        self, before: Mixture, at: Array, m_later: Array, P_later: Array
    ) -> tuple[Array, Array]:
        """Moments of the Bernoullis ``at`` (k,) ``before``, given those smoothed at this time."""
        m, P = before.local.m[at], before.local.P[at]
        if self.way is None:
            return rts(m, P, m_later, P_later, self.F, self.Q)
        return self.way.back(at, m, P, m_later, P_later)


def ended(epochs: Sequence[Epoch], alive: Array) -> dict[int, list[tuple[int, int]]]:
    """Tracks that have ended since the first epoch: by their last epoch, labels and Bernoullis.

    Only those that the best hypothesis had to the end: others were never there.
    """
    found: dict[int, list[tuple[int, int]]] = {}
    known = set(alive.tolist())
    for k in range(len(epochs) - 1, -1, -1):
        x = epochs[k].mixture
        for label, l in zip(x.label.tolist(), x.table[0].tolist(), strict=True):
            if label not in known:
                known.add(label)
                if l >= 0:
                    found.setdefault(k, []).append((label, l))
    return found


def smooth(epochs: Sequence[Epoch], index: Array) -> tuple[Array, Array, Array, Array]:
    """The first of ``epochs`` as the Bernoullis ``index`` (n,) of the last one saw it.

    A track that began later is followed straight back to where it would have come from.

    Returns
    -------
    age (n,) [s] : of the tracks at the first epoch, negative for those that began later
    r (n,) : the greatest existence since
    m (n, dx), P (n, dx, dx) : the smoothed density
    """
    last = epochs[-1].mixture.local.take(index)
    r, m, P = last.r, last.m, last.P
    begin = np.full(len(index), epochs[-1].time_ns)
    for now, after in zip(epochs[-2::-1], epochs[:0:-1], strict=True):
        index = np.append(after.mixture.local.origin, -1)[index]
        back = backwards(after.F)
        m_all, P_all = m @ back.T, back @ (P + after.Q) @ back.T
        here = np.flatnonzero(index >= 0)
        m_all[here], P_all[here] = after.back(now.mixture, index[here], m[here], P[here])
        m, P = m_all, (P_all + P_all.swapaxes(1, 2)) / 2
        r[here] = np.maximum(r[here], now.mixture.local.r[index[here]])
        begin[here] = now.time_ns
    return (epochs[0].time_ns - begin) / 1e9, r, m, P


def existed(r: Array, later: Array, survive: float) -> Array:
    """Existence (k,) at a time, r by what came until then, given that of a step ``later``.

    A target that is there later was there; one that is not may have died in between, which it does
    not with ``survive``. It is the smoother of the Markov chain of existence.
    """
    gone = 1 - r * survive
    died = np.divide(r * (1 - survive), gone, out=np.zeros(len(r)), where=gone > 0)
    return np.asarray(later + (1 - later) * died)


def rts(
    m: Array, P: Array, m_later: Array, P_later: Array, F: Array, Q: Array
) -> tuple[Array, Array]:
    """Means (k, dx) and covariances (k, dx, dx) given those that are smoothed a step later."""
    if not len(m):
        return m, P
    FP = F @ P
    predicted = FP @ F.T + Q
    gain = np.linalg.solve(predicted, FP).swapaxes(1, 2)
    m = m + (gain @ (m_later - m @ F.T)[..., None])[..., 0]
    P = P + gain @ (P_later - predicted) @ gain.swapaxes(1, 2)
    return m, (P + P.swapaxes(1, 2)) / 2

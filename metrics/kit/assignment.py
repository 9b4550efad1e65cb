"""Optimal assignment between two sets at each of many steps.

All metrics on sets here have the same form: a pair closer than the cut-off gains something over
leaving both unassigned, any other pair nothing. So only the pairs below the cut-off are kept, and
an assignment chooses those of them whose gains sum to the most. Pairs whose ends are in no other
pair choose themselves; where ends compete, the Jonker-Volgenant algorithm of SciPy decides.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import linear_sum_assignment

from ...models.records import Array

_BLOCK = 1 << 20
"""Pairs that are looked at together."""


@dataclass(frozen=True, slots=True, eq=False)
class CandidatePairs:
    """Pairs of rows of two ragged tables, in order: ``step first second distance`` (k,)."""

    step: Array
    first: Array
    second: Array
    distance: Array

    def __len__(self) -> int:
        return len(self.step)

    def take(self, index: Array) -> CandidatePairs:
        """The pairs ``index``."""
        columns = (self.step, self.first, self.second, self.distance)
        return CandidatePairs(*(column[index] for column in columns))


def near(a: Array, a_offset: Array, b: Array, b_offset: Array, cutoff: float) -> CandidatePairs:
    """All pairs of points of ``a`` (m, d) and ``b`` (k, d) of one step, below ``cutoff`` apart.

    ``a_offset`` and ``b_offset`` (n + 1,) divide the rows into steps.
    """
    na, nb = np.diff(a_offset), np.diff(b_offset)
    step = np.repeat(np.arange(len(na)), na)
    partners = nb[step]
    ends = np.cumsum(partners)
    blocks = np.searchsorted(ends, np.arange(0, ends[-1] if len(ends) else 0, _BLOCK), "right")
    parts = []
    for start, stop in pairwise([*blocks, len(a)]):
        count = partners[start:stop]
        first = np.repeat(np.arange(start, stop), count)
        inner = np.arange(len(first)) - np.repeat(np.cumsum(count) - count, count)
        second = b_offset[step[first]] + inner
        squared = np.zeros(len(first))
        for axis in range(a.shape[1]):
            squared += (a[first, axis] - b[second, axis]) ** 2
        close = squared < cutoff**2
        first, second = first[close], second[close]
        parts.append(CandidatePairs(step[first], first, second, np.sqrt(squared[close])))
    columns = [[getattr(p, name) for p in parts] for name in CandidatePairs.__slots__]
    none = (*(np.zeros(0, np.int64),) * 3, np.zeros(0))
    return CandidatePairs(*(np.concatenate([z, *c]) for z, c in zip(none, columns, strict=True)))


def assign(pairs: CandidatePairs, gain: Array) -> Array:
    """Indices, in order, of the pairs (k,) that an optimal assignment chooses.

    They maximise the sum of ``gain`` (k,); no row is in two of them, none has a gain of 0 or less.
    """
    good = np.flatnonzero(gain > 0)
    _, row, rows = np.unique(pairs.first[good], return_inverse=True, return_counts=True)
    _, column, columns = np.unique(pairs.second[good], return_inverse=True, return_counts=True)
    contested = (rows[row] > 1) | (columns[column] > 1)
    chosen = _optimal(pairs.take(good[contested]), gain[good[contested]])
    return np.sort(np.concatenate((good[~contested], good[contested][chosen])))


def matched(pairs: CandidatePairs, order: float, cutoff: float, steps: int) -> tuple[Array, Array]:
    """Sum of ``distance ** order`` over an optimal assignment, and its pairs, per step (n,) each.

    Optimal for OSPA and for GOSPA (:mod:`..distances`): a pair gains ``cutoff ** order`` less its
    own.
    """
    power = pairs.distance**order
    chosen = assign(pairs, cutoff**order - power)
    step = pairs.step[chosen]
    return np.bincount(step, power[chosen], steps), np.bincount(step, minlength=steps)


def ospa_parts(
    power: Array, pairs: Array, counts: tuple[Array, Array] | Array, order: float, cutoff: float
) -> dict[str, Array]:
    """OSPA (n,) [m], called ``""``, and its parts, of what :func:`matched` found per step.

    ``counts`` (n,) each are the numbers of true and of estimated objects.
    """
    m, n = np.sort(counts, axis=0)
    size = np.maximum(n, 1)
    localisation = (power + cutoff**order * (m - pairs)) / size
    cardinality = cutoff**order * (n - m) / size
    powers = {"": localisation + cardinality, "localisation": localisation}
    powers["cardinality"] = cardinality
    return {part: v ** (1 / order) for part, v in powers.items()}


def _optimal(pairs: CandidatePairs, gain: Array) -> Array:
    """The same for pairs of which none stands alone."""
    if not len(pairs):
        return np.zeros(0, np.int64)
    start = np.flatnonzero(np.diff(pairs.step, prepend=-1))
    count = np.diff(start, append=len(pairs))
    row, height = _local(pairs.first, start, count)
    column, width = _local(pairs.second, start, count)
    base = np.concatenate(([0], np.cumsum(height * width)))
    place = np.repeat(base[:-1], count) + row * np.repeat(width, count) + column
    gains = np.zeros(base[-1])
    gains[place] = gain
    chosen = []
    for b, h, w in zip(base[:-1].tolist(), height.tolist(), width.tolist(), strict=True):
        i, j = linear_sum_assignment(gains[b : b + h * w].reshape(h, w), maximize=True)
        chosen.append(b + i * w + j)
    found = np.concatenate(chosen)
    index = np.searchsorted(place, found).clip(max=len(place) - 1)
    return np.asarray(index[place[index] == found])


def _local(rows: Array, start: Array, count: Array) -> tuple[Array, Array]:
    """``rows`` (k,) counted from 0 within each step, and how many different ones it has."""
    _, index = np.unique(rows, return_inverse=True)
    local = index - np.repeat(np.minimum.reduceat(index, start), count)
    return local, np.maximum.reduceat(local, start) + 1

"""OSPA distance between sets of tracks over a sliding window, OSPA(2).

Two tracks, true and estimated by label, are as far apart as the mean over the steps of the window
at which one of them exists: of the distance cut off at c where both do, of c where one does. Sets
of tracks are then compared by OSPA with this distance (Beard, Vo and Vo, OSPA(2): using the OSPA
metric to evaluate multi-target tracking performance, 2017; here both means have order p). So late
starts, early ends, broken tracks and swapped labels cost, which :mod:`.ospa` does not see. A window
reaches back from its step, and is shorter at the start.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..models.parameters import parameter, require
from ..models.records import Estimates, Objects, Recording, Scores
from .assignment import Near, assign
from .series import Distance, parts
from .sets import Sets, sets

SUMMARY = "OSPA(2) distance between estimated and true tracks over a sliding window"
PARTS = ("localisation", "cardinality")
NEEDS_SCANS = False
FOR_SETS = True
QUADRATIC = ()
Array = np.ndarray[Any, Any]


@dataclass(frozen=True, slots=True)
class Params(Distance):
    """Which steps are scored, with which order, cut-off and window."""

    window: int = parameter(20, "1", "steps over which tracks are compared")

    def __post_init__(self) -> None:
        Distance.__post_init__(self)
        require(self.window >= 1, "window", "at least 1", self.window)


def ospa2(aligned: Sets, order: float, cutoff: float, window: int) -> dict[str, Array]:
    """OSPA(2) (n,) [m] at each step, called ``""``, and its parts by name."""
    pairs, counts = _tracks(aligned, order, cutoff, window)
    chosen = assign(pairs, cutoff**order - pairs.distance)
    step = pairs.step[chosen]
    m, n = np.sort(counts, axis=0)
    size = np.maximum(n, 1)
    steps = len(aligned)
    power = np.bincount(step, pairs.distance[chosen], steps)
    localisation = (power + cutoff**order * (m - np.bincount(step, minlength=steps))) / size
    cardinality = cutoff**order * (n - m) / size
    powers = (localisation + cardinality, localisation, cardinality)
    return {k: v ** (1 / order) for k, v in zip(("", *PARTS), powers, strict=True)}


def _tracks(aligned: Sets, order: float, cutoff: float, window: int) -> tuple[Near, Array]:
    """Pairs of tracks nearer than the cut-off, with their p-th powers, and numbers (2, n).

    A step takes in its objects, gives out those that leave the window, and keeps the sums.
    """
    near = aligned.near(cutoff)
    label, number = zip(*map(_numbered, (aligned.truth, aligned.estimate)), strict=True)
    key = label[0][near.first] * number[1] + label[1][near.second]
    keys, pair = np.unique(key, return_inverse=True)
    first, second = np.divmod(keys, max(number[1], 1))
    bounds = np.searchsorted(near.step, np.arange(len(aligned) + 1))
    power = near.distance**order
    life = [np.zeros(n, np.int64) for n in number]
    both, close, total = (np.zeros(len(keys), t) for t in (np.int64, np.int64, float))

    def enter(k: int, sign: int) -> None:
        here = [np.zeros(n, np.int64) for n in number]
        for side, objects in enumerate((aligned.truth, aligned.estimate)):
            rows = slice(objects.row_offset[k], objects.row_offset[k + 1])
            here[side][label[side][rows]] = sign
            life[side] += here[side]
        both[:] += here[0][first] * here[1][second] * sign
        rows = slice(bounds[k], bounds[k + 1])
        close[pair[rows]] += sign
        total[pair[rows]] += sign * power[rows]

    found, counts = [], np.zeros((2, len(aligned)), np.int64)
    for k in range(len(aligned)):
        enter(k, 1)
        if k >= window:
            enter(k - window, -1)
        counts[:, k] = [np.count_nonzero(n) for n in life]
        p = np.flatnonzero(close)
        union = life[0][first[p]] + life[1][second[p]] - both[p]
        mean = (np.maximum(total[p], 0.0) + cutoff**order * (union - close[p])) / union
        found.append(
            (np.full(len(p), k), k * number[0] + first[p], k * number[1] + second[p], mean)
        )
    return Near(*map(np.concatenate, zip(*found, strict=True))), counts


def _numbered(objects: Objects) -> tuple[Array, int]:
    """Labels as numbers from 0, and how many there are."""
    labels, number = np.unique(objects.label, return_inverse=True)
    return number, len(labels)


def score(estimates: Estimates, recording: Recording, params: Params) -> Scores:
    """OSPA(2) [m] and its parts per step, their means, and the number of steps left out.

    Raises
    ------
    InputError : no truth, no positions in common, or nothing to score
    """
    aligned = sets(estimates, recording, params)
    values = ospa2(aligned, params.order, params.cutoff, params.window)
    key = (recording.meta.name, estimates.estimator, "ospa2")
    return parts(key, aligned, values, params.block)

"""OSPA distance between sets of tracks over a sliding window, OSPA(2).

Two tracks, true and estimated by label, are as far apart as the mean over the steps of the window
at which one of them exists: of the distance cut off at c where both do, of c where one does. Sets
of tracks are then compared by OSPA with this distance (Beard, Vo and Vo, OSPA(2): using the OSPA
metric to evaluate multi-target tracking performance, 2017; here both means have order p). So late
starts, early ends, broken tracks and swapped labels cost, which :mod:`.ospa` does not see. A window
reaches back from its step, and is shorter at the start.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...models.parameters import parameter
from ...models.records import Array, Estimates, Recording, Scores
from ..kit.assignment import CandidatePairs, assign, ospa_parts
from ..kit.measured import Measured, Names
from ..kit.series import Distance, parts
from ..kit.sets import align
from ..protocol import Metric

_COUNTS = ("true", "estimated", "pairs")
_BLOCK = 1024
"""Steps whose tracks are compared together."""


@dataclass(frozen=True, slots=True)
class Params(Distance):
    """Which steps are scored, with which order, cut-off and window."""

    window: int = parameter(20, "1", "steps over which tracks are compared", within="[1, inf)")


def measure(estimates: Estimates, recording: Recording, params: Params) -> Measured:
    """Labels and near pairs: how many per step, and which.

    Raises
    ------
    InputError : no truth, or no positions in common
    """
    aligned = align(estimates, recording, params)
    near = aligned.near(params.cutoff)
    true, estimated = aligned.truth.label, aligned.estimate.label
    counts = (*aligned.counts, np.bincount(near.step, minlength=len(aligned)))
    lists = {
        "true": true,
        "estimated": estimated,
        "first": true[near.first],
        "second": estimated[near.second],
        "power": near.distance**params.order,
    }
    return Measured(aligned.time, dict(zip(_COUNTS, counts, strict=True)), aligned.left_out, lists)


def ospa2(measured: Measured, order: float, cutoff: float, window: int) -> dict[str, Array]:
    """OSPA(2) (n,) [m] at each step, called ``""``, and its parts by name."""
    n = len(measured)
    offsets = [np.append(0, np.cumsum(measured.values[name])) for name in _COUNTS]
    found = [
        _block(measured.lists, offsets, range(k, min(k + _BLOCK, n)), order, cutoff, window)
        for k in range(0, n, _BLOCK)
    ]
    power, pairs, true, estimated = np.concatenate(found, axis=1)
    return ospa_parts(power, pairs, (true, estimated), order, cutoff)


def _block(
    lists: Mapping[str, Array],
    offsets: Sequence[Array],
    steps: range,
    order: float,
    cutoff: float,
    window: int,
) -> Array:
    """Sum of powers, number of pairs and numbers of tracks (4, len(steps)) at ``steps``."""
    first = max(0, steps.start - window + 1)
    rows = [o[first : steps.stop + 1] - o[first] for o in offsets]
    parts = [slice(o[first], o[steps.stop]) for o in offsets]
    labels = [lists[name][part] for name, part in zip(("true", "estimated"), parts, strict=False)]
    ends = [lists[name][parts[2]] for name in ("first", "second")]
    power = lists["power"][parts[2]]
    pairs, counts = _tracks(labels, ends, power, rows, cutoff**order, window)
    chosen = assign(pairs, cutoff**order - pairs.distance)
    step, count = pairs.step[chosen], counts.shape[1]
    sums, number = (
        np.bincount(step, pairs.distance[chosen], count),
        np.bincount(step, minlength=count),
    )
    return np.stack((sums, number, *counts))[:, steps.start - first :]


def _tracks(
    labels: Sequence[Array],
    ends: Sequence[Array],
    power: Array,
    offsets: Sequence[Array],
    unpaired: float,
    window: int,
) -> tuple[CandidatePairs, Array]:
    """Pairs of tracks nearer than the cut-off, with their p-th powers, and numbers (2, n).

    ``labels`` are the true and the estimated ones, ``ends`` those of near pairs with their
    ``power``; ``offsets`` divide them into steps. A step takes in its objects, gives out those that
    leave the window, and keeps the sums.
    """
    names = [np.unique(side) for side in labels]
    label = [np.searchsorted(known, side) for known, side in zip(names, labels, strict=True)]
    number = [len(known) for known in names]
    ends = [np.searchsorted(known, side) for known, side in zip(names, ends, strict=True)]
    keys, pair = np.unique(ends[0] * number[1] + ends[1], return_inverse=True)
    first, second = np.divmod(keys, max(number[1], 1))
    life = [np.zeros(n, np.int64) for n in number]
    both, close, total = (np.zeros(len(keys), t) for t in (np.int64, np.int64, float))

    def enter(k: int, sign: int) -> None:
        here = [np.zeros(n, np.int64) for n in number]
        for side in (0, 1):
            here[side][label[side][offsets[side][k] : offsets[side][k + 1]]] = sign
            life[side] += here[side]
        both[:] += here[0][first] * here[1][second] * sign
        rows = slice(offsets[2][k], offsets[2][k + 1])
        close[pair[rows]] += sign
        total[pair[rows]] += sign * power[rows]

    steps = len(offsets[0]) - 1
    found, counts = [], np.zeros((2, steps), np.int64)
    for k in range(steps):
        enter(k, 1)
        if k >= window:
            enter(k - window, -1)
        counts[:, k] = [np.count_nonzero(n) for n in life]
        p = np.flatnonzero(close)
        union = life[0][first[p]] + life[1][second[p]] - both[p]
        mean = (np.maximum(total[p], 0.0) + unpaired * (union - close[p])) / union
        found.append(
            (np.full(len(p), k), k * number[0] + first[p], k * number[1] + second[p], mean)
        )
    return CandidatePairs(*map(np.concatenate, zip(*found, strict=True))), counts


def summarise(names: Names, measured: Measured, params: Params) -> Scores:
    """OSPA(2) [m] and its parts per step, their means, and the number of steps left out."""
    values = ospa2(measured, params.order, params.cutoff, params.window)
    return parts((*names, "ospa2"), measured, values, params.block)


METRIC = Metric(
    "OSPA(2) distance between estimated and true tracks over a sliding window",
    Params,
    measure,
    summarise,
    PARTS=("localisation", "cardinality"),
    FOR_SETS=True,
)

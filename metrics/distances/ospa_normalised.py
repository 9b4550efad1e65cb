"""The variant of OSPA that divides by the number of different objects.

Over assignments zeta of true to estimated positions below the gate xi, the error is the least
value of (Favarelli et al., Multi-base station cooperative sensing with AI-aided tracking, eq. 18
and above)::

    ((sum over zeta of d^p + xi^p / 2 (missed + false)) / N_c)^(1/p),  N_c = |S| + |S^| - |zeta|

It is neither :mod:`.ospa` nor :mod:`.gospa`. As N_c depends on the assignment, the least ratio is
found by Dinkelbach's iteration (On nonlinear fractional programming, 1967): with the best ratio
r so far, a pair gains ``xi^p - r - d^p``; it ends when no assignment lowers r, after a few turns.
The parts ``localisation``, ``missed`` and ``false`` are the roots of the three shares. Two empty
sets are 0 apart, an empty one is ``xi / 2^(1/p)`` from any other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...models.parameters import parameter
from ...models.records import Array
from ..kit.assignment import assign
from ..kit.distance import distance
from ..kit.series import Distance
from ..kit.sets import AlignedSets

SUMMARY = "OSPA divided by the number of different objects, as in joint sensing papers"
PARTS = ("localisation", "missed", "false")


@dataclass(frozen=True, slots=True)
class Params(Distance):
    """Which steps are scored, with which order and gate."""

    cutoff: float = parameter(
        5.0, "m", "gate xi: no pair this far apart is assigned", within="(0, inf)"
    )


def ospa_normalised(aligned: AlignedSets, order: float, cutoff: float) -> dict[str, Array]:
    """The variant (n,) [m] at each step, called ``""``, and its parts by name."""
    pairs = aligned.near(cutoff)
    power, unpaired = pairs.distance**order, cutoff**order / 2
    true, estimated = aligned.counts
    steps = len(aligned)
    total, matches = np.zeros(steps), np.zeros(steps, np.int64)

    def ratio() -> Array:
        sum_ = total + unpaired * (true + estimated - 2 * matches)
        return np.asarray(sum_ / np.maximum(true + estimated - matches, 1))

    best, lower = ratio(), np.full(steps, True)
    while lower.any():
        chosen = assign(pairs, (2 * unpaired - best[pairs.step] - power) * lower[pairs.step])
        new = pairs.step[chosen]
        total = np.where(lower, np.bincount(new, power[chosen], steps), total)
        matches = np.where(lower, np.bincount(new, minlength=steps), matches)
        lower = ratio() < best
        best = np.where(lower, ratio(), best)
    size = np.maximum(true + estimated - matches, 1)
    missed, false = (unpaired * (count - matches) for count in (true, estimated))
    shares = [share / size for share in (total + missed + false, total, missed, false)]
    return {k: v ** (1 / order) for k, v in zip(("", *PARTS), shares, strict=True)}


METRIC = distance("ospa-normalised", SUMMARY, PARTS, ospa_normalised, Params)

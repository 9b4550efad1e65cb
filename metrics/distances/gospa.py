"""Generalised optimal sub-pattern assignment distance, with alpha = 2.

Over assignments of true to estimated positions, of which those left over are missed or false
(Rahmathullah, García-Fernández and Svensson, Generalized optimal sub-pattern assignment metric,
2017, proposition 1)::

    GOSPA = min (sum over pairs of d^p + c^p / 2 (missed + false))^(1/p)

Its parts are ``localisation``, ``missed`` and ``false``, the p-th roots of the three sums; their
p-th powers add up to that of the whole. Two empty sets are 0 apart, n points and none
``c (n / 2)^(1/p)``. ``gospa-rms`` is the root of the mean square over the steps, as the field also
gives it: with p = 2 the squares of its parts add up.
"""

from __future__ import annotations

import numpy as np

from ...models.records import Array, Scores
from ..kit.assignment import matched
from ..kit.measured import Measured, Names, of_sets
from ..kit.series import Distance, mean_stderr, parts
from ..kit.sets import AlignedSets
from ..kit.table import rows
from ..protocol import Metric

PARTS = ("localisation", "missed", "false")


def gospa(aligned: AlignedSets, order: float, cutoff: float) -> dict[str, Array]:
    """GOSPA (n,) [m] at each step, called ``""``, and its parts by name."""
    power, pairs = matched(aligned.near(cutoff), order, cutoff, len(aligned))
    missed, false = (cutoff**order / 2 * (count - pairs) for count in aligned.counts)
    powers = (power + missed + false, power, missed, false)
    return {k: v ** (1 / order) for k, v in zip(("", *PARTS), powers, strict=True)}


def summarise(names: Names, measured: Measured, params: Distance) -> Scores:
    """GOSPA [m] and its parts per step, their means and roots of mean squares."""
    tables = [parts((*names, "gospa"), measured, measured.values, params.block)]
    for part, v in measured.values.items():
        rms = np.sqrt(np.mean(v**2))
        spread = mean_stderr(v**2, params.block) / (2 * rms) if rms else np.nan
        tables.append(rows((*names, "gospa-rms", part), np.nan, rms, len(v), spread))
    return Scores.join(tables)


METRIC = Metric(
    "GOSPA distance (alpha 2) between estimated and true positions, and its parts",
    Distance,
    of_sets(lambda aligned, params: gospa(aligned, params.order, params.cutoff)),
    summarise,
    PARTS=PARTS,
    FOR_SETS=True,
    QUADRATIC=("gospa-rms",),
)

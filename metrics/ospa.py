"""Optimal sub-pattern assignment distance between true and estimated positions.

For m <= n points, with distances cut off at c (Schuhmacher, Vo and Vo, A consistent metric for
performance evaluation of multi-object filters, 2008, eq. 3)::

    OSPA = ((min over permutations of sum d_c(x_i, y_i)^p + c^p (n - m)) / n)^(1/p)

Its parts (eqs. 7 and 8) are ``localisation``, from the sum, and ``cardinality``, from the rest;
their p-th powers add up to that of the whole. Two empty sets are 0 apart, an empty one is c from
any other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..models.records import Scores
from .kit.assignment import matched
from .kit.measured import Measured, Names, of_sets, scorer
from .kit.series import Distance, parts
from .kit.sets import Sets

SUMMARY = "OSPA distance between estimated and true positions, and its parts"
PARTS = ("localisation", "cardinality")
STREAMS = ()
FOR_SETS = True
QUADRATIC = ()
Array = np.ndarray[Any, Any]


@dataclass(frozen=True, slots=True)
class Params(Distance):
    """Which steps are scored, with which order and cut-off."""


def ospa(aligned: Sets, order: float, cutoff: float) -> dict[str, Array]:
    """OSPA (n,) [m] at each step, called ``""``, and its parts by name."""
    power, pairs = matched(aligned.near(cutoff), order, cutoff, len(aligned))
    m, n = np.sort(aligned.counts, axis=0)
    size = np.maximum(n, 1)
    localisation = (power + cutoff**order * (m - pairs)) / size
    cardinality = cutoff**order * (n - m) / size
    powers = (localisation + cardinality, localisation, cardinality)
    return {k: v ** (1 / order) for k, v in zip(("", *PARTS), powers, strict=True)}


def summarise(names: Names, measured: Measured, params: Params) -> Scores:
    """The distance [m] and its parts per step, their means, and the number of steps left out."""
    return parts((*names, "ospa"), measured, measured.values, params.block)


measure = of_sets(lambda aligned, params: ospa(aligned, params.order, params.cutoff))
score = scorer(measure, summarise)

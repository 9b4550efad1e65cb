"""Optimal sub-pattern assignment distance between true and estimated positions.

For m <= n points, with distances cut off at c (Schuhmacher, Vo and Vo, A consistent metric for
performance evaluation of multi-object filters, 2008, eq. 3)::

    OSPA = ((min over permutations of sum d_c(x_i, y_i)^p + c^p (n - m)) / n)^(1/p)

Its parts (eqs. 7 and 8) are ``localisation``, from the sum, and ``cardinality``, from the rest;
their p-th powers add up to that of the whole. Two empty sets are 0 apart, an empty one is c from
any other.
"""

from __future__ import annotations

from ...models.records import Array
from ..kit.assignment import matched, ospa_parts
from ..kit.distance import distance
from ..kit.sets import AlignedSets

SUMMARY = "OSPA distance between estimated and true positions, and its parts"


def ospa(aligned: AlignedSets, order: float, cutoff: float) -> dict[str, Array]:
    """OSPA (n,) [m] at each step, called ``""``, and its parts by name."""
    power, pairs = matched(aligned.near(cutoff), order, cutoff, len(aligned))
    return ospa_parts(power, pairs, aligned.counts, order, cutoff)


METRIC = distance("ospa", SUMMARY, ("localisation", "cardinality"), ospa)

"""Shares and rates after the single integrated air picture: how complete, how clean, how clear.

A true object is *covered* while an estimate is less than the cut-off away, and *tracked* while one
is its own in the optimal assignment of :mod:`.gospa`. Votruba et al., Single integrated air picture
(SIAP) metrics implementation, 2001, counts covered objects; with one estimate for two vessels only
one of them is tracked.

===================  =================================================================
``completeness``     share of true objects that are tracked, over all steps
``coverage``         share of true objects that are covered
``ambiguity``        estimates near a true object, per covered object; 1 is best
``spurious``         share of estimates that are near no true object
``false-objects``    estimates that track no object, per step
``position-error``   mean distance of tracked objects [m]
``label-changes``    how often the label that tracks an object changes, per object
===================  =================================================================

With ``by_object``, completeness and coverage also have a part ``object-<label>`` for each true
object. Every number is a mean over ``n`` things, so recordings pool exactly. What has nothing to be
a mean of is left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..models.parameters import parameter
from ..models.records import Estimates, Recording, Scores
from .assignment import assign
from .series import Pairing
from .sets import Sets, sets
from .table import concatenate, rows

SUMMARY = "completeness, ambiguity, false objects and label changes, after SIAP"
PARTS = ("object-<label>",)
NEEDS_SCANS = False
FOR_SETS = True
QUADRATIC = ()
Array = np.ndarray[Any, Any]


@dataclass(frozen=True, slots=True)
class Params(Pairing):
    """Which steps are scored, with which order and cut-off, and what is told of single objects."""

    by_object: bool = parameter(False, "1", "also completeness and coverage of each true object")


def siap(aligned: Sets, order: float, cutoff: float) -> dict[tuple[str, str], tuple[float, int]]:
    """Sum and number of what each metric and part is the mean of."""
    pairs = aligned.near(cutoff)
    own = pairs.take(assign(pairs, cutoff**order - pairs.distance**order))
    label = aligned.truth.label
    covered, tracked = (np.isin(np.arange(len(label)), p.first) for p in (pairs, own))
    estimates = int(aligned.estimate.row_offset[-1])
    near = len(np.unique(pairs.second))
    names, index, times = np.unique(label, return_inverse=True, return_counts=True)
    found: dict[tuple[str, str], tuple[float, int]] = {}
    for metric, seen in (("completeness", tracked), ("coverage", covered)):
        found[metric, ""] = seen.sum(), len(label)
        for name, *share in zip(names, np.bincount(index, seen), times, strict=True):
            found[metric, f"object-{name}"] = share[0], share[1]
    found["ambiguity", ""] = near, covered.sum()
    found["spurious", ""] = estimates - near, estimates
    found["false-objects", ""] = estimates - len(own), len(aligned)
    found["position-error", ""] = own.distance.sum(), len(own)
    changes = _changes(label[own.first], aligned.estimate.label[own.second])
    found["label-changes", ""] = changes, len(names)
    return found


def _changes(label: Array, tracker: Array) -> int:
    """How often the tracker of a label differs from the one before; both (k,) in order of time."""
    order = np.argsort(label, kind="stable")
    same = np.diff(label[order]) == 0
    return int((same & (np.diff(tracker[order]) != 0)).sum())


def score(estimates: Estimates, recording: Recording, params: Params) -> Scores:
    """The numbers of :func:`siap` as means over the recording.

    Raises
    ------
    InputError : no truth, no positions in common, or nothing to score
    """
    aligned = sets(estimates, recording, params)
    names = recording.meta.name, estimates.estimator
    return concatenate(
        rows((*names, metric, part), np.nan, total / n, n)
        for (metric, part), (total, n) in siap(aligned, params.order, params.cutoff).items()
        if n and (params.by_object or not part)
    )

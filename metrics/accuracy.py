"""Classification of the objects that were found: accuracy and confusion matrix.

An estimate counts for the true object that it is assigned to, below the gate, by the assignment of
:mod:`.ospa`. ``accuracy`` is the share of right classes among them (E. Favarelli et al.,
"Multi-base station cooperative sensing with AI-aided tracking", eq. 19); ``confusion`` has the
parts ``<true>:<estimated>``, the share of the estimated class among the true ones of a class. What
is not assigned has no say in either: ``accuracy-unassigned`` holds the mean numbers of ``missed``
and ``false`` objects in a step.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..models.errors import InputError
from ..models.parameters import parameter
from ..models.records import Estimates, Objects, Recording, Scores
from .assignment import assign
from .series import Distance, mean_stderr
from .sets import sets
from .table import concatenate, rows

SUMMARY = "share of rightly classified objects, and the confusion matrix"
PARTS = ()
NEEDS_SCANS = False
FOR_SETS = True
QUADRATIC = ()
Array = np.ndarray[Any, Any]


@dataclass(frozen=True, slots=True)
class Params(Distance):
    """Which steps are scored, and how near an estimate is to the object that it stands for."""

    cutoff: float = parameter(5.0, "m", "gate: no pair this far apart is assigned")


def score(estimates: Estimates, recording: Recording, params: Params) -> Scores:
    """Accuracy per step and over all, confusion, and the numbers that were not assigned.

    Raises
    ------
    InputError : no truth, no positions in common, no classes, or nothing to score
    """
    aligned = sets(estimates, recording, params)
    truth, estimate = aligned.truth, aligned.estimate
    known = truth.class_names
    true, said = _index(truth, known, "the truth"), _index(estimate, known, "the estimates")
    pairs = aligned.near(params.cutoff)
    chosen = assign(pairs, params.cutoff**params.order - pairs.distance**params.order)
    step, a, b = pairs.step[chosen], true[pairs.first[chosen]], said[pairs.second[chosen]]
    names = recording.meta.name, estimates.estimator

    n = len(aligned)
    assigned, right = np.bincount(step, minlength=n), np.bincount(step[a == b], minlength=n)
    some = assigned > 0
    share = right[some] / assigned[some]
    key = (*names, "accuracy", "")
    tables = [rows(key, aligned.time[some], share, assigned[some])]
    if len(chosen):
        spread = mean_stderr(share, params.block)
        tables.append(rows(key, np.nan, right.sum() / len(chosen), len(chosen), spread))
    for i, class_ in enumerate(known):
        of_class = a == i
        for j, other in enumerate((*known, "other")):
            hits = int((of_class & (b == (j if j < len(known) else -1))).sum())
            if of_class.any() and (j < len(known) or hits):
                where = (*names, "confusion", f"{class_}:{other}")
                tables.append(rows(where, np.nan, hits / of_class.sum(), int(of_class.sum())))
    for part, count in zip(("missed", "false"), aligned.counts, strict=True):
        left = count - assigned
        where = (*names, "accuracy-unassigned", part)
        tables.append(rows(where, np.nan, left.mean(), n, mean_stderr(left, params.block)))
    return concatenate(tables)


def _index(objects: Objects, names: tuple[str, ...], who: str) -> Array:
    """The class of each row as an index into ``names``, -1 for one that is not among them."""
    if objects.class_index is None or not names:
        raise InputError(f"{who} have no classes" if who.endswith("s") else f"{who} has no classes")
    to = [names.index(name) if name in names else -1 for name in objects.class_names]
    return np.asarray(np.array([*to, -1])[objects.class_index])

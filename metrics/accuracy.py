"""Classification of the objects that were found: accuracy and confusion matrix.

An estimate counts for the true object that it is assigned to, below the gate, by the assignment of
:mod:`.distances.ospa`. ``accuracy`` is the share of right classes among them (E. Favarelli et al.,
"Multi-base station cooperative sensing with AI-aided tracking", eq. 19); ``confusion`` has the
parts ``<true>:<estimated>``, the share of the estimated class among the true ones of a class. What
is not assigned has no say in either: ``accuracy-unassigned`` holds the mean numbers of ``missed``
and ``false`` objects in a step.

``class-log-loss`` is minus the logarithm of the probability that the true class was given, in nats.
Who gives C classes the same probability has log C; who is wrong and sure has much more, so that the
mean is least for probabilities that come true as often as they say. I. J. Good, "Rational
decisions", J. R. Stat. Soc. B 14 (1952) 107-114.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..models.errors import InputError
from ..models.parameters import parameter
from ..models.records import Array, Estimates, Objects, Recording, Scores
from .kit.assignment import assign
from .kit.measured import Measured, Names
from .kit.series import Distance, mean_stderr
from .kit.sets import AlignedSets, align
from .kit.table import rows
from .protocol import Metric

SAID = "the estimates"
LEAST = 1e-9
"""Probability that a class is given at least: who says never and errs loses 21 nats."""


@dataclass(frozen=True, slots=True)
class Params(Distance):
    """Which steps are scored, and how near an estimate is to the object that it stands for."""

    cutoff: float = parameter(
        5.0, "m", "gate: no pair this far apart is assigned", within="(0, inf)"
    )


def measure(estimates: Estimates, recording: Recording, params: Params) -> Measured:
    """Per step the assigned, the right, the missed and the false; per class pair how often.

    Raises
    ------
    InputError : no truth, no positions in common, or no classes
    """
    aligned = align(estimates, recording, params)
    known = aligned.truth.class_names
    true, said = index(aligned.truth, known, "the truth"), index(aligned.estimate, known, SAID)
    step, first, second = assigned_pairs(aligned, params)
    a, b = true[first], said[second]
    n = len(aligned)
    assigned, right = np.bincount(step, minlength=n), np.bincount(step[a == b], minlength=n)
    missed, false = (count - assigned for count in aligned.counts)
    values = {"assigned": assigned, "right": right, "missed": missed, "false": false}
    names = np.array([*known, "other"], object)
    lists = {"true": names[a], "said": names[b], "known": names[:-1]}
    return Measured(aligned.time, values, aligned.left_out, lists)


def summarise(names: Names, measured: Measured, params: Params) -> Scores:
    """Accuracy per step and over all, confusion, and the numbers that were not assigned."""
    assigned, right = measured.values["assigned"], measured.values["right"]
    true, said = measured.lists["true"], measured.lists["said"]
    some = assigned > 0
    share = right[some] / assigned[some]
    key = (*names, "accuracy", "")
    tables = [rows(key, measured.time[some], share, assigned[some])]
    if len(true):
        spread = mean_stderr(share, params.block)
        tables.append(rows(key, np.nan, right.sum() / len(true), len(true), spread))
    known = list(dict.fromkeys(measured.lists["known"]))
    for class_ in known:
        of_class = true == class_
        for other in (*known, "other"):
            hits = int((of_class & (said == other)).sum())
            if of_class.any() and (other != "other" or hits):
                where = (*names, "confusion", f"{class_}:{other}")
                tables.append(rows(where, np.nan, hits / of_class.sum(), int(of_class.sum())))
    for part in ("missed", "false"):
        left = measured.values[part]
        where = (*names, "accuracy-unassigned", part)
        spread = mean_stderr(left, params.block)
        tables.append(rows(where, np.nan, left.mean(), len(left), spread))
    return Scores.join(tables)


def assigned_pairs(aligned: AlignedSets, params: Params) -> tuple[Array, Array, Array]:
    """Step, row of the truth and row of the estimates of the objects that were found."""
    pairs = aligned.near(params.cutoff)
    chosen = assign(pairs, params.cutoff**params.order - pairs.distance**params.order)
    return pairs.step[chosen], pairs.first[chosen], pairs.second[chosen]


def index(objects: Objects, names: tuple[str, ...], who: str) -> Array:
    """The class of each row as an index into ``names``, -1 for one that is not among them."""
    if objects.class_index is None or not names:
        raise InputError(f"{who} have no classes" if who.endswith("s") else f"{who} has no classes")
    to = [names.index(name) if name in names else -1 for name in objects.class_names]
    return np.asarray(np.array([*to, -1])[objects.class_index])


METRIC = Metric(
    "share of rightly classified objects, and the confusion matrix",
    Params,
    measure,
    summarise,
    ROWS=("confusion",),
    FOR_SETS=True,
)


def measure_loss(estimates: Estimates, recording: Recording, params: Params) -> Measured:
    """Per step the number of the objects found, and the sum of their losses.

    Raises
    ------
    InputError : no truth, no positions in common, no classes, or none with probabilities
    """
    aligned = align(estimates, recording, params)
    truth, said = aligned.truth, aligned.estimate
    true = index(truth, truth.class_names, "the truth")
    if said.class_index is None or said.class_probability is None:
        raise InputError(f"{SAID} have no probabilities of classes")
    names = [said.class_names.index(n) if n in said.class_names else -1 for n in truth.class_names]
    step, first, second = assigned_pairs(aligned, params)
    # A column of zeros is what the index -1 picks: of classes that the estimates do not know.
    p = np.hstack((said.class_probability, np.zeros((len(said.class_probability), 1))))
    column = np.array([*names, -1])[true[first]]
    loss = -np.log(np.maximum(p[second, column], LEAST))
    n = len(aligned)
    values = {"found": np.bincount(step, minlength=n), "loss": np.bincount(step, loss, n)}
    return Measured(aligned.time, values, aligned.left_out, {})


def summarise_loss(names: Names, measured: Measured, params: Params) -> Scores:
    """The mean loss per step and over all objects that were found [nats]."""
    found, loss = measured.values["found"], measured.values["loss"]
    some = found > 0
    share = loss[some] / found[some]
    key = (*names, "class-log-loss", "")
    tables = [rows(key, measured.time[some], share, found[some])]
    if some.any():
        spread, total = mean_stderr(share, params.block), int(found.sum())
        tables.append(rows(key, np.nan, loss.sum() / total, total, spread))
    return Scores.join(tables)


LOG_LOSS = Metric(
    "log-loss of the probabilities of classes [nats], of the objects found",
    Params,
    measure_loss,
    summarise_loss,
    FOR_SETS=True,
)

"""Shares and rates after the single integrated air picture: how complete, how clean, how clear.

A true object is *covered* while an estimate is less than the cut-off away, and *tracked* while one
is its own in the optimal assignment of :mod:`.distances.gospa`. Votruba et al., Single integrated
air picture (SIAP) metrics implementation, 2001, counts covered objects; with one estimate for two
vessels only one of them is tracked.

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

import numpy as np

from ..models.parameters import parameter
from ..models.records import Array, Estimates, Recording, Scores
from .kit.assignment import assign
from .kit.measured import Measured, Names
from .kit.series import Pairing
from .kit.sets import align
from .kit.table import rows
from .protocol import Metric


@dataclass(frozen=True, slots=True)
class Params(Pairing):
    """Which steps are scored, with which order and cut-off, and whether object by object."""

    by_object: bool = parameter(False, "1", "also completeness and coverage of each true object")


def measure(estimates: Estimates, recording: Recording, params: Params) -> Measured:
    """Per step how many are there, tracked, covered and near; lists by object, and who tracks.

    Raises
    ------
    InputError : no truth, or no positions in common
    """
    aligned = align(estimates, recording, params)
    pairs = aligned.near(params.cutoff)
    gain = params.cutoff**params.order - pairs.distance**params.order
    own = pairs.take(assign(pairs, gain))
    label, n = aligned.truth.label, len(aligned)
    covered, tracked = (np.isin(np.arange(len(label)), p.first) for p in (pairs, own))
    near = np.unique(np.stack((pairs.step, pairs.second)), axis=1)[0]
    true, estimated = aligned.counts
    values = {
        "true": true,
        "estimated": estimated,
        "tracked": np.bincount(own.step, minlength=n),
        "covered": np.bincount(np.repeat(np.arange(n), true)[covered], minlength=n),
        "near": np.bincount(near, minlength=n),
        "distance": np.bincount(own.step, own.distance, n),
    }
    names, index, times = np.unique(label, return_inverse=True, return_counts=True)
    lists = {
        "object": names,
        "times": times,
        "object tracked": np.bincount(index, tracked, len(names)),
        "object covered": np.bincount(index, covered, len(names)),
        "owner": label[own.first],
        "tracker": aligned.estimate.label[own.second],
    }
    return Measured(aligned.time, values, aligned.left_out, lists)


def siap(measured: Measured) -> dict[tuple[str, str], tuple[float, int]]:
    """Sum and number of what each metric and part is the mean of."""
    total, lists = {name: v.sum() for name, v in measured.values.items()}, measured.lists
    names, index = np.unique(lists["object"], return_inverse=True)
    times = np.bincount(index, lists["times"]).astype(int)
    found: dict[tuple[str, str], tuple[float, int]] = {}
    for metric, seen in (("completeness", "tracked"), ("coverage", "covered")):
        found[metric, ""] = total[seen], total["true"]
        each = np.bincount(index, lists[f"object {seen}"])
        for name, *share in zip(names, each, times, strict=True):
            found[metric, f"object-{name}"] = share[0], share[1]
    found["ambiguity", ""] = total["near"], total["covered"]
    found["spurious", ""] = total["estimated"] - total["near"], total["estimated"]
    found["false-objects", ""] = total["estimated"] - total["tracked"], len(measured)
    found["position-error", ""] = total["distance"], total["tracked"]
    found["label-changes", ""] = _changes(lists["owner"], lists["tracker"]), len(names)
    return found


def _changes(label: Array, tracker: Array) -> int:
    """How often the tracker of a label differs from the one before; both (k,) in order of time."""
    order = np.argsort(label, kind="stable")
    same = np.diff(label[order]) == 0
    return int((same & (np.diff(tracker[order]) != 0)).sum())


def summarise(names: Names, measured: Measured, params: Params) -> Scores:
    """The numbers of :func:`siap` as means over the recording."""
    return Scores.join(
        rows((*names, metric, part), np.nan, total / n, n)
        for (metric, part), (total, n) in siap(measured).items()
        if n and (params.by_object or not part)
    )


METRIC = Metric(
    "completeness, ambiguity, false objects and label changes, after SIAP",
    Params,
    measure,
    summarise,
    ROWS=(
        "completeness",
        "coverage",
        "ambiguity",
        "spurious",
        "false-objects",
        "position-error",
        "label-changes",
    ),
    PARTS=("object-<label>",),
    FOR_SETS=True,
)

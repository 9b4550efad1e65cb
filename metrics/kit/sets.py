"""Estimated and true objects at the same times, as sets.

At a time between two of the truth, those objects are there that stand in both, interpolated
linearly. A step is left out, and counted, where the truth is not known: before its first time,
after its last, or between two that are more than ``max_gap`` apart. An empty set is known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...models.errors import InputError
from ...models.records import Array, Estimates, Objects, Recording
from .alignment import Scored, blend, bracket, seconds
from .assignment import CandidatePairs, near
from .errors import axes


@dataclass(frozen=True, slots=True, eq=False)
class AlignedSets:
    """The scored steps at ``time`` (n,) [s]: true and estimated objects.

    ``steps`` (n,) are their indices among those of the estimates. ``truth`` and ``estimate`` have
    n steps; ``position_truth`` (a, d) and ``position_estimate`` (b, d) [m] are the positions of
    their rows; ``left_out`` counts steps without truth.
    """

    time: Array
    steps: Array
    truth: Objects
    estimate: Objects
    position_truth: Array
    position_estimate: Array
    left_out: int

    def __len__(self) -> int:
        return len(self.time)

    @property
    def counts(self) -> tuple[Array, Array]:
        """Numbers of true and of estimated objects at each step, (n,) each."""
        return np.diff(self.truth.row_offset), np.diff(self.estimate.row_offset)

    def near(self, cutoff: float) -> CandidatePairs:
        """All pairs of a true (first) and an estimated object (second) below ``cutoff`` [m]."""
        offsets = self.truth.row_offset, self.estimate.row_offset
        return near(self.position_truth, offsets[0], self.position_estimate, offsets[1], cutoff)


def sets(estimates: Estimates, recording: Recording, scored: Scored) -> AlignedSets:
    """The scored steps of ``estimates`` beside the truth of ``recording``, one at least.

    Raises
    ------
    InputError : no truth, no positions in common, or nothing left to score
    """
    aligned = align(estimates, recording, scored)
    if not len(aligned):
        raise InputError(f"{recording.meta.name}: no step to be scored has a truth")
    return aligned


def align(estimates: Estimates, recording: Recording, scored: Scored) -> AlignedSets:
    """The scored steps of ``estimates`` beside the truth of ``recording``, perhaps none.

    Raises
    ------
    InputError : no truth, or no positions in common
    """
    if recording.truth is None:
        raise InputError(f"{recording.meta.name}: the recording has no truth")
    truth, objects = recording.truth.objects, estimates.objects
    names = axes("centre", truth, objects)
    if len(names) < 2:
        raise InputError(f"{recording.meta.name}: truth and estimates have no x y in common")
    inside = scored.contains(objects.time_ns)
    known = np.zeros(len(inside), bool)
    before = after = np.zeros(len(inside), np.int64)
    w = np.zeros(len(inside))
    if len(truth.time_ns):
        before, after, w, known = bracket(truth.time_ns, objects.time_ns, scored)
    steps = np.flatnonzero(inside & known)
    time_ns = objects.time_ns[steps]
    true = _between(truth, before[steps], after[steps], w[steps], time_ns)
    estimated = objects.at(steps)
    return AlignedSets(
        seconds(time_ns),
        steps,
        true,
        estimated,
        true.columns(*names),
        estimated.columns(*names),
        int((inside & ~known).sum()),
    )


def _between(truth: Objects, before: Array, after: Array, w: Array, time_ns: Array) -> Objects:
    """The objects that stand in both of two steps (k,), with weight ``w`` (k,) of the second."""
    labels, label = np.unique(truth.label, return_inverse=True)
    step = np.repeat(np.arange(len(truth.time_ns)), np.diff(truth.row_offset))
    key = step * len(labels) + label
    order = np.argsort(key)
    rows, count = truth.rows_of(before)
    k = np.repeat(np.arange(len(before)), count)
    wanted = after[k] * len(labels) + label[rows]
    found = np.searchsorted(key[order], wanted).clip(max=len(key) - 1)
    both = key[order[found]] == wanted if len(key) else np.zeros(0, bool)
    counts = np.bincount(k[both], minlength=len(before))
    first = truth.take(rows[both], time_ns, counts)
    second = truth.take(order[found[both]], time_ns, counts)
    return blend(first, second, w[k[both]])

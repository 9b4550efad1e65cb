"""Estimated and true objects at the same times, as sets.

Every true object is interpolated between samples of its own (:func:`.alignment.at_times`). A step
is left out, and counted, where the truth is not known: before its first time, after its last, or
between two that are more than ``max_gap`` apart. An empty set is known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...models.errors import InputError
from ...models.records import Array, Estimates, Objects, Recording
from .alignment import Scored, at_times, is_known, seconds, settle
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
    settled = settle(scored, truth)
    gap, own = settled.max_gap, bool(settled.own_times)
    assert gap is not None
    known = is_known(truth, objects.time_ns, gap)
    steps = np.flatnonzero(inside & known)
    true = at_times(truth, objects.time_ns[steps], gap, own)
    estimated = objects.at(steps)
    return AlignedSets(
        seconds(true.time_ns),
        steps,
        true,
        estimated,
        true.columns(*names),
        estimated.columns(*names),
        int((inside & ~known).sum()),
    )

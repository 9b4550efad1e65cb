"""Estimates of one object and the truth at the same times.

Truth is interpolated linearly to the time of each estimate. A step is left out, and counted, if
the truth has no sample there, nor two around it at most ``max_gap`` apart, or if there is no
estimate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...models.errors import InputError
from ...models.parameters import parameter, require
from ...models.records import Array, Estimates, Objects, Recording


@dataclass(frozen=True, slots=True)
class Scored:
    """Which steps are scored."""

    max_gap: float = parameter(
        1.0, "s", "longest gap of the truth that is interpolated", within="[0, inf)"
    )
    skip: int = parameter(0, "1", "number of first steps that are not scored", within="[0, inf)")
    start: float | None = parameter(None, "s", "first time that is scored")
    stop: float | None = parameter(None, "s", "last time that is scored")

    def __post_init__(self) -> None:
        if self.start is not None and self.stop is not None:
            require(self.start <= self.stop, "stop", "start or later", self.stop)

    def contains(self, time_ns: Array) -> Array:
        """Which of the steps at ``time_ns`` (n,) are scored, as (n,) bool."""
        time = seconds(time_ns)
        inside = np.arange(len(time)) >= self.skip
        if self.start is not None:
            inside &= time >= self.start
        if self.stop is not None:
            inside &= time <= self.stop
        return inside


@dataclass(frozen=True, slots=True)
class ScoredObject(Scored):
    """Which steps are scored, and against which object."""

    object: int = parameter(-1, "1", "label of the truth object, -1 for the only one")


@dataclass(frozen=True, slots=True, eq=False)
class AlignedTrack:
    """Estimate and truth row by row at ``time`` (k,) [s], and how many steps were left out."""

    time: Array
    estimate: Objects
    truth: Objects
    left_out: int


def seconds(time_ns: Array) -> Array:
    """Nanoseconds as correctly rounded seconds."""
    return np.asarray(time_ns) / 1e9


def pairs(estimates: Estimates, recording: Recording, scored: ScoredObject) -> AlignedTrack:
    """The scored steps of ``estimates`` beside the truth of ``recording``, one at least.

    Raises
    ------
    InputError : no truth, several objects where one is scored, or nothing left to score
    """
    aligned = pair_up(estimates, recording, scored)
    if not len(aligned.time):
        raise InputError(f"{recording.meta.name}: no step to be scored has truth and estimate")
    return aligned


def pair_up(estimates: Estimates, recording: Recording, scored: ScoredObject) -> AlignedTrack:
    """The scored steps of ``estimates`` beside the truth of ``recording``, perhaps none.

    Raises
    ------
    InputError : no truth, or several objects where one is scored
    """
    objects = estimates.objects
    count = np.diff(objects.row_offset)
    if count.max(initial=0) > 1:
        raise InputError(f"{estimates.meta.name}: a step with several objects, one can be scored")
    inside = scored.contains(objects.time_ns)
    if recording.truth is not None and not _has(recording.truth.objects, scored.object):
        empty = objects.part(0, 0), recording.truth.objects.part(0, 0)
        return AlignedTrack(seconds(objects.time_ns[:0]), *empty, int(inside.sum()))
    truth, known = interpolate(recording, objects.time_ns, scored)
    chosen = inside & known & (count == 1)
    steps = np.flatnonzero(chosen)
    estimate, true = objects.at(steps), truth.at(steps)
    return AlignedTrack(seconds(estimate.time_ns), estimate, true, int((inside & ~chosen).sum()))


def _has(truth: Objects, label: int) -> bool:
    """Whether the object, or for -1 any, is there at some time."""
    return len(truth.label) > 0 if label < 0 else bool((truth.label == label).any())


def interpolate(
    recording: Recording, time_ns: Array, scored: ScoredObject
) -> tuple[Objects, Array]:
    """The true object at ``time_ns`` (n,), and at which of them it is known (n,)."""
    if recording.truth is None:
        raise InputError(f"{recording.meta.name}: the recording has no truth")
    truth = recording.truth.objects
    labels = np.unique(truth.label).tolist()
    label = labels[0] if scored.object < 0 and len(labels) == 1 else scored.object
    if label not in labels:
        raise InputError(
            f"{recording.meta.name}: choose the true object by object=, one of {labels}"
        )
    mine = truth.label == label
    t = np.repeat(truth.time_ns, np.diff(truth.row_offset))[mine]
    before, after, w, known = bracket(t, time_ns, scored)
    rows = np.flatnonzero(mine)
    first, second = (truth.take(rows[i], time_ns) for i in (before, after))
    return blend(first, second, w), known


def bracket(t: Array, time_ns: Array, scored: Scored) -> tuple[Array, Array, Array, Array]:
    """The samples of ``t`` (m,), increasing, around ``time_ns`` (n,).

    The index before, the index after, the weight of the latter, and whether both are there and at
    most ``max_gap`` apart, all (n,). A sample at the very time is both.
    """
    after = np.searchsorted(t, time_ns).clip(max=len(t) - 1)
    before = np.where(t[after] == time_ns, after, after - 1).clip(min=0)
    gap = t[after] - t[before]
    known = (t[before] <= time_ns) & (time_ns <= t[after]) & (gap <= scored.max_gap * 1e9)
    return before, after, np.where(gap > 0, (time_ns - t[before]) / np.maximum(gap, 1), 0.0), known


def blend(first: Objects, second: Objects, w: Array) -> Objects:
    """``first`` moved towards ``second`` by the share ``w`` (m,), row by row.

    Ellipses rotate the shorter way; columns without values between two are those of ``first``.
    """

    def between(a: Array, b: Array, period: float = np.inf) -> Array:
        step = b - a
        if np.isfinite(period):
            step = (step + period / 2) % period - period / 2
        return np.asarray(a + w.reshape(-1, *(1,) * (a.ndim - 1)) * step)

    moved = replace(first, state=between(first.state, second.state))
    if first.semi_axes is not None and second.semi_axes is not None:
        moved = replace(moved, semi_axes=between(first.semi_axes, second.semi_axes))
    if first.rotation is not None and second.rotation is not None and first.rotation.ndim == 1:
        moved = replace(moved, rotation=between(first.rotation, second.rotation, np.pi))
    return moved

"""Truth at the times of estimates, and estimates of one object beside it.

The truth is interpolated linearly between its times, over gaps up to ``max_gap``; where objects
have times of their own (``own_times``), each between its own. A step is left out, and counted, if
the truth has no sample there, nor two around it that close, or, of a single object, if there is no
estimate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ...models.errors import InputError
from ...models.parameters import parameter, require
from ...models.records import Array, Estimates, Objects, Recording

S = TypeVar("S", bound="Scored")


@dataclass(frozen=True, slots=True)
class Scored:
    """Which steps are scored."""

    max_gap: float | None = parameter(
        None, "s", "longest gap of the truth that is interpolated; null: by its rate", "[0, inf)"
    )
    own_times: bool | None = parameter(
        None, "1", "true objects have times of their own; null: if the first ones do"
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
    estimate, true = (o.at(np.flatnonzero(chosen)) for o in (objects, truth))
    return AlignedTrack(seconds(estimate.time_ns), estimate, true, int((inside & ~chosen).sum()))


def _has(truth: Objects, label: int) -> bool:
    """Whether the object, or for -1 any, is there at some time."""
    return len(truth.label) > 0 if label < 0 else bool((truth.label == label).any())


def interpolate(
    recording: Recording, time_ns: Array, scored: ScoredObject
) -> tuple[Objects, Array]:
    """The true object at those of ``time_ns`` (n,) at which it is known, and which these are (n,).

    Raises
    ------
    InputError : no truth, or several objects where one is scored
    """
    if recording.truth is None:
        raise InputError(f"{recording.meta.name}: the recording has no truth")
    truth = recording.truth.objects
    labels = np.unique(truth.label).tolist()
    label = labels[0] if scored.object < 0 and len(labels) == 1 else scored.object
    if label not in labels:
        raise InputError(
            f"{recording.meta.name}: choose the true object by object=, one of {labels}"
        )
    rows = np.flatnonzero(truth.label == label)
    step = np.searchsorted(truth.row_offset, rows, side="right") - 1
    gap = settle(scored, truth).max_gap
    assert gap is not None
    found = at_times(truth.take(rows, truth.time_ns[step]), time_ns, gap, own=True)
    return found, np.diff(found.row_offset) > 0


HEAD = 4000
"""Times of the truth that tell its rate, so that recordings of any length tell it alike."""
_USUAL = 0.9
"""Share of the intervals that the usual one is not shorter than."""
_INTERVALS = 4
"""Intervals of an object from which on they tell of times of its own."""


def settle(scored: S, truth: Objects) -> S:
    """``scored`` with all that follows from the truth, of which the first :data:`HEAD` times count.

    Objects have times of their own if almost all intervals of one hold times of others alone. A
    gap is interpolated if it is at most half as long again as the usual interval: between times
    of the truth, or those of the object with the longest.
    """
    if scored.max_gap is not None and scored.own_times is not None:
        return scored
    head = truth.part(0, min(HEAD, len(truth.time_ns)))
    step = np.repeat(np.arange(len(head.time_ns)), np.diff(head.row_offset))
    order = np.lexsort((step, head.label))
    same = np.diff(head.label[order]) == 0
    label, first, last = head.label[order][1:][same], step[order][:-1][same], step[order][1:][same]
    by_object = [label == name for name in np.unique(label)]
    own = scored.own_times
    if own is None:
        foreign = [(last - first)[of] > 1 for of in by_object if of.sum() >= _INTERVALS]
        own = any(np.mean(f) >= _USUAL for f in foreign)
    interval = head.time_ns[last] - head.time_ns[first]
    among = [interval[of] for of in by_object] if own else [np.diff(head.time_ns)]
    usual = max((np.quantile(i, _USUAL, method="higher") for i in among if len(i)), default=0)
    gap = 1.5 * float(usual) / 1e9 if scored.max_gap is None else scored.max_gap
    return replace(scored, max_gap=gap, own_times=own)


def at_times(truth: Objects, time_ns: Array, gap: float, own: bool) -> Objects:
    """The objects at ``time_ns`` (n,), increasing, between two samples at most ``gap`` [s] apart.

    These are at consecutive times of the truth, or, with times of their ``own``, consecutive
    ones of the object between which the truth is not empty. A sample without such a successor
    counts at its own time alone.
    """
    step = np.repeat(np.arange(len(truth.time_ns)), np.diff(truth.row_offset))
    first = np.lexsort((step, truth.label))
    last = np.roll(first, -1)
    t, following = truth.time_ns[step[first]], truth.time_ns[step[last]]
    empty = np.append(0, np.cumsum(np.diff(truth.row_offset) == 0))
    linked = (truth.label[first] == truth.label[last]) & (step[last] > step[first])
    linked &= (following - t <= gap * 1e9) & (empty[step[first]] == empty[step[last]])
    if not own:
        linked &= step[last] == step[first] + 1
    last = np.where(linked, last, first)
    # A sample has the times from `start` to `stop` of those asked for.
    start = np.searchsorted(time_ns, t)
    stop = np.searchsorted(time_ns, np.where(linked, following, t + 1))
    count = stop - start
    sample = np.repeat(np.arange(len(first)), count)
    at = np.arange(len(sample)) - np.repeat(np.cumsum(count) - count, count) + start[sample]
    by_time = np.lexsort((first[sample], at))
    sample, at = sample[by_time], at[by_time]
    length = np.where(linked, following - t, 1)[sample]
    counts = np.bincount(at, minlength=len(time_ns))
    before, after = (truth.take(rows[sample], time_ns, counts) for rows in (first, last))
    return blend(before, after, (time_ns[at] - t[sample]) / length)


def is_known(truth: Objects, time_ns: Array, gap: float) -> Array:
    """Whether ``time_ns`` (n,) lie between times of the truth at most ``gap`` [s] apart."""
    t = truth.time_ns
    if not len(t):
        return np.zeros(len(time_ns), bool)
    after = np.searchsorted(t, time_ns).clip(max=len(t) - 1)
    before = np.where(t[after] == time_ns, after, after - 1).clip(min=0)
    inside = (t[before] <= time_ns) & (time_ns <= t[after])
    return np.asarray(inside & (t[after] - t[before] <= gap * 1e9))


def blend(first: Objects, second: Objects, w: Array) -> Objects:
    """``first`` moved towards ``second`` by the share ``w`` (m,), row by row.

    Ellipses and headings rotate the shorter way; columns without values between two are those of
    ``first``.
    """

    def between(a: Array, b: Array, period: float = np.inf) -> Array:
        step = b - a
        if np.isfinite(period):
            step = (step + period / 2) % period - period / 2
        return np.asarray(a + w.reshape(-1, *(1,) * (a.ndim - 1)) * step)

    state = between(first.state, second.state)
    if "heading" in first.state_names:
        k = first.state_names.index("heading")
        state[:, k] = between(first.state[:, k], second.state[:, k], 2 * np.pi)
    moved = replace(first, state=state)
    if first.semi_axes is not None and second.semi_axes is not None:
        moved = replace(moved, semi_axes=between(first.semi_axes, second.semi_axes))
    if first.rotation is not None and second.rotation is not None and first.rotation.ndim == 1:
        moved = replace(moved, rotation=between(first.rotation, second.rotation, np.pi))
    return moved

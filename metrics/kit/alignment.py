"""Estimates of one object and the truth at the same times.

Truth is interpolated linearly to the time of each estimate. A step is left out, and counted, if
the truth has no sample there, nor two around it at most ``max_gap`` apart, or if there is no
estimate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...models.errors import InputError
from ...models.parameters import parameter, require
from ...models.records import Array, Estimates, Objects, Recording


@dataclass(frozen=True, slots=True)
class Span:
    """Which steps are scored."""

    max_gap: float = parameter(1.0, "s", "longest gap of the truth that is interpolated")
    skip: int = parameter(0, "1", "number of first steps that are not scored")
    start: float | None = parameter(None, "s", "first time that is scored")
    stop: float | None = parameter(None, "s", "last time that is scored")

    def __post_init__(self) -> None:
        require(self.max_gap >= 0, "max_gap", "at least 0", self.max_gap)
        require(self.skip >= 0, "skip", "at least 0", self.skip)
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
class Window(Span):
    """Which steps are scored, and against which object."""

    object: int = parameter(-1, "1", "label of the truth object, -1 for the only one")


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Estimate and truth row by row at ``time`` (k,) [s], and how many steps were left out."""

    time: Array
    estimate: Objects
    truth: Objects
    left_out: int


def seconds(time_ns: Array) -> Array:
    """Nanoseconds as correctly rounded seconds."""
    return np.asarray(time_ns) / 1e9


def pairs(estimates: Estimates, recording: Recording, window: Window) -> Pairs:
    """The scored steps of ``estimates`` beside the truth of ``recording``, one at least.

    Raises
    ------
    InputError : no truth, several objects where one is scored, or nothing left to score
    """
    aligned = pair_up(estimates, recording, window)
    if not len(aligned.time):
        raise InputError(f"{recording.meta.name}: no step to be scored has truth and estimate")
    return aligned


def pair_up(estimates: Estimates, recording: Recording, window: Window) -> Pairs:
    """The scored steps of ``estimates`` beside the truth of ``recording``, perhaps none.

    Raises
    ------
    InputError : no truth, or several objects where one is scored
    """
    objects = estimates.objects
    count = np.diff(objects.row_offset)
    if count.max(initial=0) > 1:
        raise InputError(f"{estimates.meta.name}: a step with several objects, one can be scored")
    inside = window.contains(objects.time_ns)
    if recording.truth is not None and not _has(recording.truth.objects, window.object):
        none, time = np.zeros(0, np.int64), objects.time_ns[:0]
        empty = take(objects, none, time), take(recording.truth.objects, none, time)
        return Pairs(seconds(time), *empty, int(inside.sum()))
    truth, known = interpolate(recording, objects.time_ns, window)
    scored = inside & known & (count == 1)
    return Pairs(
        seconds(objects.time_ns[scored]),
        take(objects, objects.row_offset[:-1][scored], objects.time_ns[scored]),
        take(truth, np.flatnonzero(scored), objects.time_ns[scored]),
        int((inside & ~scored).sum()),
    )


def _has(truth: Objects, label: int) -> bool:
    """Whether the object, or for -1 any, is there at some time."""
    return len(truth.label) > 0 if label < 0 else bool((truth.label == label).any())


def take(objects: Objects, rows: Array, time_ns: Array) -> Objects:
    """The given rows (k,) of ``objects``, one at each time (k,)."""
    optional = ("covariance", "existence", "class_index", "class_probability", "semi_axes")
    columns: dict[str, Any] = {
        name: None if getattr(objects, name) is None else getattr(objects, name)[rows]
        for name in ("label", "state", *optional, "rotation")
    }
    return replace(objects, time_ns=time_ns, row_offset=np.arange(len(rows) + 1), **columns)


def interpolate(recording: Recording, time_ns: Array, window: Window) -> tuple[Objects, Array]:
    """The true object at ``time_ns`` (n,), and at which of them it is known (n,)."""
    if recording.truth is None:
        raise InputError(f"{recording.meta.name}: the recording has no truth")
    truth = recording.truth.objects
    labels = np.unique(truth.label).tolist()
    label = labels[0] if window.object < 0 and len(labels) == 1 else window.object
    if label not in labels:
        raise InputError(
            f"{recording.meta.name}: choose the true object by object=, one of {labels}"
        )
    mine = truth.label == label
    t = np.repeat(truth.time_ns, np.diff(truth.row_offset))[mine]
    before, after, w, known = bracket(t, time_ns, window)
    rows = np.flatnonzero(mine)
    first, second = (take(truth, rows[i], time_ns) for i in (before, after))
    return blend(first, second, w), known


def bracket(t: Array, time_ns: Array, span: Span) -> tuple[Array, Array, Array, Array]:
    """The samples of ``t`` (m,), increasing, around ``time_ns`` (n,).

    The index before, the index after, the weight of the latter, and whether both are there and at
    most ``max_gap`` apart, all (n,). A sample at the very time is both.
    """
    after = np.searchsorted(t, time_ns).clip(max=len(t) - 1)
    before = np.where(t[after] == time_ns, after, after - 1).clip(min=0)
    gap = t[after] - t[before]
    known = (t[before] <= time_ns) & (time_ns <= t[after]) & (gap <= span.max_gap * 1e9)
    return before, after, np.where(gap > 0, (time_ns - t[before]) / np.maximum(gap, 1), 0.0), known


def blend(first: Objects, second: Objects, w: Array) -> Objects:
    """``first`` moved towards ``second`` by the share ``w`` (m,), row by row.

    Ellipses turn the shorter way; what has no value between two is that of ``first``.
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

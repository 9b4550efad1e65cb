"""Measures over some consecutive steps, so that long recordings pass in windows.

A metric that goes by steps is two functions: ``measure(estimates, recording, params)`` over any
window of them, and ``summarise(names, measured, params)`` over all that was measured.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...models.errors import InputError
from ...models.records import Array, Estimates, Recording, Scores
from .alignment import AlignedTrack, pair_up
from .sets import AlignedSets, align

Names = tuple[str, str]
"""Recording and estimator."""


@dataclass(frozen=True, slots=True, eq=False)
class Measured:
    """Values at the scored steps, at ``time`` (n,) [s], and how many steps were ``left_out``.

    ``values`` (n, ...) are those per step by part; ``lists`` (any length) is what else is needed.
    """

    time: Array
    values: Mapping[str, Array]
    left_out: int
    lists: Mapping[str, Array] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.time)


Measure = Callable[[Estimates, Recording, Any], Measured]
Summarise = Callable[[Names, Measured, Any], Scores]


def of_sets(values: Callable[[AlignedSets, Any], Mapping[str, Array]]) -> Measure:
    """The measure whose values per step are those of sets."""

    def measure(estimates: Estimates, recording: Recording, params: Any) -> Measured:
        aligned = align(estimates, recording, params)
        found = values(aligned, params) if len(aligned) else {}
        return Measured(aligned.time, found, aligned.left_out)

    return measure


def of_track(values: Callable[[AlignedTrack, Any], Mapping[str, Array]]) -> Measure:
    """The measure whose values per step are those of one object; ``label`` lists its labels."""

    def measure(estimates: Estimates, recording: Recording, params: Any) -> Measured:
        aligned = pair_up(estimates, recording, params)
        found = values(aligned, params) if len(aligned.time) else {}
        lists = {"label": np.unique(aligned.truth.label)}
        return Measured(aligned.time, found, aligned.left_out, lists)

    return measure


def join(parts: Sequence[Measured]) -> Measured:
    """Consecutive windows as one; those without a scored step only count theirs as left out."""
    some = [p for p in parts if len(p)]
    left_out = sum(p.left_out for p in parts)
    if not some:
        return Measured(np.zeros(0), {}, left_out)
    values, lists = (
        {
            key: np.concatenate([getattr(p, name)[key] for p in some])
            for key in getattr(some[0], name)
        }
        for name in ("values", "lists")
    )
    return Measured(np.concatenate([p.time for p in some]), values, left_out, lists)


def finish(summarise: Summarise, names: Names, parts: Sequence[Measured], params: Any) -> Scores:
    """The scores of the measures over all windows.

    Raises
    ------
    InputError : there is nothing to score, or there are several objects where one is scored
    """
    whole = join(parts)
    if not len(whole):
        raise InputError(f"{names[0]}: no step to be scored has truth and estimate")
    if getattr(params, "object", 0) < 0 and len(labels := np.unique(whole.lists["label"])) > 1:
        raise InputError(f"{names[0]}: choose the true object by object=, one of {labels.tolist()}")
    return summarise(names, whole, params)

"""Cumulative distribution of the position error.

A row holds the fraction of the steps (``n``) whose error is at most a threshold, which stands in
the part: ``device<=0.1`` is the fraction with at most 0.1 m. On a fixed grid of thresholds the
distribution over several recordings is exactly the mean of theirs, weighted by their steps;
quantiles would not pool.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..models.parameters import parameter, require
from ..models.records import Estimates, Recording, Scores
from .alignment import Window, pairs
from .errors import check_parts, chosen, error
from .table import concatenate, rows

SUMMARY = "cumulative distribution of the position error over the steps"
PARTS = ("device", "centre")
NEEDS_SCANS = False
FOR_SETS = False
QUADRATIC = ()
GRID = (0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0)


@dataclass(frozen=True, slots=True)
class Params(Window):
    """What is scored, and the thresholds."""

    parts: tuple[str, ...] = parameter((), "1", "device, centre; empty: all there are")
    thresholds: tuple[float, ...] = parameter(
        GRID, "m", "errors at which the distribution is given"
    )

    def __post_init__(self) -> None:
        Window.__post_init__(self)
        check_parts(self.parts, PARTS)
        require(
            min(self.thresholds, default=-1.0) >= 0, "thresholds", "at least 0", self.thresholds
        )


def score(estimates: Estimates, recording: Recording, params: Params) -> Scores:
    """The fraction of steps whose error is at most each threshold.

    Raises
    ------
    InputError : no truth, several objects, a part that is missing, or nothing to score
    """
    aligned = pairs(estimates, recording, params)
    tables = []
    for part in chosen(params.parts, PARTS, aligned):
        e = error(part, aligned)
        for threshold in sorted(set(params.thresholds)):
            key = (recording.meta.name, estimates.estimator, "cdf", f"{part}<={threshold:g}")
            tables.append(rows(key, np.nan, np.mean(e <= threshold), len(e)))
    return concatenate(tables)

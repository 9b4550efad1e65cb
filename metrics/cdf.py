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
from ..models.records import Scores
from .kit.alignment import ScoredObject
from .kit.errors import errors
from .kit.measured import Measured, Names, of_track
from .kit.table import rows
from .protocol import Metric

PARTS = ("device", "centre")
GRID = (0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0)


@dataclass(frozen=True, slots=True)
class Params(ScoredObject):
    """The parts that are scored, and the thresholds."""

    parts: tuple[str, ...] = parameter(
        (), "1", "device, centre; empty: all there are", within=PARTS
    )
    thresholds: tuple[float, ...] = parameter(
        GRID, "m", "errors at which the distribution is given", within="[0, inf)"
    )

    def __post_init__(self) -> None:
        ScoredObject.__post_init__(self)
        require(len(self.thresholds) > 0, "thresholds", "at least one", self.thresholds)


def summarise(names: Names, measured: Measured, params: Params) -> Scores:
    """The fraction of steps whose error is at most each threshold."""
    return Scores.join(
        rows((*names, "cdf", f"{part}<={threshold:g}"), np.nan, np.mean(e <= threshold), len(e))
        for part, e in measured.values.items()
        for threshold in sorted(set(params.thresholds))
    )


METRIC = Metric(
    "cumulative distribution of the position error over the steps",
    Params,
    of_track(lambda aligned, params: errors(params.parts, PARTS, aligned)),
    summarise,
    PARTS=PARTS,
)

"""Times per step, as scores: they never stand in estimates, which are equal for equal inputs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ..formats.provenance import versions
from ..metrics.kit.table import rows
from ..models.records import Scores
from .estimate import Timing

METRIC = "time-per-step"


def scores(timings: Iterable[Timing]) -> Scores:
    """The seconds of every step, and for each recording their mean in a row without time."""
    tables = []
    for timing in timings:
        key = timing.recording, timing.estimator, METRIC, ""
        seconds = np.array(timing.seconds)
        stderr = seconds.std() / np.sqrt(len(seconds))
        tables.append(rows(key, np.array(timing.time_ns) / 1e9, seconds))
        tables.append(rows(key, np.nan, seconds.mean(), len(seconds), stderr))
    return replace(Scores.join(tables), provenance={"versions": versions()})

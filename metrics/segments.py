"""Aggregates over segments of time: rows whose part is ``<part>@<start>:<stop>``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..models.errors import ParameterError
from ..models.records import Scores
from .kit.table import groups, rows
from .pooling import is_rms


def parse(text: str) -> tuple[tuple[float, float], ...]:
    """Segments from ``start:stop,...`` [s], both ends included.

    Raises
    ------
    ParameterError : it does not read so
    """
    try:
        pairs = [tuple(map(float, item.split(":"))) for item in text.split(",")]
        segments = tuple((start, stop) for start, stop in pairs)
    except ValueError:
        raise ParameterError(f"segments must be start:stop,..., got {text!r}") from None
    for start, stop in segments:
        if not start <= stop:
            raise ParameterError(f"segment {start:g}:{stop:g} must not end before it starts")
    return segments


def segments(scores: Scores, bounds: Sequence[tuple[float, float]]) -> Scores:
    """``scores`` and, from their rows per time, an aggregate for each segment of ``bounds`` [s].

    Both ends are included. The aggregate is the root of the mean square over the steps for
    metrics that are such, otherwise the mean; ``n`` is the number of steps. It pools like any
    other.
    """
    tables = [scores]
    names = scores.recording, scores.estimator, scores.metric, scores.part
    for key, indices in groups(*names).items():
        time, value = scores.time[indices], scores.value[indices]
        for start, stop in bounds:
            v = value[(start <= time) & (time <= stop)]
            if len(v):
                mean = np.sqrt(np.mean(v**2)) if is_rms(key[2]) else np.mean(v)
                recording, estimator, metric, part = key
                name = recording, estimator, metric, f"{part}@{start:g}:{stop:g}"
                tables.append(rows(name, np.nan, mean, len(v)))
    return Scores.join(tables)

"""What scores lack: values that are no numbers, recordings that were not scored, steps left out."""

from __future__ import annotations

import numpy as np

from ..models.names import scenario
from ..models.records import Scores
from .table import Cell, Table

LISTED = 5
"""Recordings that are named where many are missing."""


def gaps(scores: Scores) -> Table:
    """One line for each estimator and metric that lacks something; no line if nothing does.

    A recording is missing for an estimator if another of the same scenario was scored on it.
    """
    lines: list[tuple[Cell, ...]] = []
    names = list(zip(scores.recording, scores.estimator, scores.metric, strict=True))
    wanted: dict[tuple[str, str], set[str]] = {}
    there: dict[tuple[str, str, str], set[str]] = {}
    for recording, estimator, metric in names:
        if estimator and not recording.endswith("*") and not metric.endswith("-left-out"):
            place = scenario(recording), metric
            wanted.setdefault(place, set()).add(recording)
            there.setdefault((*place, estimator), set()).add(recording)
    for (scene, metric, estimator), found in there.items():
        absent = sorted(wanted[scene, metric] - found)
        if absent:
            more = f" and {len(absent) - LISTED} more" if len(absent) > LISTED else ""
            what = f"not scored: {', '.join(absent[:LISTED])}{more}"
            lines.append((scene, estimator, metric, what))
    counts: dict[tuple[str, str, str], int] = {}
    for i in np.flatnonzero(~np.isfinite(scores.value)).tolist():
        recording, estimator, metric = names[i]
        key = scenario(recording), estimator, metric
        counts[key] = counts.get(key, 0) + 1
    lines += [(*key, f"{_number(n, 'value')} not finite") for key, n in counts.items()]
    left: dict[tuple[str, str, str], float] = {}
    for (recording, estimator, metric), value in zip(names, scores.value.tolist(), strict=True):
        if metric.endswith("-left-out") and value > 0 and not recording.endswith("*"):
            key = scenario(recording), estimator, metric.removesuffix("-left-out")
            left[key] = left.get(key, 0) + value
    lines += [(*key, f"{_number(round(n), 'step')} without truth") for key, n in left.items()]
    return Table(
        "Failures and gaps", ("scenario", "estimator", "metric", "what is missing"), tuple(lines)
    )


def _number(n: int, what: str) -> str:
    return f"{n} {what}{'s' * (n != 1)}"

"""Gaps in scores: recordings that were not scored, and steps that were left out."""

from __future__ import annotations

from ..models.names import scenario
from ..models.records import Scores
from .table import Cell, Table

LISTED = 5
"""Recordings that are named where many are missing."""


def gaps(scores: Scores) -> Table:
    """One line for each estimator and metric that lacks something; no line if nothing does.

    A recording is missing where no score says anything of it, if others of its scenario have one.
    """
    known: dict[str, set[str]] = {}
    there: dict[tuple[str, str], dict[str, set[str]]] = {}
    names = zip(scores.recording, scores.estimator, scores.metric, strict=True)
    for recording, estimator, metric in dict.fromkeys(names):
        if estimator and not recording.endswith("*") and not metric.endswith("-left-out"):
            scene = scenario(recording)
            known.setdefault(scene, set()).add(recording)
            found = there.setdefault((scene, estimator), {})
            found.setdefault(metric, set()).add(recording)
    lines: list[tuple[Cell, ...]] = []
    for (scene, estimator), metrics in there.items():
        nowhere = known[scene] - set().union(*metrics.values())
        if nowhere:
            lines.append((scene, estimator, "all", _list(nowhere)))
        for metric, recordings in metrics.items():
            absent = known[scene] - recordings - nowhere
            if absent:
                lines.append((scene, estimator, metric, _list(absent)))
    left: dict[tuple[str, str, str], float] = {}
    out = scores.where(metric=lambda name: name.endswith("-left-out"))
    told = zip(out.recording, out.estimator, out.metric, out.value.tolist(), strict=True)
    for recording, estimator, metric, value in told:
        if value > 0 and not recording.endswith("*"):
            key = scenario(recording), estimator, metric.removesuffix("-left-out")
            left[key] = left.get(key, 0) + value
    lines += [(*key, f"{n:g} step{'s' * (n != 1)} without truth") for key, n in left.items()]
    return Table(
        "Failures and gaps", ("scenario", "estimator", "metric", "what is missing"), tuple(lines)
    )


def _list(recordings: set[str]) -> str:
    names = sorted(recordings)
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return f"not scored: {', '.join(names[:LISTED])}{more}"

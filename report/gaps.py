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
    for key, (count, of) in left_out(scores).items():
        if count:
            some = f"{count} step{'s' * (count != 1)}"
            lines.append((*key, f"{some} without truth within max_gap, or estimate, of {of}"))
    return Table(
        "Failures and gaps", ("scenario", "estimator", "metric", "what is missing"), tuple(lines)
    )


def left_out(scores: Scores) -> dict[tuple[str, str, str], tuple[int, int]]:
    """How many steps were left out of how many, by scenario, estimator and metric."""
    end = "-left-out"
    out = scores.where(lambda name: not name.endswith("*"), bool, lambda m: m.endswith(end))
    found: dict[tuple[str, str, str], tuple[int, int]] = {}
    columns = out.recording, out.estimator, out.metric, out.value.tolist(), out.n.tolist()
    for recording, estimator, metric, count, n in zip(*columns, strict=True):
        key = scenario(recording), estimator, metric.removesuffix(end)
        before, of = found.get(key, (0, 0))
        found[key] = before + int(count), of + n
    return found


def _list(recordings: set[str]) -> str:
    names = sorted(recordings)
    more = f" and {len(names) - LISTED} more" if len(names) > LISTED else ""
    return f"not scored: {', '.join(names[:LISTED])}{more}"

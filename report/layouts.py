"""The tables of a report: a free grouping, or the layout of a tracking paper's results."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..models.records import Scores
from .pivot import Row, pivot, records
from .table import Cell, Table

PARTS = ("device", "centre", "extent")


def tables(scores: Scores, by: Sequence[str] = ()) -> list[Table]:
    """Tables of pooled scores, or of those of single recordings.

    With ``by``, one table grouped so (see :func:`.pivot.pivot`). Without: for each part its
    average errors, with one line an estimator or bound and one column a segment; where recordings
    were pooled, its error over time; its cumulative distribution; and whatever other scores there
    are.

    Raises
    ------
    ParameterError : an unknown dimension
    InputError : several recordings fall into one cell: they are to be pooled first
    """
    if by:
        return [pivot(records(scores.where(timed="time" in by)), by)]
    rows = records(scores.where(timed=False))
    timed = Scores.join(
        scores.where(metric=metric, estimator=estimator, timed=True)
        for metric, estimator in (("rmse", bool), (None, ""))
    )
    series_of = records(timed) if (timed.n > 1).any() else []
    made: list[Table] = []
    for part in PARTS:
        mine = [r for r in rows if r.part.partition("@")[0] == part]
        series = [r for r in series_of if (r.metric, r.part) == ("rmse", part)]
        errors = [r for r in mine if r.metric in ("rmse", "rmse-mean")]
        if errors:
            made.append(_averages(part, errors, rows))
        if any(r.n > 1 for r in series):
            made.append(pivot(series, ("time",), f"RMSE of the {part} over time [m]"))
        steps = [r for r in rows if r.metric == "cdf" and r.part.startswith(f"{part}<=")]
        if steps:
            made.append(_distribution(part, steps))
    known = ("rmse", "rmse-mean", "cdf", "time-per-step")
    others = [r for r in rows if r.metric not in known and np.isnan(r.time)]
    if others:
        made.append(pivot(others, ("scenario", "metric", "part"), "Other scores"))
    return made


def _averages(part: str, errors: Sequence[Row], rows: Sequence[Row]) -> Table:
    """One line an estimator: runs, error averaged over time, over all, by segment, and its cost."""
    costs = {(r.scenario, r.estimator): r.number for r in rows if r.metric == "time-per-step"}
    segments = list(dict.fromkeys(r.part for r in errors if "@" in r.part and r.metric == "rmse"))
    wanted = [("rmse-mean", part), ("rmse", part), *(("rmse", name) for name in segments)]
    lines: list[tuple[Cell, ...]] = []
    whole = [r for r in errors if np.isnan(r.time)]
    for key in dict.fromkeys((r.scenario, r.recording, r.estimator) for r in whole):
        mine = {
            (r.metric, r.part): r for r in whole if (r.scenario, r.recording, r.estimator) == key
        }
        pooled = key[1].endswith("*")
        runs = max(r.n for r in mine.values()) if pooled else 1
        numbers = (mine[w].number if w in mine else None for w in wanted)
        lines.append((key[0], key[2], runs, *numbers, costs.get((key[0], key[2]))))
    columns = (
        "scenario",
        "estimator",
        "runs",
        "avg. RMSE [m]",
        "RMSE [m]",
        *(f"{name.partition('@')[2]} s" for name in segments),
        "time per step [s]",
    )
    table = Table(f"Error of the {part}", columns, tuple(lines))
    return _without_empty(table)


def _without_empty(table: Table) -> Table:
    """The table without columns in which no line has anything."""
    kept = [i for i in range(len(table.columns)) if any(r[i] is not None for r in table.rows)]
    rows = tuple(tuple(r[i] for i in kept) for r in table.rows)
    return Table(table.title, tuple(table.columns[i] for i in kept), rows)


def _distribution(part: str, steps: Sequence[Row]) -> Table:
    """Fraction of steps whose error is at most a threshold, one line a threshold."""
    steps = [r._replace(part=r.part.partition("<=")[2]) for r in steps if "@" not in r.part]
    table = pivot(
        sorted(steps, key=lambda r: float(r.part)),
        ("part",),
        f"Cumulative distribution of the error of the {part}",
    )
    return Table(table.title, ("error at most [m]", *table.columns[1:]), table.rows)

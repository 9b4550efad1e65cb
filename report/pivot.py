"""Any grouping of scores: the dimensions asked for go down, those that vary besides go across."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..models.errors import InputError
from ..models.names import scenario
from ..models.parameters import require
from ..models.records import Scores
from .table import Number, Table

DIMENSIONS = ("scenario", "recording", "estimator", "metric", "part", "time")


class Row(NamedTuple):
    """One row of scores with its scenario and whether it is valid."""

    scenario: str
    recording: str
    estimator: str
    metric: str
    part: str
    time: float
    value: float
    n: int
    stderr: float
    valid: bool = True

    @property
    def number(self) -> Number:
        """Value, standard error and validity."""
        return Number(self.value, self.stderr, self.valid)


def records(scores: Scores) -> list[Row]:
    """All rows of ``scores``; a bound, which has no estimator, takes the name of its metric there.

    A bound ``b`` becomes the ``rmse`` of an estimator ``b``, and what its ``b-valid`` rows say
    becomes the validity of the row for the same part and time. Bounds come last.
    """
    names = zip(scores.recording, scores.estimator, scores.metric, scores.part, strict=True)
    numbers = (scores.time, scores.value, scores.n, scores.stderr)
    rows = [
        Row(scenario(name[0]), *name, *values)
        for name, values in zip(
            names, zip(*(c.tolist() for c in numbers), strict=True), strict=True
        )
    ]
    valid = {_place(r): r.value for r in rows if not r.estimator and r.metric.endswith("-valid")}
    rows = [_bound(r, valid) if not r.estimator else r for r in rows if _place(r) not in valid]
    bounds = {r.estimator for r in rows} - set(scores.estimator)
    return sorted(rows, key=lambda r: r.estimator in bounds)


def _place(row: Row) -> tuple[str, str, str, str]:
    """Where a row stands; the time as text, so that NaN equals NaN."""
    return row.recording, row.metric, row.part, repr(row.time)


def _bound(row: Row, valid: dict[tuple[str, str, str, str], float]) -> Row:
    name = row.metric.removesuffix("-mean")
    metric = "rmse-mean" if name != row.metric else "rmse"
    place = row.recording, f"{name}-valid", row.part, repr(row.time)
    return row._replace(estimator=name, metric=metric, valid=valid.get(place, 1.0) == 1.0)


def pivot(rows: Sequence[Row], by: Sequence[str], title: str = "") -> Table:
    """A table of ``rows`` with one line for each value of the dimensions ``by``.

    Rows per time count if ``time`` is among ``by``, aggregates otherwise. The other dimensions
    that vary make the columns; without ``recording`` among ``by`` the rows are of scenarios.

    Raises
    ------
    ParameterError : an unknown dimension
    InputError : several recordings fall into one cell: they are to be pooled first
    """
    for name in by:
        require(name in DIMENSIONS, "by", f"among {', '.join(DIMENSIONS)}", name)
    timed = "time" in by
    rows = [r for r in rows if np.isnan(r.time) != timed]
    across = [d for d in DIMENSIONS if d not in (*by, "recording", "time")]
    if "recording" in by:
        across = [d for d in across if d != "scenario"]
    across = [d for d in across if len({getattr(r, d) for r in rows}) > 1]
    cells: dict[tuple[str | float, ...], dict[str, Number]] = {}
    columns: dict[str, None] = {}
    for r in rows:
        line = cells.setdefault(tuple(getattr(r, d) for d in by), {})
        column = " ".join(filter(None, (getattr(r, d) for d in across))) or "value"
        if line.get(column, r.number).value != r.value:
            raise InputError(f"{r.recording}: pool the recordings, or group by recording")
        columns[column] = None
        line[column] = r.number
    rank = {name: i for i, name in enumerate(dict.fromkeys(x for key in cells for x in key))}
    keys = sorted(cells, key=lambda key: [x if isinstance(x, float) else rank[x] for x in key])
    body = ((*key, *(cells[key].get(c) for c in columns)) for key in keys)
    return Table(title, (*by, *columns), tuple(body))

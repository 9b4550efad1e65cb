"""Cumulative distributions of the position error."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...models.errors import InputError
from ..pivot import Row, records
from .columns import title
from .panels import decades, legend, panels
from .protocol import Inputs, Selection
from .style import line

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUMMARY = "cumulative distribution of the position error"
NEEDS: tuple[str, ...] = ("scores",)
USES: tuple[str, ...] = ()
SIZE = (16.0, 7.0)
PARTS = ("device", "centre")


def draw(figure: Figure, inputs: Inputs, selection: Selection) -> None:
    """One panel for each part, one line for each estimator, at the thresholds of the scores.

    Raises
    ------
    InputError : no distribution among the scores
    """
    _, pooled = inputs.tables
    rows = [r for r in records(pooled.where(metric="cdf")) if "@" not in r.part]
    found = {part: [r for r in rows if r.part.startswith(f"{part}<=")] for part in PARTS}
    shown = {part: mine for part, mine in found.items() if mine}
    if not shown:
        raise InputError("cdf: the scores hold no distribution of errors: score with -m cdf")
    axes = panels(figure, len(shown), sharey=True)
    many = len({r.scenario for r in rows}) > 1
    for a, (part, mine) in zip(axes, shown.items(), strict=True):
        for i, key in enumerate(dict.fromkeys((r.scenario, r.estimator) for r in mine)):
            x, y, e = _curve([r for r in mine if (r.scenario, r.estimator) == key])
            a.plot(x, y, label=" ".join(key if many else key[1:]), **line(i))
            a.fill_between(x, y - e, y + e, color=line(i)["color"], alpha=0.2, lw=0)
        a.set_xlabel(f"error of the {part} [m]")
        a.set_ylim(0, 1.02)
        decades(a, "x")
        a.set_ylabel("fraction of steps [1]")
    figure.suptitle(title(pooled))
    legend(figure, *axes)


def _curve(rows: list[Row]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Thresholds above zero in order, fractions, and standard errors."""
    points = [(float(r.part.partition("<=")[2]), r.value, r.stderr) for r in rows]
    table = np.array(sorted(p for p in points if p[0] > 0)).reshape(-1, 3)
    return table[:, 0], table[:, 1], table[:, 2]

"""Scores of single recordings as box plots, epoch by epoch or span by span."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...models.errors import InputError
from ...models.records import Array
from .clock import origin
from .columns import Columns, quantity, several, title
from .panels import legend, panels
from .protocol import Inputs, Selection
from .style import BLACK, box

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUMMARY = "box plots over the recordings, epoch by epoch"
NEEDS: tuple[str, ...] = ("scores",)
USES: tuple[str, ...] = ()
SIZE = (16.0, 7.0)
PARTS = ("", "device", "centre", "extent")
EPOCHS, SPANS = 12, 8
"""Most times that have a box each; so many spans of equal length where there are more."""


def draw(figure: Figure, inputs: Inputs, selection: Selection) -> None:
    """One panel for each metric; quartiles, median, and whiskers to 1.5 times their distance.

    Raises
    ------
    InputError : no values over time of single recordings
    """
    scores, pooled = inputs.tables
    some = scores.where(
        lambda name: not name.endswith("*"),
        bool,
        lambda name: not name.endswith("-valid"),
        PARTS.__contains__,
        timed=True,
    )
    rows = Columns.of(some, selection)
    whole = set(rows.metric[rows.part == ""])
    rows = rows.where(np.array([p == "" or m not in whole for m, p in _names(rows)], bool))
    if not len(rows):
        raise InputError("box: the scores hold no values over time of single recordings")
    cells = [
        (m, p) for m in several(list(rows.metric)) for p in PARTS if (m, p) in set(_names(rows))
    ]
    pairs = list(dict.fromkeys(zip(rows.scenario, rows.estimator, strict=True)))
    many = len({s for s, _ in pairs}) > 1
    axes = panels(figure, len(cells), columns=1, sharex=True)
    edges = _edges(np.unique(rows.time))
    for a, (metric, part) in zip(axes, cells, strict=True):
        mine = rows.where((rows.metric == metric) & (rows.part == part))
        for i, (scene, estimator) in enumerate(pairs):
            one = mine.where((mine.scenario == scene) & (mine.estimator == estimator))
            at = np.searchsorted(edges, one.time, side="right") - 1
            values = [one.value[at == k] for k in range(len(edges))]
            label = f"{scene} {estimator}" if many else estimator
            _boxes(a, values, i, len(pairs), label)
        a.set_ylabel(f"error of the {part} [m]" if metric == "rmse" else quantity(metric, part))
        a.set_ylim(bottom=0)
        a.grid(axis="x", visible=False)
    start, since = origin(float(edges[0]), inputs)
    labels = [f"{t - start:.3g}" for t in edges]
    epochs = len(np.unique(rows.time)) <= EPOCHS
    axes[-1].set_xticks(range(len(edges)), labels)
    axes[-1].set_xlabel(f"time{'' if epochs else ' from'}{since} [s]")
    figure.suptitle(title(pooled))
    legend(figure, *axes)


def _names(rows: Columns) -> list[tuple[str, str]]:
    return list(zip(rows.metric, rows.part, strict=True))


def _edges(time: Array) -> Array:
    """The times themselves, or where the spans of equal length start."""
    if len(time) <= EPOCHS:
        return time
    return np.linspace(time[0], time[-1], SPANS, endpoint=False).round(9)


def _boxes(axes: Axes, values: list[Array], index: int, of: int, label: str) -> None:
    """The boxes of one estimator, the ``index``-th ``of`` so many side by side."""
    width = 0.8 / of
    position = np.arange(len(values)) + (index - (of - 1) / 2) * width
    axes.boxplot(
        values,
        positions=position,
        widths=0.85 * width,
        patch_artist=True,
        manage_ticks=False,
        boxprops={**box(index), "edgecolor": BLACK, "linewidth": 0.6},
        medianprops={"color": BLACK, "linewidth": 1.2},
        whiskerprops={"linewidth": 0.6},
        capprops={"linewidth": 0.6},
        flierprops={"marker": ".", "markersize": 2, "markeredgewidth": 0.4},
    )
    axes.bar(np.nan, np.nan, label=label, edgecolor=BLACK, linewidth=0.6, **box(index))

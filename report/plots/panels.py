"""Axes side by side and one above the other, their scales, titles and legends."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...models.records import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLUMN = 5.0 / 2.54
"""Least width [in] of one of several columns of panels."""


def panels(figure: Figure, number: int, columns: int = 0, **kwargs: Any) -> list[Axes]:
    """``number`` axes in so many columns, or in as many as are wide enough to be read.

    The figure keeps its width; with more than one row its height is that of the rows together.
    """
    width, height = figure.get_size_inches()
    columns = columns or even(figure, number)
    rows = -(-number // columns)
    figure.set_size_inches(width, height * (0.4 + 0.6 * rows))
    grid = figure.subplots(rows, columns, squeeze=False, **kwargs)
    for axes in grid.ravel()[number:]:
        axes.remove()
    for axes in grid.ravel()[max(number - columns, 0) : number]:
        axes.tick_params(labelbottom=True)
    return list(grid.ravel()[:number])


def widest(figure: Figure) -> int:
    """Columns of panels that are wide enough to be read."""
    return max(1, int(figure.get_size_inches()[0] // _COLUMN))


def even(figure: Figure, number: int) -> int:
    """Columns for ``number`` panels that are wide enough and leave rows of like length."""
    rows = -(-number // widest(figure))
    return -(-number // rows)


def legend(figure: Figure, *axes: Axes) -> None:
    """One legend of all that has a label in ``axes``, below them, each label once.

    An entry takes some 42 points and 4.3 for each letter.
    """
    found: dict[str, Any] = {}
    for a in axes:
        for handle, label in zip(*a.get_legend_handles_labels(), strict=True):
            if not _is_nothing(handle):
                found.setdefault(label, handle)
    if found:
        points = 72 * figure.get_size_inches()[0]
        columns = _fitting([42 + 4.3 * len(label) for label in found], points)
        handles = list(found.values())
        figure.legend(handles, list(found), loc="outside lower center", ncols=columns)


def _is_nothing(handle: Any) -> bool:
    """Whether a line goes nowhere."""
    data = getattr(handle, "get_ydata", None)
    values = np.asarray(data(), float) if data else np.zeros(1)
    return len(values) > 0 and bool(np.isnan(values).all())


def _fitting(entries: list[float], width: float) -> int:
    """Most columns, filled one after the other, whose widest entries fit side by side."""
    for columns in range(len(entries), 1, -1):
        if sum(map(max, np.array_split(entries, columns))) <= width:
            return columns
    return 1


def decades(axes: Axes, which: str) -> None:
    """Make the axis ``which`` logarithmic, with plain numbers at 1, 2, 5 of every decade."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    getattr(axes, f"set_{which}scale")("log")
    axis = getattr(axes, f"{which}axis")
    low, high = axis.get_view_interval()
    subs = (1.0, 2.0, 5.0) if high / max(low, 1e-300) < 300 else (1.0,)
    axis.set_major_locator(LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def sparse(style: dict[str, Any], points: int, about: int = 8) -> dict[str, Any]:
    """A line's style with a marker at ``about`` so many of its ``points``."""
    return {**style, "markevery": max(1, points // about)}


MOST = 2000
"""Times of a line above which the means over several are drawn."""


def joining(number: int) -> int:
    """How many of ``number`` consecutive times become one."""
    return -(-number // MOST) or 1


def thinned(values: Array, count: int) -> Array:
    """Means (m,) over ``count`` consecutive ``values`` (n,) each, the last ones over the rest."""
    if count == 1:
        return values
    starts = np.arange(0, len(values), count)
    return np.add.reduceat(values, starts) / np.diff(starts, append=len(values))


def spans(time: Array, value: Array, step: float) -> list[tuple[float, float, int]]:
    """Runs of equal nonzero ``value`` (n,) over ``time`` (n,) [s]: start, stop and value.

    A value holds from one ``step`` before its time; a gap of more than a step ends a run.
    """
    found: list[tuple[float, float, int]] = []
    for t, v in zip(time.tolist(), value.tolist(), strict=True):
        if found and found[-1][2] == v and t - step <= found[-1][1] + 0.5 * step:
            found[-1] = (found[-1][0], t, v)
        elif v:
            found.append((t - step, t, v))
    return found

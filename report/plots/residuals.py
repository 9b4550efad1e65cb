"""What is left of detections of known targets: along and across the way, over range and azimuth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ...models.errors import ParameterError
from ...models.records import Array
from .draw import available
from .style import BLACK, CM, GREY, line, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, HEIGHT = 20.0, 5.5
MOST = 2000
"""Points of a panel; of more every so many."""
BINS = 12


class Residuals(Protocol):
    """Errors [m] of n detections ``along`` and ``across`` the way, and along the range ``over``.

    ``before`` a model was taken off; at ``range`` [m] and ``azimuth`` [rad] from the sensor, of
    which ``node``. ``share`` (k, 3): range [m], probability of detection, standard error.
    """

    @property
    def along(self) -> Array: ...
    @property
    def across(self) -> Array: ...
    @property
    def before(self) -> Array: ...
    @property
    def over(self) -> Array: ...
    @property
    def range(self) -> Array: ...
    @property
    def azimuth(self) -> Array: ...
    @property
    def node(self) -> Array: ...
    @property
    def share(self) -> Array: ...


def residuals(found: Mapping[str, tuple[Residuals, Sequence[str]]]) -> Figure:
    """A row of panels for each stream, whose residuals are those of the nodes named.

    Raises
    ------
    ParameterError : Matplotlib is not installed
    """
    if not available():
        raise ParameterError("plots need Matplotlib: pip install 'echoset[plot]'")
    from matplotlib.figure import Figure

    with style():
        size = (WIDTH * CM, HEIGHT * len(found) * CM)
        made = Figure(figsize=size, layout="constrained")
        grid = made.subplots(len(found), 4, squeeze=False)
        for row, (stream, (one, nodes)) in zip(grid, found.items(), strict=True):
            _row(row, stream, one, nodes)
        return made


def _row(row: Sequence[Axes], stream: str, x: Residuals, nodes: Sequence[str]) -> None:
    known = np.isfinite(x.along)
    if known.any():
        some = _some(np.flatnonzero(known))
        row[0].plot(x.across[some], x.before[some], ".", color=GREY, ms=1.5, label="as stamped")
        colour = line(0)["color"]
        row[0].plot(x.across[some], x.along[some], ".", color=colour, ms=1.5, label="calibrated")
        row[0].set_aspect("equal", "datalim")
        row[0].set_xlabel("left of the way [m]")
        row[0].set_ylabel(f"{stream}\nahead on the way [m]")
        row[0].legend(loc="upper right", markerscale=4, handlelength=1)
    else:
        for k, name in enumerate(nodes):
            mine = x.node == k
            if mine.any():
                colour = line(k)["color"]
                row[0].hist(x.over[mine], 40, histtype="step", label=name, color=colour)
        row[0].set_xlabel("residual [m]")
        row[0].set_ylabel(f"{stream}\nranges")
        row[0].legend(loc="upper right", handlelength=1.5)
    for axes, at, label in (
        (row[1], x.range, "range [m]"),
        (row[2], np.degrees(x.azimuth), "azimuth [degrees]"),
    ):
        some = _some(np.arange(len(at)))
        axes.plot(at[some], x.over[some], ".", color=GREY, ms=1.5)
        _means(axes, at, x.over)
        axes.set_xlabel(label)
        axes.set_ylabel("along the range [m]")
    if len(x.share):
        r, p, error = x.share.T
        row[3].errorbar(r, p, 2 * error, color=BLACK, marker="o", capsize=2)
        row[3].set_ylim(0, 1.1)
        row[3].set_xlabel("range [m]")
        row[3].set_ylabel("probability of detection")
    else:
        row[3].hist(x.before, 40, color=GREY)
        row[3].set_xlabel("without the model [m]")
        row[3].set_ylabel("ranges")


def _some(rows: Array) -> Array:
    return rows[:: max(len(rows) // MOST, 1)]


def _means(axes: Axes, at: Array, values: Array) -> None:
    """Means of bins that hold as many, with two standard errors."""
    order = np.argsort(at, kind="stable")
    parts = [p for p in np.array_split(order, min(BINS, max(len(order) // 10, 1))) if len(p) > 1]
    middle = [at[p].mean() for p in parts]
    mean = [values[p].mean() for p in parts]
    error = [2 * values[p].std(ddof=1) / np.sqrt(len(p)) for p in parts]
    axes.errorbar(middle, mean, error, color=BLACK, marker="o", ms=2.5, capsize=2, linestyle="none")

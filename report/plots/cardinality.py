"""Numbers of objects over time: the mean with its standard deviation beside the truth."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...models.errors import InputError
from ...models.records import Array
from .clock import time_axis
from .columns import Columns, title
from .panels import joining, legend, panels, sparse, thinned
from .protocol import Inputs, Selection
from .style import BLACK, line

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUMMARY = "number of objects over time: true, mean and standard deviation"
NEEDS: tuple[str, ...] = ()
USES: tuple[str, ...] = ("scores", "estimates", "recording")
SIZE = (16.0, 7.0)
_Line = tuple[str, Array, Array, Array, str]
"""Name, time [s], mean, standard deviation (NaN: none) and what that is of."""


def draw(figure: Figure, inputs: Inputs, selection: Selection) -> None:
    """The posterior mean of estimates, or the mean over the recordings of scores.

    The band is one standard deviation of the posterior, or of the error over the recordings.

    Raises
    ------
    InputError : neither estimates with a number of objects nor scores of it
    """
    if inputs.estimates:
        lines = _posterior(inputs, selection)
        name = inputs.estimates[0].meta.name
        true = _true(inputs, selection)
    elif inputs.scores is not None:
        lines, true = _over_runs(inputs, selection)
        name = title(inputs.tables[1])
    else:
        raise InputError("cardinality: needs estimates or scores, which no input holds")
    (axes,) = panels(figure, 1)
    joined = max((joining(len(time)) for _, time, *_ in lines), default=1)
    if true is not None:
        true = thinned(true[0], joined), thinned(true[1], joined)
        axes.step(*true, where="mid", color=BLACK, lw=1.4, zorder=2.5, label="truth")
    for i, (label, time, mean, std, _) in enumerate(lines):
        colour = line(i)["color"]
        time, mean, std = (thinned(v, joined) for v in (time, mean, std))
        axes.plot(time, mean, label=label, **sparse(line(i), len(time), 10))
        if not np.isnan(std).all():
            axes.fill_between(time, mean - std, mean + std, color=colour, alpha=0.2, lw=0)
    for of in dict.fromkeys(of for *_, std, of in lines if not np.isnan(std).all()):
        label = f"± standard deviation {of}"
        axes.fill(np.nan, np.nan, color="#999999", alpha=0.4, lw=0, label=label)
    axes.set_ylabel("number of objects [1]")
    axes.margins(x=0)
    time_axis(axes, inputs)
    figure.suptitle(name + (f", means over {joined} times" if joined > 1 else ""))
    legend(figure, axes)


def _posterior(inputs: Inputs, selection: Selection) -> list[_Line]:
    """A line for each file of estimates: the posterior mean, or the number of objects."""
    found = []
    for e in inputs.estimates:
        time = e.objects.time_ns / 1e9
        at = selection.times(time)
        if "cardinality_mean" in e.steps:
            mean = e.steps["cardinality_mean"][at]
            variance = e.steps.get("cardinality_variance", np.full(len(time), np.nan))[at]
            std = np.sqrt(np.maximum(variance, 0.0))
        else:
            mean, std = np.diff(e.objects.row_offset)[at], np.full(len(at), np.nan)
        found.append((e.estimator, time[at], mean, std, "of the posterior"))
    return found


def _true(inputs: Inputs, selection: Selection) -> tuple[Array, Array] | None:
    if not inputs.recordings or inputs.recording.truth is None:
        return None
    objects = inputs.recording.truth.objects
    at = selection.times(objects.time_ns / 1e9)
    return objects.time_ns[at] / 1e9, np.diff(objects.row_offset)[at]


def _over_runs(
    inputs: Inputs, selection: Selection
) -> tuple[list[_Line], tuple[Array, Array] | None]:
    """A line for each scenario and estimator, and the true number where the scenario is one."""
    rows = Columns.of(inputs.tables[0], selection)
    rows = rows.where(rows.metric == "cardinality")
    if not len(rows):
        raise InputError("cardinality: the scores hold none over time: score with -m cardinality")
    many = len(set(rows.scenario)) > 1
    lines: list[_Line] = []
    true = None
    for scene, estimator in dict.fromkeys(zip(rows.scenario, rows.estimator, strict=True)):
        mine = rows.where((rows.scenario == scene) & (rows.estimator == estimator))
        part, error = ("mean", "mean-error") if "mean" in mine.part else ("estimated", "error")
        label = f"{scene} {estimator}" if many else estimator
        std = _moments(mine.where(mine.part == error))[2]
        lines.append((label, *_moments(mine.where(mine.part == part))[:2], std, "of the error"))
        if not many:
            true = _moments(mine.where(mine.part == "true"))[:2]
    return lines, true


def _moments(rows: Columns) -> tuple[Array, Array, Array]:
    """Times, means and standard deviations (NaN for a single recording) over the recordings."""
    time, step = np.unique(rows.time, return_inverse=True)
    n = np.bincount(step)
    mean = np.bincount(step, rows.value) / n
    square = np.bincount(step, (rows.value - mean[step]) ** 2)
    spread = np.divide(square, n - 1, out=np.full(len(n), np.nan), where=n > 1)
    return time, mean, np.sqrt(spread)

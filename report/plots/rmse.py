"""Root mean square errors over time, with their bounds and what blocked the line of sight."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...models.errors import InputError
from ...models.records import Estimates
from .blockages import shade
from .clock import time_axis
from .columns import Series, quantity, series, title
from .panels import decades, joining, legend, panels, sparse, thinned
from .protocol import Inputs, Selection
from .style import bound, line

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUMMARY = "RMSE over time beside its bounds and the estimates' evidence, blockages shaded"
NEEDS: tuple[str, ...] = ("scores",)
USES: tuple[str, ...] = ("recording", "estimates")
SIZE = (16.0, 7.0)
PARTS = ("device", "centre", "extent")


def draw(figure: Figure, inputs: Inputs, selection: Selection) -> None:
    """One panel for each part; a bound that is not valid is thin.

    Raises
    ------
    InputError : no RMSE over time
    """
    _, pooled = inputs.tables
    found = {part: series(pooled, "rmse", part, selection) for part in PARTS}
    joined = max((joining(len(s.time)) for lines in found.values() for s in lines), default=1)
    found = {part: [_thinned(s) for s in lines] for part, lines in found.items()}
    shown = {part: lines for part, lines in found.items() if any(not s.bound for s in lines)}
    if not shown:
        raise InputError("rmse: the scores hold no rmse over time: score with -m rmse")
    evident = [e for e in inputs.estimates if "evidence" in e.steps]
    *axes, last = panels(figure, len(shown) + bool(evident), columns=1, sharex=True)
    if evident:
        _evidence(last, evident)
    else:
        axes.append(last)
    for a, (part, lines) in zip(axes, shown.items(), strict=True):
        estimators = [s for s in lines if not s.bound]
        for i, s in enumerate(estimators):
            a.plot(s.time, s.value, label=s.label, **sparse(line(i), len(s.time), 10))
            low, high = s.value - s.stderr, s.value + s.stderr
            low = np.where(low > 0, low, s.value)
            a.fill_between(s.time, low, high, color=line(i)["color"], alpha=0.2, lw=0)
        for i, s in enumerate(s for s in lines if s.bound):
            a.plot(s.time, np.where(s.valid, s.value, np.nan), label=s.label, **bound(i))
            if not s.valid.all():
                thin = {**bound(i), "linewidth": 0.4}
                a.plot(s.time, s.value, label=f"{s.label}, not valid", **thin)
        a.set_ylabel(quantity("rmse", part))
        decades(a, "y")
        a.margins(x=0)
        if inputs.recordings:
            limits = a.get_xlim()
            shade([a], inputs.recording)
            a.set_xlim(limits)
    time_axis(last, inputs)
    note = f", over {joined} times each" if joined > 1 else ""
    figure.suptitle(title(pooled) + note)
    legend(figure, *axes)


def _thinned(s: Series) -> Series:
    """The series with root mean squares over consecutive times, where there are very many.

    A standard error is at most the mean of theirs; what is not valid at one time is not.
    """
    count = joining(len(s.time))
    if count == 1:
        return s
    value = np.sqrt(thinned(s.value**2, count))
    valid = thinned(s.valid.astype(float), count) == 1.0
    return replace(
        s,
        time=thinned(s.time, count),
        value=value,
        stderr=thinned(s.stderr, count),
        valid=valid,
    )


def _evidence(axes: Axes, estimates: list[Estimates]) -> None:
    """The log predictive density of each step above that of clutter alone."""
    for i, e in enumerate(estimates):
        time = e.objects.time_ns / 1e9
        count = joining(len(time))
        mean = thinned(time, count), thinned(e.steps["evidence"], count)
        axes.plot(*mean, label=f"{e.estimator}, {e.meta.name}", **line(i))
        anew = np.flatnonzero(e.steps.get("sought_anew", np.zeros(len(time))))
        axes.plot(time[anew], e.steps["evidence"][anew], "kx", label="_sought anew")
    axes.axhline(0.0, color="0.6", lw=0.6)
    axes.set_ylabel("evidence [nat]")
    axes.margins(x=0)

"""Traces of a Markov chain and the share of its moves that were accepted."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...models.errors import InputError
from ...models.records import Array, Estimates
from .clock import moment, time_axis
from .panels import panels
from .protocol import Inputs, Selection
from .style import line

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUMMARY = "traces of a Markov chain, and the acceptance of its moves"
NEEDS: tuple[str, ...] = ("estimates",)
USES: tuple[str, ...] = ("recording",)
SIZE = (16.0, 6.0)
MOVES = {"di-gsncp": ("position", "extent", "birth", "death", "relocation", "jump")}
"""Names of the moves, in the order of an estimator's ``acceptance``."""
LINES = 6
"""Most steps whose traces are drawn together."""
_LABELS = {
    "log_posterior": "log posterior\nless its highest [1]",
    "cardinality": "number of targets [1]",
}


def draw(figure: Figure, inputs: Inputs, selection: Selection) -> None:
    """A panel for each trace, with a line for each step, and one of acceptance over the steps.

    Raises
    ------
    InputError : the estimates hold no traces, or are of several estimators or recordings
    """
    if len(inputs.estimates) != 1:
        raise InputError(f"trace: draws one file of estimates, not {len(inputs.estimates)}")
    (estimates,) = inputs.estimates
    names = sorted(n for n, v in estimates.steps.items() if n.endswith("_trace") and v.ndim == 2)
    if not names:
        raise InputError(f"trace: {estimates.estimator} left no trace in its estimates")
    time = estimates.objects.time_ns / 1e9
    steps = selection.times(time)
    shown = steps[np.linspace(0, len(steps) - 1, min(LINES, len(steps))).round().astype(int)]
    acceptance = "acceptance" in estimates.steps
    axes = panels(figure, len(names) + acceptance, columns=1)
    for a, name in zip(axes, reversed(names), strict=False):
        short = name.removesuffix("_trace")
        _traces(a, inputs, estimates.steps[name], shown, short == "log_posterior")
        a.set(xlabel="iteration [1]", ylabel=_LABELS.get(short, short))
        if short == "log_posterior":
            a.set_yscale("symlog", linthresh=10)
    axes[0].legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    if acceptance:
        _acceptance(axes[-1], estimates, time[steps], estimates.steps["acceptance"][steps])
        time_axis(axes[-1], inputs)
        axes[-1].legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
    figure.suptitle(f"{estimates.meta.name}, {estimates.estimator}")


def _traces(axes: Axes, inputs: Inputs, traces: Array, shown: Array, relative: bool) -> None:
    """Traces (n, k) of the steps ``shown``, or ``relative`` to the highest of each."""
    (estimates,) = inputs.estimates
    time = estimates.objects.time_ns / 1e9
    for i, k in enumerate(shown.tolist()):
        last = estimates.steps["iterations"][k] - 1 if "iterations" in estimates.steps else None
        x = np.linspace(0, traces.shape[1] - 1 if last is None else last, traces.shape[1])
        style = {**line(i), "marker": "", "linewidth": 0.9}
        y = traces[k] - (traces[k].max() if relative else 0.0)
        axes.plot(x, y, label=f"step at {moment(float(time[k]), inputs)}", **style)
        if "burn_in" in estimates.steps:
            at = int(np.searchsorted(x, estimates.steps["burn_in"][k]).clip(0, len(x) - 1))
            mark: dict[str, Any] = {
                "marker": "|",
                "markersize": 9,
                "linestyle": "",
                "markeredgewidth": 1.4,
            }
            label = "end of burn-in" if k == shown[-1] else None
            axes.plot(x[at], y[at], color=line(i)["color"], label=label, **mark)
    axes.margins(x=0.01)


def _acceptance(axes: Axes, estimates: Estimates, time: Array, share: Array) -> None:
    share = share.reshape(len(time), -1)
    known = MOVES.get(estimates.estimator, ())
    for i in range(share.shape[1]):
        if share[:, i].any():
            name = known[i] if i < len(known) else f"move {i + 1}"
            axes.plot(time, share[:, i], label=name, **line(i))
    axes.set(ylabel="accepted moves [1]", ylim=(0, None))

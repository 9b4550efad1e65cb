"""Distances between sets of objects over time, as stacks of what they consist of."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ...models.errors import InputError
from ...models.records import Array
from .clock import time_axis
from .columns import Columns, quantity, several, title
from .panels import joining, legend, panels, thinned, widest
from .protocol import Inputs, Selection
from .style import BLACK, shade

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUMMARY = "OSPA, GOSPA and their like over time, their parts stacked"
NEEDS: tuple[str, ...] = ("scores",)
USES: tuple[str, ...] = ()
SIZE = (16.0, 7.0)
PARTS = ("localisation", "cardinality", "missed", "false")
_ORDER = 2.0


def draw(figure: Figure, inputs: Inputs, selection: Selection) -> None:
    """One panel for each metric, scenario and estimator; means over the recordings.

    Raises
    ------
    InputError : no metric with such parts over time
    """
    scores, pooled = inputs.tables
    rows = Columns.of(scores.where(part=("", *PARTS).__contains__, timed=True), selection)
    metrics = several(rows.metric[rows.part == PARTS[0]])
    if not metrics:
        raise InputError("sets: the scores hold no ospa or gospa over time: score with -m ospa")
    cells = [
        (m, s, e)
        for m in metrics
        for s, e in dict.fromkeys(
            zip(rows.scenario[rows.metric == m], rows.estimator[rows.metric == m], strict=True)
        )
    ]
    columns = min(len(dict.fromkeys(cell[1:] for cell in cells)), widest(figure))
    axes = panels(figure, len(cells), columns, sharex=True)
    many = len({s for _, s, _ in cells}) > 1
    highest: dict[str, float] = {}
    joined = 1
    for a, (metric, scene, estimator) in zip(axes, cells, strict=True):
        mine = rows.where(
            (rows.metric == metric) & (rows.scenario == scene) & (rows.estimator == estimator)
        )
        time, whole, parts = stack(mine, order(scores.provenance, metric))
        count = joining(len(time))
        time, whole = thinned(time, count), thinned(whole, count)
        parts = {name: thinned(part, count) for name, part in parts.items()}
        joined = max(joined, count)
        layers = a.stackplot(time, list(parts.values()), labels=list(parts))
        for i, layer in enumerate(layers):
            layer.set(**shade(PARTS.index(list(parts)[i])))
        a.plot(time, whole, color=BLACK, lw=0.9, label="whole")
        a.set_title(f"{scene} {estimator}" if many else estimator)
        a.set_ylabel(quantity(metric))
        a.margins(x=0)
        highest[metric] = max(highest.get(metric, 0.0), float(whole.max(initial=0.0)))
    for a, (metric, _, _) in zip(axes, cells, strict=True):
        a.set_ylim(0, 1.05 * highest[metric] or 1.0)
    for a in axes[-columns:]:
        time_axis(a, inputs)
    note = f", means over {joined} times" if joined > 1 else ""
    figure.suptitle(title(pooled) + note)
    legend(figure, *axes)


def stack(rows: Columns, p: float) -> tuple[Array, Array, dict[str, Array]]:
    """Times (n,) [s], mean distances (n,) over the recordings, and the share of each part (n,).

    The p-th powers of the parts add up to that of the distance; each recording's distance is
    divided in these proportions, so that the shares add up to it and so do their means.
    """
    names = [part for part in PARTS if part in rows.part]
    recordings, run = np.unique(rows.recording.astype(str), return_inverse=True)
    time, step = np.unique(rows.time, return_inverse=True)
    cube = np.full((len(names) + 1, len(recordings), len(time)), np.nan)
    for i, name in enumerate(("", *names)):
        at = rows.part == name
        cube[i, run[at], step[at]] = rows.value[at]
    whole, power = cube[0], cube[1:] ** p
    total = power.sum(0)
    share = np.divide(power, total, out=np.zeros_like(power), where=total > 0) * whole
    seen = np.maximum((~np.isnan(whole)).sum(0), 1)
    means = np.nansum(share, 1) / seen
    return time, np.nansum(whole, 0) / seen, dict(zip(names, means, strict=True))


def order(provenance: Mapping[str, Any], metric: str) -> float:
    """The order p that the metric was scored with, as its provenance says; 2 if it says nothing."""
    for known in (provenance, *provenance.get("inputs", ())):
        parameters = known.get("metrics", {}).get(metric, {})
        if "order" in parameters:
            return float(parameters["order"])
    return _ORDER

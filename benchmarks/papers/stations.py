"""Figures 3 and 4, capacity and error budget of Favarelli et al., and measured radar beside."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from echoset.control.stations import FILTERS, GATES, Condition
from echoset.metrics.pooling import pool
from echoset.models.records import Scores
from echoset.report.plots import style
from echoset.report.plots.panels import legend

from . import autoferry_table as autoferry
from . import jsc_table as jsc
from . import page
from .pieces import Piece, share_of

NAME = "stations"
RUNS, SEED = 20, 1
PARTS = (*jsc.PRESETS, "budget")


def pieces(share: float) -> list[Piece]:
    """The runs, in a small share with one preset, and the measured recordings that are there."""
    parts = PARTS if share > 0.5 else PARTS[:1]
    found = [Piece(jsc.scores_of, (run, SEED, parts)) for run in range(share_of(RUNS, share))]
    if (autoferry.ROOT / "autoferry").exists():
        found += [Piece(autoferry.lines, (scenario,)) for scenario in autoferry.SCENARIOS]
    return found


def write(results: Sequence[tuple[Piece, Any]], folder: Path) -> None:
    """Write the page, two pictures, and the error over time as data."""
    simulated = [r for p, r in results if p.make is jsc.scores_of]
    found = [line for p, r in results if p.make is autoferry.lines for line in r]
    made = next(p.arguments[2] for p, _ in results if p.make is jsc.scores_of)
    left = [f"`{part}`" for part in PARTS if part not in made]
    without = f" Left out with so few runs: {', '.join(left)}." if left else ""
    pooled = pool(concatenate(simulated))
    jsc.over_time(pooled, folder / f"{NAME}-time.csv")
    _draw_stations(pooled, folder / f"{NAME}-3.svg")
    _draw_time(pooled, folder / f"{NAME}-4.svg")
    _, _, tables = "\n".join(jsc.tables(pooled, len(simulated), SEED)).partition("\n\n")
    lines = "\n".join([autoferry.HEADER, *found]) if found else "They were not there."
    caption = autoferry.CAPTION.format(block=autoferry.BLOCK) if found else ""
    page.write(
        folder,
        NAME,
        "Base stations that sense",
        f"{len(simulated)} of its {RUNS} runs of `{jsc.SCENARIO}`, seed {SEED}.{without}",
        INTRODUCTION,
        tables,
        CAPACITY,
        ERROR,
        FIGURES,
        MEASURED,
        lines,
        caption,
    )


def _draw_stations(p: Scores, path: Path) -> None:
    """Normalised OSPA and accuracy of both filters by number of stations, presets side by side."""
    whole = zip(p.estimator, p.metric, p.part, p.time.tolist(), strict=True)
    at = {(e, m): i for i, (e, m, part, t) in enumerate(whole) if not part and np.isnan(t)}
    with style.style():
        figure = Figure(figsize=(18 * style.CM, 11 * style.CM), layout="constrained")
        axes = figure.subplots(2, 2, sharex=True, sharey="col")
        for row, name in zip(axes, FILTERS, strict=True):
            for a, metric in zip(row, ("ospa-normalised", "accuracy"), strict=True):
                for i, (preset, gate) in enumerate(product(jsc.PRESETS, GATES)):
                    conditions = [(n, Condition(name, preset, gate, n).name) for n in range(1, 7)]
                    found = [(n, at[c, metric]) for n, c in conditions if (c, metric) in at]
                    if found:
                        n, rows = map(list, zip(*found, strict=True))
                        label, line = f"{preset}, gate {gate}", style.line(i)
                        a.errorbar(n, p.value[rows], p.stderr[rows], label=label, **line)
            row[0].set_ylabel(f"{name}: normalised OSPA [m]")
            row[1].set_ylabel(f"{name}: accuracy")
        for a in axes[1]:
            a.set(xlabel="stations that sense", xticks=range(1, 7))
        legend(figure, axes[0, 0])
    page.save(figure, path)


def _draw_time(p: Scores, path: Path) -> None:
    """Normalised OSPA of both filters over time, a line for each gate."""
    with style.style():
        figure = Figure(figsize=(18 * style.CM, 9 * style.CM), layout="constrained")
        axes = figure.subplots(2, 1, sharex=True, sharey=True)
        whole = [*zip(p.estimator, p.metric, p.part, np.isfinite(p.time), strict=True)]
        for a, name in zip(axes, FILTERS, strict=True):
            for i, gate in enumerate(GATES):
                condition = Condition(name, jsc.PRESET, gate, jsc.OVER_TIME[0]).name
                wanted = (condition, "ospa-normalised", "", True)
                rows = [k for k, cell in enumerate(whole) if cell == wanted]
                line = style.line(i) | {"marker": ""}
                a.plot(p.time[rows], p.value[rows], label=f"gate {gate}", **line)
            a.set_ylabel(f"{name}: OSPA [m]")
        axes[1].set_xlabel("time [s]")
        legend(figure, axes[0])
    page.save(figure, path)


INTRODUCTION = """\
E. Favarelli et al., *Multi-base station cooperative sensing with AI-aided tracking*, section IV.
The preset `paper` is the chain as printed; `tuned` adds to it, and was chosen on recordings of the
seeds 1001 to 1006."""
ERROR = """\
## Where the error is

Runs either tell all eight targets apart or keep one target for two, or two for one, for as long as
those stay close; of eight, each such target costs 1.1 m. The truth in place of the clustering
leaves none of these."""
CAPACITY = """\
Published: 0.9 Gbit/s with all six sensing, more than 1 with three, 1.1 with none. The
signal-to-noise ratio of the links is not published; ours is chosen so that none gives 1.1: what
it loses to sensing is the result."""
FIGURES = """\
## Figure 3: over the number of stations

![Normalised OSPA and accuracy by number of stations](stations-3.svg)

## Figure 4: over time

![Normalised OSPA over the first 100 scans, three stations](stations-4.svg)

As numbers: [stations-time.csv](stations-time.csv).

## What is not here

Figures 1 and 2 are sketches of the network and of the chain; table I, the mean radar cross
sections, is an input: `echoset describe jsc-6bs` prints it."""
MEASURED = """\
## Measured

The paper has no measurements. In their place stand recordings of the Autoferry benchmark, marine
radar with and without lidar, on which the same filters run; `make autoferry` prints them alone,
where the recordings are."""

"""Figure 5 and table I of Zhu, Venus, Leitinger and Witrisal, and a measured recording beside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from echoset.formats import scores as archive
from echoset.metrics.kit.table import concatenate
from echoset.metrics.pooling import pool
from echoset.report.plots.protocol import Inputs

from . import labyrinth_table, page
from . import marks_eopda as marks
from .pieces import Piece, chunks, share_of

NAME = "uwb"
RUNS, CHUNK = 100, 5
SHOWN = "eopda-geo"
"""The estimator of figure 4."""
BOUNDS = ("pcrlb", "pcrlb-star")
PUBLISHED = {"eopda-geo": ("0.18", "0.33"), "eopda-ideal": ("0.16", "0.67")}
"""Average RMSE [m] and seconds a step of table I."""


def pieces(share: float) -> list[Piece]:
    """Estimators by parts of the runs, and the measured recording if it is there."""
    parts = chunks(share_of(RUNS, share), CHUNK)
    found = [Piece(marks.estimated, (SHOWN, 0))]
    found += [Piece(marks.scored, (name, runs)) for name in marks.ESTIMATORS for runs in parts]
    if labyrinth_table.DATA.exists():
        found += [Piece(labyrinth_table.rmse, (s,)) for s in labyrinth_table.ROWS.values()]
    return found


def write(results: Sequence[tuple[Piece, Any]], folder: Path) -> None:
    """Write the page, three pictures, and the errors over time as data."""
    simulated = [(p.arguments[0], r) for p, r in results if p.make is marks.scored]
    measured = [r for p, r in results if p.make is labyrinth_table.rmse]
    by_name: dict[str, list[Any]] = {name: [] for name, _ in simulated}
    for name, result in simulated:
        by_name[name].append(result)
    tables = {name: concatenate(s for s, _ in parts) for name, parts in by_name.items()}
    rows = []
    for name, scores in tables.items():
        c = marks.Campaign.of(scores, sum(seconds for _, seconds in by_name[name]))
        cells = [f"{v:.3f} ± {s:.3f}" for v, s in zip(*c.figures(), strict=True)]
        published, seconds = PUBLISHED.get(name, ("-", "-"))
        times = [f"{c.seconds:.4f}", seconds]
        rows.append([f"`{name}`", cells[0], published, *cells[1:], str(c.lost), *times])
    for name in BOUNDS:
        cells = [f"{v:.3f}" for v in marks.bound(name).figures()[0]]
        rows.append([f"`{name}`", cells[0], "-", *cells[1:], "", "", ""])
    shown = next(r for p, r in results if p.make is marks.estimated)
    scene = Inputs(recordings=(marks.recording(0),), estimates=(shown,))
    page.picture("scene", scene, folder / f"{NAME}-scene.svg")
    runs = len(c.error)
    segments = [f"{a}-{b}" for a, b in marks.SEGMENTS]
    head = ["", "mean", "published", *segments, "runs lost", "s a step", "published"]
    # pictures tell estimators by name alone: of each, the walks of the paper
    as_published = {name: table for name, table in tables.items() if " " not in name}
    everything = replace(
        concatenate([*as_published.values(), *map(marks.bounds, BOUNDS)]), provenance={}
    )
    pooled = pool(everything)
    for kind, record in (("rmse", (marks.recording(0),)), ("cdf", ())):
        inputs = Inputs(recordings=record, scores=everything, pooled=pooled)
        page.picture(kind, inputs, folder / f"{NAME}-{kind}.svg")
    time = zip(pooled.metric, pooled.part, np.isfinite(pooled.time), strict=True)
    shown = {(metric, "device", True) for metric in ("rmse", *BOUNDS)}
    device = pooled.select([i for i, cell in enumerate(time) if cell in shown])
    archive.write(device, folder / f"{NAME}-rmse.csv", "csv")
    page.write(
        folder,
        NAME,
        "A UWB device on an extended object",
        f"{runs} of its {RUNS} runs of `uwb-olos`, seed {marks.SEED}, 5000 particles, blind start.",
        INTRODUCTION,
        page.table(head, rows),
        FIGURES,
        _measured(measured),
    )


def _measured(found: Sequence[tuple[float, float]]) -> str:
    if not found:
        return f"{MEASURED} It was not there when this page was made."
    cells = zip(labyrinth_table.ROWS, found, strict=True)
    rows = [[name, f"{value:.3f} ± {stderr:.3f}"] for name, (value, stderr) in cells]
    return f"{MEASURED}\n\n{page.table(['`position`, four seeds', 'device [m]'], rows)}"


INTRODUCTION = """\
H. Zhu, A. Venus, E. Leitinger and K. Witrisal, *Multi-Sensor Fusion of Active and Passive
Measurements for Extended Object Tracking*, 2025. The paper states where one of its anchors
stands, in a caption, but not the others, nor the path; the scenario has its own, so the published
numbers are of the same kind but not of the same scene.

## Table I and the segments of figure 5a

Root mean square error of the device [m] ± standard error, by a bootstrap over runs: its mean over
steps 11 to 180, then over the steps named. All lines of sight are blocked in 31-60 and 111-130,
some in 61-110. A run is lost with an error above 2 m after step 20. Seconds are of one processor,
theirs and ours not the same; ours alone differ when the page is made again. `pcrlb` counts the
blockages and is not valid in 31-60 and 111-130, where the angle of the device is not observed;
`pcrlb-star` has all lines of sight."""
FIGURES = """\
## Figure 4: the path with one estimate

![Path, anchors, and one estimate by eopda-geo](uwb-scene.svg)

## Figure 5a: error over time

![RMSE of device, centre and extent over time, with its bounds](uwb-rmse.svg)

The device's as numbers: [uwb-rmse.csv](uwb-rmse.csv).

## Figure 5b: distribution of the error

![Cumulative distribution of the error](uwb-cdf.svg)

## What is not here

Figures 1 to 3 are sketches and a factor graph."""
MEASURED = """\
## Measured

The paper has no measurements. In their place stands the Labyrinth Dataset (T. Pfeifer, TU
Chemnitz): a robot with UWB ranging to four anchors; error over all but the first four ranges, ±
block bootstrap; `make labyrinth` prints it alone, where the recording is."""

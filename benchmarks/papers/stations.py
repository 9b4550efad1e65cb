"""Figures 3 and 4, capacity and error budget of Favarelli et al., and measured radar beside."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import autoferry_table as autoferry
import jsc_table as jsc

from echoset.formats import scores as archive
from echoset.metrics.table import concatenate
from echoset.models.records import Scores

from . import page
from .pieces import Piece, share_of

NAME = "stations"
RUNS, SEED = 20, 1
PARTS = (*jsc.PRESETS, "budget")


def pieces(share: float) -> list[Piece]:
    """The runs, in a small share with one preset, and the measured recordings that are there."""
    parts = PARTS if share > 0.5 else PARTS[:1]
    found = [Piece(scored, (run, SEED, parts)) for run in range(share_of(RUNS, share))]
    if (autoferry.ROOT / "autoferry").exists():
        found += [Piece(measured, (scenario,)) for scenario in autoferry.SCENARIOS]
    return found


def scored(run: int, seed: int, parts: tuple[str, ...]) -> Scores:
    """The scores of all conditions over one run."""
    with TemporaryDirectory() as folder:
        paths = jsc.one(run, seed, tuple(range(1, 7)), parts, Path(folder))
        return concatenate(map(archive.read, paths))


def measured(scenario: int) -> list[str]:
    """Rows of the table of measured radar."""
    return list(autoferry.lines(scenario))


def write(results: Sequence[tuple[Piece, Any]], folder: Path) -> None:
    """Write the page, and the error over time as data."""
    simulated = [r for p, r in results if p.make is scored]
    found = [line for p, r in results if p.make is measured for line in r]
    made = next(p.arguments[2] for p, _ in results if p.make is scored)
    left = [f"`{part}`" for part in PARTS if part not in made]
    without = f" Left out with so few runs: {', '.join(left)}." if left else ""
    scores = concatenate(simulated)
    jsc.over_time(scores, folder / f"{NAME}-time.csv")
    _, _, tables = "\n".join(jsc.tables(scores, len(simulated), SEED)).partition("\n\n")
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
        MEASURED,
        lines,
        caption,
    )


INTRODUCTION = """\
E. Favarelli et al., *Multi-base station cooperative sensing with AI-aided tracking*, section IV."""
CAPACITY = """\
Published: 0.9 Gbit/s with all six sensing, more than 1 with three, 1.1 with none. The
signal-to-noise ratio of the links is not published; ours is chosen so that none gives 1.1: what
it loses to sensing is the result.

## Figure 4

OSPA over the first 100 scans as data: [stations-time.csv](stations-time.csv).

## What is not here

Figures 1 and 2 are sketches of the network and of the chain."""
MEASURED = """\
## Measured

The paper has no measurements. In their place stand recordings of the Autoferry benchmark, marine
radar with and without lidar, on which the same filters run; `make autoferry` prints them alone,
where the recordings are."""

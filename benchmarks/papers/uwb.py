"""Figure 5 and table I of Zhu, Venus, Leitinger and Witrisal: ``python -m papers.uwb [RUNS]``.

Prints, for each estimator, the mean over steps 11 to 180 of the RMSE of the device, its RMSE in the
segments of the blockages with standard errors by bootstrap over runs, the number of lost runs (an
error above 2 m after step 20) and processor milliseconds per step; then the bounds, which are the
same for all runs, since these share their path. Recordings and estimates are those of
``echoset simulate uwb-olos --seed 1`` and ``echoset estimate --seed 1``. The page has a measured
recording beside (:mod:`.labyrinth`).
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from scene import simulated

import echoset
from echoset.estimators.presets import presets
from echoset.formats import scores as archive
from echoset.metrics.bounds import pcrlb
from echoset.metrics.bounds.information import covariance_bounds
from echoset.metrics.bounds.smoothed import smoothed_bounds
from echoset.metrics.pooling import pool
from echoset.models.records import Array, Estimates, Recording, Scores
from echoset.report.plots.protocol import Inputs

from . import labyrinth, page
from .pieces import Piece, chunks, share_of

SEED = 1
SEGMENTS = ((11, 30), (31, 60), (61, 80), (81, 110), (111, 130), (131, 180))
SMOOTH = {"smooth": "whole"}
ESTIMATORS: dict[str, Mapping[str, Any]] = {
    "eopda-geo": {},
    "eopda-geo smooth": SMOOTH,
    "eopda-ideal": {},
    "eopda-ideal smooth": SMOOTH,
    "eopda-geo tuned": presets("eopda-geo")["tuned"],
    "eopda-geo tuned smooth": {**presets("eopda-geo")["tuned"], **SMOOTH},
    "eopda-ideal tuned": presets("eopda-ideal")["tuned"],
    "eopda-ideal tuned smooth": {**presets("eopda-ideal")["tuned"], **SMOOTH},
    "a-eopda-geo": {},
    "a-eopda-ideal": {},
    "ap-pda": {},
}


@dataclass(frozen=True, slots=True, eq=False)
class Campaign:
    """Errors (runs, steps) of the device [m], and processor seconds per step."""

    error: Array
    seconds: float

    def rmse(self, first: int, last: int, runs: Array | None = None) -> float:
        """Root mean square over steps ``first`` to ``last``, from 1, and over ``runs``."""
        e = self.error if runs is None else self.error[runs]
        return float(np.sqrt((e[:, first - 1 : last] ** 2).mean()))

    def mean_rmse(self, runs: Array | None = None) -> float:
        """Mean over steps 11 to 180 of the RMSE over ``runs``."""
        e = self.error if runs is None else self.error[runs]
        return float(np.sqrt((e[:, 10:180] ** 2).mean(0)).mean())

    def figures(self) -> tuple[Array, Array]:
        """The mean RMSE and the RMSE of each segment (7,), with their standard errors (7,)."""

        def all_figures(runs: Array | None = None) -> list[float]:
            return [self.mean_rmse(runs), *(self.rmse(*s, runs) for s in SEGMENTS)]

        rng, n = np.random.default_rng(0), len(self.error)
        resampled = [all_figures(rng.integers(0, n, n)) for _ in range(400)]
        return np.array(all_figures()), np.std(resampled, axis=0)

    @classmethod
    def of(cls, scores: Scores, seconds: float) -> Campaign:
        """Scores of one estimator over recordings, and the processor seconds of all."""
        found = scores.where(metric="rmse", part="device", timed=True)
        error = found.value.reshape(len(set(scores.recording)), -1)
        return cls(error, seconds / error.size)

    @property
    def lost(self) -> int:
        """Runs with an error above 2 m after step 20."""
        return int((self.error[:, 20:] > 2.0).any(1).sum())


@lru_cache(maxsize=128)
def recording(run: int) -> Recording:
    """Recording ``run`` of the scenario."""
    name = f"uwb-olos-s{SEED}-{run:04d}"
    return simulated("uwb-olos", name, SEED)


def estimated(name: str, run: int) -> Estimates:
    """The estimates of one run."""
    return echoset.estimate(recording(run), name, SEED)


def scored(name: str, runs: Iterable[int], **settings: object) -> tuple[Scores, float]:
    """Errors of ``runs`` over time with their distribution, and processor seconds of the filter."""
    tables, seconds = [], 0.0
    settings = {**ESTIMATORS.get(name, {}), **settings}
    for run in runs:
        record = recording(run)
        start = time.process_time()
        estimates = echoset.estimate(record, name.partition(" ")[0], SEED, **settings)
        seconds += time.process_time() - start
        tables += [echoset.score(estimates, record, metric) for metric in ("rmse", "cdf")]
    return Scores.join(tables), seconds


def campaign(name: str, runs: int, **settings: object) -> Campaign:
    """Estimates of ``runs`` recordings by the estimator ``name``, compared with the truth."""
    return Campaign.of(*scored(name, range(runs), **settings))


def bounds(name: str) -> Scores:
    """Scores of the bound ``name``, equal for all runs, which share their path."""
    known = smoothed_bounds if name == "pcrlb-smooth" else covariance_bounds
    return pcrlb.bounds(recording(0), pcrlb.Params(), name, name == "pcrlb-star", known)


def bound(name: str) -> Campaign:
    """The bound ``name`` on the device at each step, in place of errors."""
    return Campaign(bounds(name).where(metric=name, part="device", timed=True).value[None], 0.0)


NAME = "uwb"
RUNS, CHUNK = 100, 5
SHOWN = "eopda-geo"
"""The estimator of figure 4."""
BOUNDS = ("pcrlb", "pcrlb-smooth", "pcrlb-star")
PUBLISHED = {"eopda-geo": ("0.18", "0.33"), "eopda-ideal": ("0.16", "0.67")}
"""Average RMSE [m] and seconds a step of table I."""


def pieces(share: float) -> list[Piece]:
    """Estimators by parts of the runs, and the measured recording if it is there."""
    parts = chunks(share_of(RUNS, share), CHUNK)
    found = [Piece(estimated, (SHOWN, 0))]
    found += [Piece(scored, (name, runs)) for name in ESTIMATORS for runs in parts]
    if labyrinth.DATA.exists():
        found += [Piece(labyrinth.rmse, (s,)) for s in labyrinth.ROWS.values()]
    return found


def write(results: Sequence[tuple[Piece, Any]], folder: Path) -> None:
    """Write the page, three pictures, and the errors over time as data."""
    simulated = [(p.arguments[0], r) for p, r in results if p.make is scored]
    measured = [r for p, r in results if p.make is labyrinth.rmse]
    by_name: dict[str, list[Any]] = {name: [] for name, _ in simulated}
    for name, result in simulated:
        by_name[name].append(result)
    tables = {name: Scores.join(s for s, _ in parts) for name, parts in by_name.items()}
    rows = []
    for name, scores in tables.items():
        c = Campaign.of(scores, sum(seconds for _, seconds in by_name[name]))
        cells = [f"{v:.3f} ± {s:.3f}" for v, s in zip(*c.figures(), strict=True)]
        published, seconds = PUBLISHED.get(name, ("-", "-"))
        times = [f"{c.seconds:.4f}", seconds]
        rows.append([f"`{name}`", cells[0], published, *cells[1:], str(c.lost), *times])
    for name in BOUNDS:
        cells = [f"{v:.3f}" for v in bound(name).figures()[0]]
        rows.append([f"`{name}`", cells[0], "-", *cells[1:], "", "", ""])
    shown = next(r for p, r in results if p.make is estimated)
    scene = Inputs(recordings=(recording(0),), estimates=(shown,))
    page.picture("scene", scene, folder / f"{NAME}-scene.svg")
    runs = len(c.error)
    segments = [f"{a}-{b}" for a, b in SEGMENTS]
    head = ["", "mean", "published", *segments, "runs lost", "s a step", "published"]
    # pictures tell estimators by name alone: of each, the walks of the paper
    as_published = [table for name, table in tables.items() if " " not in name]
    everything = replace(Scores.join([*as_published, *map(bounds, BOUNDS)]), provenance={})
    pooled = pool(everything)
    for kind, record in (("rmse", (recording(0),)), ("cdf", ())):
        inputs = Inputs(recordings=record, scores=everything, pooled=pooled)
        page.picture(kind, inputs, folder / f"{NAME}-{kind}.svg")
    device = pooled.where(metric=("rmse", *BOUNDS).__contains__, part="device", timed=True)
    archive.write(device, folder / f"{NAME}-rmse.csv", "csv")
    page.write(
        folder,
        NAME,
        "A UWB device on an extended object",
        f"{runs} of its {RUNS} runs of `uwb-olos`, seed {SEED}, 5000 particles, blind start.",
        INTRODUCTION,
        page.table(head, rows),
        FIGURES,
        _measured(measured),
    )


def _measured(found: Sequence[tuple[float, float]]) -> str:
    if not found:
        return f"{MEASURED} It was not there when this page was made."
    cells = zip(labyrinth.ROWS, found, strict=True)
    rows = [[name, f"{value:.3f} ± {stderr:.3f}"] for name, (value, stderr) in cells]
    return f"{MEASURED}\n\n{page.table(['`position`, four seeds', 'device [m]'], rows)}"


def main() -> None:
    """Print the table."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    print(f"{runs} runs of uwb-olos, seed {SEED}; RMSE of the device [m] ± standard error")
    segments = " ".join(f"{f'{a}-{b}':>13s}" for a, b in SEGMENTS)
    print(f"{'':17s} {'mean 11-180':>13s} {segments} lost ms/step")
    for name in ESTIMATORS:
        c = campaign(name, runs)
        figures = " ".join(f"{v:.3f} ± {s:.3f}" for v, s in zip(*c.figures(), strict=True))
        print(f"{name:17s} {figures} {c.lost:4d} {1e3 * c.seconds:7.1f}", flush=True)
    for name in BOUNDS:
        print(f"{name:17s} " + " ".join(f"{v:13.3f}" for v in bound(name).figures()[0]))


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
`pcrlb-star` has all lines of sight, and `pcrlb-smooth` bounds what is known in hindsight. `smooth`
says each step from all of the run, and not from what came until then."""
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

if __name__ == "__main__":
    main()

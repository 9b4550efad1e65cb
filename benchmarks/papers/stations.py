"""Figures 3 and 4, capacity and error budget of Favarelli et al.

    python -m papers.stations [--runs 20] [--seed 1] [--stations 3,6] [--parts tuned] [-o DIR]

Simulates the recordings that ``echoset simulate jsc-6bs --runs 20 --seed 1`` writes and runs every
condition over each: PHD and MBM filter, gates 4 m, 6 m and by class, one to six stations, which
share their soft maps. For three and six stations each part of the chain is also replaced by the
truth in turn (the part ``budget``). Scores go to ``DIR/scores/``, named by what made them, and are
not made again: ``--stations`` and ``--parts`` do a piece of the work, tables are of all that is
there. ``DIR/jsc.md`` has the tables and ``DIR/jsc-time.csv`` the error over the first 100 scans.
The page has measured radar beside (:mod:`.autoferry`).
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import json
import os
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import cache, partial
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
import yaml
from matplotlib.figure import Figure

import echoset
from echoset.control import stations
from echoset.control.stations import FILTERS, GATES, REPLACED, Condition, conditions
from echoset.estimators.maps.detector import SHIPPED
from echoset.estimators.maps.tbd import filter as tbd
from echoset.formats import scores as archive
from echoset.formats.atomic import atomic
from echoset.formats.provenance import versions
from echoset.formats.windows import concatenate as join
from echoset.metrics.pooling import pool
from echoset.models.parameters import as_dict, resolve
from echoset.models.random import generator
from echoset.models.records import Estimates, Recording, Scores
from echoset.report.plots import style
from echoset.report.plots.panels import legend
from echoset.simulate import jsc

from . import autoferry, page
from .pieces import Piece, share_of

SCENARIO = "jsc-6bs"
START = 0.55
"""Time [s] of scan 11, the first that is scored."""
SETS = {"ospa-normalised": 5.0, "ospa": 5.0, "gospa": 5.0}
"""Metrics of order 2 with their cut-offs [m]."""
PRESET, PRESETS = "tuned", ("tuned", "paper")
"""What is measured against the published figures, and all that stands side by side."""
BUDGET = (3, 6)
"""Numbers of stations for which parts of the chain are replaced by the truth."""
OVER_TIME = 3, 100
"""Number of stations and scans of figure 4."""
PUBLISHED = {
    ("phd", 3): "< 1.0 m, accuracy > 0.85",
    ("mbm", 3): "< 0.7 m (text), about 0.7 m (conclusions), accuracy > 0.85",
    ("phd", 6): "< 0.6 m (abstract), < 0.7 m (conclusions), accuracy > 0.98",
    ("mbm", 6): "< 0.6 m (abstract), < 0.7 m (conclusions), accuracy > 0.98",
}


def scene() -> jsc.Params:
    """The parameters of the scenario."""
    path = Path(jsc.__file__).parent / "scenarios" / f"{SCENARIO}.yaml"
    return resolve(jsc.Params, (path.name, yaml.safe_load(path.read_text())["parameters"]))


def simulated(seed: int, run: int) -> Recording:
    """The recording that the command line simulates as this run."""
    name = f"{SCENARIO}-s{seed}-{run:04d}"
    return jsc.simulate(scene(), generator(seed, "simulate", name), name)


def scored(recording: Recording, condition: Condition, soft: stations.Soft, part: str) -> Scores:
    """The scores of a condition with a part of the chain replaced by the truth."""
    steps = stations.without(recording, condition, soft, part)
    over_time = condition.stations == OVER_TIME[0] and part == REPLACED[0]
    return scores(recording, steps, over_time)


def joined(steps: stations.Steps) -> Estimates:
    """The steps as one."""
    return replace(join(steps), meta=steps[0].meta)


def scores(recording: Recording, steps: stations.Steps, over_time: bool) -> Scores:
    """The scores of estimates, scan by scan too if ``over_time``."""
    estimates = joined(steps)
    tables = [
        echoset.score(estimates, recording, metric, order=2.0, cutoff=cutoff, start=START)
        for metric, cutoff in SETS.items()
    ]
    tables.append(echoset.score(estimates, recording, "accuracy", cutoff=5.0, start=START))
    tables.append(echoset.score(estimates, recording, "capacity"))
    tables = [t.where(timed=False) for t in tables]
    if over_time:
        stop = OVER_TIME[1] * scene().dt
        t = echoset.score(estimates, recording, "ospa-normalised", order=2.0, cutoff=5.0, stop=stop)
        tables.append(t.where(part="", timed=True))
    return Scores.join(tables)


def one(
    run: int, seed: int, numbers: tuple[int, ...], parts: tuple[str, ...], folder: Path
) -> list[Path]:
    """The files with the scores of one run by number of stations and part, made if missing."""
    recording, found = cache(partial(simulated, seed, run)), []
    for n in numbers:
        soft = cache(lambda n=n: _soft(recording(), n))
        for part in parts:
            name = f"{SCENARIO}-s{seed}-{run:04d}-{n}-{part}-{_digest(part)}.csv"
            if part == "budget" and n not in BUDGET:
                continue
            found.append(folder / name)
            if not found[-1].exists():
                tables = list(_part(recording(), soft(), n, part))
                with atomic(found[-1], overwrite=True) as temporary:
                    archive.write(Scores.join(tables), temporary, "csv")
    return found


def scores_of(run: int, seed: int, parts: tuple[str, ...]) -> Scores:
    """The scores of one run under all conditions."""
    with TemporaryDirectory() as folder:
        paths = one(run, seed, tuple(range(1, 7)), parts, Path(folder))
        return Scores.join(map(archive.read, paths))


def _soft(recording: Recording, n: int) -> stations.Soft:
    return stations.soft_maps(recording, Condition("phd", PRESET, "adaptive", n).params(recording))


def _part(recording: Recording, soft: stations.Soft, n: int, part: str) -> Iterator[Scores]:
    """Scores with ``n`` stations: of a preset, or with the truth for a part of the chain."""
    if part == "tbd":
        yield scores(recording, stations.before_detection(recording, n), False)
        return
    if part != "budget":
        for condition in conditions(part, (n,)):
            yield scored(recording, condition, soft, REPLACED[0])
        return
    for name in FILTERS:
        for replaced in REPLACED[1:]:
            t = scored(recording, Condition(name, PRESET, "adaptive", n), soft, replaced)
            yield replace(t, estimator=tuple(f"{e} true {replaced}" for e in t.estimator))


def _digest(part: str) -> str:
    """What the scores of a part depend on, as eight digits."""
    preset = part if part in PRESETS else PRESET
    made = {name: module.PRESETS[preset] for name, module in FILTERS.items()}
    facts = [as_dict(scene()), made, GATES, as_dict(tbd.Params()), versions()]
    data = json.dumps(facts, sort_keys=True, default=str).encode() + SHIPPED.read_bytes()
    return hashlib.sha256(data).hexdigest()[:8]


def cell(
    pooled: Mapping[tuple[str, str, str], tuple[float, float]],
    key: tuple[str, str, str],
    digits: int = 3,
) -> str:
    """Value and standard error."""
    value, stderr = pooled.get(key, (np.nan, np.nan))
    return f"{value:.{digits}f} ± {stderr:.{digits}f}" if np.isfinite(value) else "-"


def tables(p: Scores, runs: int, seed: int) -> Iterator[str]:
    """The page of the pooled scores ``p``, line by line."""
    whole = p.where(timed=False)
    columns = whole.estimator, whole.metric, whole.part, whole.value.tolist(), whole.stderr.tolist()
    pooled = {(e, m, q): (v, s) for e, m, q, v, s in zip(*columns, strict=True)}
    yield f"# Base stations that sense: {runs} runs of {SCENARIO}, seed {seed}\n"
    yield "Mean over scans 11 to 200 and runs ± standard error over runs. Normalised OSPA of order"
    yield "2, gate 5 m; standard OSPA and GOSPA of order 2, cut-off 5 m.\n"
    stations_ = range(1, 7)
    head = "| | " + " | ".join(f"N_s = {n}" for n in stations_) + " |\n" + "|---" * 7 + "|"
    for title, metric in (
        ("Normalised OSPA [m] (figure 3)", "ospa-normalised"),
        ("Accuracy of classification (figure 3)", "accuracy"),
        ("OSPA [m]", "ospa"),
        ("GOSPA [m]", "gospa"),
    ):
        yield f"\n## {title}\n\n{head}"
        for preset in PRESETS:
            for f in FILTERS:
                for g in GATES:
                    names = [Condition(f, preset, g, n).name for n in stations_]
                    cells = [cell(pooled, (name, metric, "")) for name in names]
                    yield f"| {f}, {preset}, gate {g} | " + " | ".join(cells) + " |"
        cells = [cell(pooled, (f"tbd {n}", metric, "")) for n in stations_]
        yield "| tbd | " + " | ".join(cells) + " |"
    yield "\n## Beside the published\n\n| | published | ours: OSPA [m], accuracy |\n|---|---|---|"
    for (f, n), text in PUBLISHED.items():
        name = Condition(f, PRESET, "adaptive", n).name
        both = [cell(pooled, (name, metric, "")) for metric in ("ospa-normalised", "accuracy")]
        yield f"| {f}, N_s = {n} | {text} | {', '.join(both)} |"
    yield f"\n## Error budget: normalised OSPA [m], {PRESET}, with the truth in place of a part"
    yield "\n| | " + " | ".join(REPLACED) + " |\n" + "|---" * (len(REPLACED) + 1) + "|"
    for n in BUDGET:
        for f in FILTERS:
            name = Condition(f, PRESET, "adaptive", n).name
            names = [name, *(f"{name} true {part}" for part in REPLACED[1:])]
            for part in ("", "localisation", "missed", "false"):
                cells = [cell(pooled, (e, "ospa-normalised", part)) for e in names]
                yield f"| {f}, N_s = {n}{part and f', {part}'} | " + " | ".join(cells) + " |"
    yield f"\n## Capacity [Gbit/s]\n\n{head}"
    names = [Condition("phd", PRESET, "adaptive", n).name for n in stations_]
    found = [pooled.get((name, "capacity", "")) for name in names]
    cells = [f"{value[0] / 1e9:.3f}" if value else "-" for value in found]
    yield "| | " + " | ".join(cells) + " |"


def over_time(p: Scores, path: Path) -> None:
    """Figure 4 as data: normalised OSPA scan by scan, of the pooled scores ``p``."""
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(("estimator", "time", "ospa_normalised", "stderr", "runs"))
        shown = p.where(metric="ospa-normalised", part="", timed=True)
        columns = shown.estimator, shown.time, shown.value, shown.stderr, shown.n
        for e, t, v, s, n in zip(*columns, strict=True):
            writer.writerow((e, f"{t:.2f}", f"{v:.4f}", f"{s:.4f}", n))


NAME = "stations"
RUNS, SEED = 20, 1
PARTS = (*PRESETS, "tbd", "budget")


def pieces(share: float) -> list[Piece]:
    """The runs, in a small share with one preset, and the measured recordings that are there."""
    parts = PARTS if share > 0.5 else PARTS[:1]
    found = [Piece(scores_of, (run, SEED, parts)) for run in range(share_of(RUNS, share))]
    if (autoferry.ROOT / "autoferry").exists():
        found += [Piece(autoferry.lines, (scenario,)) for scenario in autoferry.SCENARIOS]
    return found


def write(results: Sequence[tuple[Piece, Any]], folder: Path) -> None:
    """Write the page, two pictures, and the error over time as data."""
    simulated = [r for p, r in results if p.make is scores_of]
    found = [line for p, r in results if p.make is autoferry.lines for line in r]
    made = next(p.arguments[2] for p, _ in results if p.make is scores_of)
    left = [f"`{part}`" for part in PARTS if part not in made]
    without = f" Left out with so few runs: {', '.join(left)}." if left else ""
    pooled = pool(Scores.join(simulated))
    over_time(pooled, folder / f"{NAME}-time.csv")
    _draw_stations(pooled, folder / f"{NAME}-3.svg")
    _draw_time(pooled, folder / f"{NAME}-4.svg")
    _, _, numbers = "\n".join(tables(pooled, len(simulated), SEED)).partition("\n\n")
    lines = "\n".join([autoferry.HEADER, *found]) if found else "They were not there."
    caption = autoferry.CAPTION.format(block=autoferry.BLOCK) if found else ""
    page.write(
        folder,
        NAME,
        "Base stations that sense",
        f"{len(simulated)} of its {RUNS} runs of `{SCENARIO}`, seed {SEED}.{without}",
        INTRODUCTION,
        numbers,
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
                for i, (preset, gate) in enumerate(product(PRESETS, GATES)):
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
        for a, name in zip(axes, FILTERS, strict=True):
            for i, gate in enumerate(GATES):
                condition = Condition(name, PRESET, gate, OVER_TIME[0]).name
                shown = p.where(estimator=condition, metric="ospa-normalised", part="", timed=True)
                line = style.line(i) | {"marker": ""}
                a.plot(shown.time, shown.value, label=f"gate {gate}", **line)
            a.set_ylabel(f"{name}: OSPA [m]")
        axes[1].set_xlabel("time [s]")
        legend(figure, axes[0])
    page.save(figure, path)


def main() -> None:
    """Make what is missing, and the tables of all."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--stations", default="1,2,3,4,5,6")
    parser.add_argument("--parts", default=",".join(PARTS))
    parser.add_argument("-o", "--output", type=Path, default=Path("jsc"))
    given = parser.parse_args()
    numbers, parts = tuple(map(int, given.stations.split(","))), tuple(given.parts.split(","))
    folder = given.output / "scores"
    folder.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    work = partial(one, seed=given.seed, numbers=numbers, parts=parts, folder=folder)
    with ProcessPoolExecutor(given.jobs) as executor:
        list(executor.map(work, range(given.runs)))
    pooled = pool(Scores.join([archive.read(path) for path in sorted(folder.iterdir())]))
    text = "\n".join(tables(pooled, given.runs, given.seed)) + "\n"
    (given.output / "jsc.md").write_text(text)
    over_time(pooled, given.output / "jsc-time.csv")
    print(text)
    print(f"{time.perf_counter() - start:.0f} s on {given.jobs} processes")


INTRODUCTION = """\
E. Favarelli et al., *Multi-base station cooperative sensing with AI-aided tracking*, section IV.
The preset `paper` is the chain as printed; `tuned` adds to it, and was chosen on recordings of the
seeds 1001 to 1006."""
ERROR = """\
## Where the error is

Runs either tell all eight targets apart or keep one target for two, or two for one, for as long as
those stay close; of eight, each such target costs 1.1 m.

*Detection*: what is clustered are the outlines of the objects; the network sees the maps.
*Clustering*: true places and classes stand for the predictions, and nothing else makes detections,
so that this column also holds what tracking would find. *Identification*: the true classes.
*Tracking*: true places stand for the predictions, with the gates and rooms of what the network
calls them; the estimates are the detections."""
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

if __name__ == "__main__":
    main()

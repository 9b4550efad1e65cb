"""Figures 2 to 6 of Andrecki, Delande, Houssineau and Clark: ``python -m papers.control [RUNS]``.

The number of runs is 30 with p_D 0.6 and 20 with p_D 0.8, as in the paper, or that of the first
argument; two processes share them. Prints tables, and the seconds that 30 runs took.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from echoset.control import figures
from echoset.control.runs import Runs, campaign, join, mean_over
from echoset.control.surveillance import Params
from echoset.models.records import Array
from echoset.report.plots import style
from echoset.report.plots.panels import legend

from . import page
from .pieces import Piece, chunks, share_of

SEED, EVERY, WORKERS = 1, 10, 2


def run(name: str, runs: range) -> Runs:
    """Some runs under one condition."""
    return campaign(Params(**figures.CONDITIONS[name]), runs, SEED)


def published_runs(name: str) -> int:
    """Number of runs of a condition in the paper."""
    return 30 if figures.CONDITIONS[name]["p_detect"] == 0.6 else 20


NAME = "control"
CHUNK, ON_PAGE = 10, 25


def pieces(share: float) -> list[Piece]:
    """Conditions by parts of the runs."""
    return [
        Piece(run, (name, runs))
        for name in figures.CONDITIONS
        for runs in chunks(share_of(published_runs(name), share), CHUNK)
    ]


def write(results: Sequence[tuple[Piece, Any]], folder: Path) -> None:
    """Write the page."""
    found = {
        name: join(r for p, r in results if p.arguments[0] == name) for name in figures.CONDITIONS
    }
    parts = []
    for numbers, keys in FIGURES.items():
        some = {key: found[key] for key in keys}
        name = f"{NAME}-{numbers.replace(' and ', '-')}.svg"
        _draw(some, folder / name)
        parts += [f"## Figure {numbers}: {len(found[keys[0]].view)} runs"]
        parts += [f"![Targets in three regions, and error, over time]({name})"]
        parts += [f"{ACTIVITY}; {LEGENDS[numbers]}.", figures.activity(some, ON_PAGE)]
        parts += [ERRORS, figures.errors(some, ON_PAGE), LOOKS, figures.looks(some)]
    head = ["finding of the paper", "difference", "where", "ours"]
    page.write(
        folder,
        NAME,
        "Sensor control by regional statistics",
        f"Seed {SEED}; runs of one number share targets, misses, noise and clutter.",
        INTRODUCTION,
        page.table(head, findings(found)),
        SPLIT,
        *parts,
        MISSING,
    )


def _draw(campaigns: Mapping[str, Runs], path: Path) -> None:
    """Number of targets and its absolute error in each region at every other step."""
    steps = slice(None, None, 2)
    with style.style():
        figure = Figure(figsize=(18 * style.CM, 8 * style.CM), layout="constrained")
        top, bottom = figure.subplots(2, 3, sharex=True, sharey="row")
        for b in range(3):
            for i, (name, c) in enumerate(campaigns.items()):
                line = style.line(i)
                line["marker"] = ""
                mean = c.mean[:, steps, b].mean(0)
                spread = np.sqrt(c.variance[:, steps, b]).mean(0)
                step = 1 + 2 * np.arange(len(mean))
                top[b].plot(step, mean, label=name, **line)
                top[b].fill_between(
                    step, mean - spread, mean + spread, color=line["color"], alpha=0.15, lw=0
                )
                bottom[b].plot(step, c.error[:, steps, b].mean(0), **line)
            top[b].plot(step, c.true[:, steps, b].mean(0), label="true", **style.bound(0))
            top[b].set_title(f"B{b + 1}")
            bottom[b].set_xlabel("step")
        top[0].set_ylabel("targets")
        bottom[0].set_ylabel("absolute error")
        legend(figure, top[0])
    page.save(figure, path)


def findings(found: Mapping[str, Runs]) -> Iterator[list[str]]:
    """What the paper says of its figures, beside paired differences of the mean absolute error."""

    def less(a: str, b: str, where: Array, regions: list[int]) -> str:
        one, other = (mean_over(found[c].error[..., regions], where[..., regions]) for c in (a, b))
        return page.mean(one - other, 3)

    crossing = found["naive 0.6 1"].true > 0
    first = "variance better over all (figure 3)", "variance less naive"
    for regions, name in (([0], "B1"), ([1], "B2"), ([2], "B3"), ([0, 1, 2], "all regions")):
        value = less("variance 0.6 1", "naive 0.6 1", crossing, regions)
        yield [*first, f"{name} while it is crossed", value]
    empty = found["naive 0.8 10"].true == 0
    early = empty.copy()
    early[:, 150:] = False
    second = "variance better in empty B2 and B3 (figure 5)", "variance less naive"
    yield [*second, "B2 empty", less("variance 0.8 10", "naive 0.8 10", empty, [1])]
    yield [*second, "B2 empty, up to step 150", less("variance 0.8 10", "naive 0.8 10", early, [1])]
    yield [*second, "B3 empty", less("variance 0.8 10", "naive 0.8 10", empty, [2])]
    everywhere = found["birth 1"].true >= 0
    for rate in ("0.05", "20"):
        value = less("birth 1", f"birth {rate}", everywhere, [0, 1, 2])
        yield [
            "birth rate 1 best over all (figure 6)",
            f"1 less {rate}",
            "all regions, steps",
            value,
        ]


def main() -> None:
    """Run all conditions and print the tables."""
    asked = int(sys.argv[1]) if len(sys.argv) > 1 else None
    found, seconds = {}, 0.0
    with ProcessPoolExecutor(WORKERS) as pool:
        for name in figures.CONDITIONS:
            count = asked or published_runs(name)
            start = time.perf_counter()
            parts = [range(w, count, WORKERS) for w in range(WORKERS)]
            found[name] = join(pool.map(run, [name] * WORKERS, parts))
            seconds = max(seconds, (time.perf_counter() - start) * 30 / count)
    names = list(found)
    for title, keys in (("2, 3", names[:2]), ("4, 5", names[2:4]), ("6", names[4:])):
        some = {key: found[key] for key in keys}
        runs = len(found[keys[0]].view)
        print(f"## Figure {title}: {runs} runs\n\n{figures.activity(some, EVERY)}")
        print(f"{figures.errors(some, EVERY)}\n{figures.looks(some)}")
    print(f"30 runs of 250 steps under the slowest condition: {seconds:.0f} s")


INTRODUCTION = """\
M. Andrecki, E. D. Delande, J. Houssineau and D. E. Clark, *Sensor management with regional
statistics for the PHD filter*. The paper prints curves and what they show, no numbers; scene,
regions and views are the scenario's own. Mean absolute errors in the number of targets, and their
paired differences, ± standard error over runs: a negative difference agrees with the paper."""
SPLIT = """\
The row up to step 150 was split off after the whole had been seen: what the filter holds in B2
later was born in B1 while the looks went to B3, and came through unseen."""
FIGURES = {
    "2 and 3": ("naive 0.6 1", "variance 0.6 1"),
    "4 and 5": ("naive 0.8 10", "variance 0.8 10"),
    "6": ("birth 0.05", "birth 1", "birth 20"),
}
ACTIVITY = "Number of targets in the regions: true, and mean ± standard deviation of the filter"
LEGENDS = {
    "2 and 3": "detection probability 0.6, one false alarm a scan",
    "4 and 5": "detection probability 0.8, ten false alarms a scan",
    "6": "detection probability 0.8, one false alarm a scan, birth rates 0.05, 1 and 20",
}
ERRORS = "Absolute error in the number of targets ± standard error over runs:"
LOOKS = "Share of looks at each region ± standard error over runs:"
MISSING = """\
## What is not here

Figure 1 is a sketch of the scene. `make control-table` prints the tables at every tenth step."""

if __name__ == "__main__":
    main()

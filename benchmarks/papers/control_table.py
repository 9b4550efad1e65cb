"""Figures 2-6 of the sensor control paper as tables: ``python -m papers.control_table``.

The number of runs is 30 with p_D 0.6 and 20 with p_D 0.8, as in the paper, or that of the first
argument; two processes share them. Ends with the seconds that 30 runs took.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys
import time
from concurrent.futures import ProcessPoolExecutor

from echoset.control import figures
from echoset.control.runs import Runs, campaign, join
from echoset.control.surveillance import Params

SEED, EVERY, WORKERS = 1, 10, 2


def run(name: str, runs: range) -> Runs:
    """Some runs under one condition."""
    return campaign(Params(**figures.CONDITIONS[name]), runs, SEED)


def published_runs(name: str) -> int:
    """Number of runs of a condition in the paper."""
    return 30 if figures.CONDITIONS[name]["p_detect"] == 0.6 else 20


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


if __name__ == "__main__":
    main()

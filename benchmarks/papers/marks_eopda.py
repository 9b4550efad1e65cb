"""Accuracy of the UWB estimators on ``uwb-olos``: ``python -m papers.marks_eopda [RUNS]``.

Prints, for each estimator, the mean over steps 11 to 180 of the RMSE of the device, its RMSE in the
segments of the blockages with standard errors by bootstrap over runs, the number of lost runs (an
error above 2 m after step 20) and processor milliseconds per step; then both bounds, which are the
same for all runs, since these share their path. Recordings and estimates are those of
``echoset simulate uwb-olos --seed 1`` and ``echoset estimate --seed 1``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from scene import simulated

import echoset
from echoset.estimators.presets import presets
from echoset.metrics.bounds import pcrlb
from echoset.metrics.kit.table import concatenate
from echoset.models.records import Array, Estimates, Recording, Scores

SEED = 1
SEGMENTS = ((11, 30), (31, 60), (61, 80), (81, 110), (111, 130), (131, 180))
ESTIMATORS: dict[str, Mapping[str, Any]] = {
    "eopda-geo": {},
    "eopda-ideal": {},
    "eopda-geo tuned": presets("eopda-geo")["tuned"],
    "eopda-ideal tuned": presets("eopda-ideal")["tuned"],
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
        cells = zip(scores.metric, scores.part, np.isfinite(scores.time), strict=True)
        rows = [i for i, cell in enumerate(cells) if cell == ("rmse", "device", True)]
        error = scores.value[rows].reshape(len(set(scores.recording)), -1)
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
    return concatenate(tables), seconds


def campaign(name: str, runs: int, **settings: object) -> Campaign:
    """Estimates of ``runs`` recordings by the estimator ``name``, compared with the truth."""
    return Campaign.of(*scored(name, range(runs), **settings))


def bounds(name: str) -> Scores:
    """Scores of the bound ``name``, equal for all runs, which share their path."""
    return pcrlb.bounds(recording(0), pcrlb.Params(), name, blocked=name == "pcrlb-star")


def bound(name: str) -> Campaign:
    """The bound ``name`` on the device at each step, in place of errors."""
    scores = bounds(name)
    rows = zip(scores.metric, scores.part, scores.time, scores.value, strict=True)
    value = [v for m, p, t, v in rows if (m, p) == (name, "device") and not np.isnan(t)]
    return Campaign(np.array([value]), 0.0)


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
    for name in ("pcrlb", "pcrlb-star"):
        print(f"{name:17s} " + " ".join(f"{v:13.3f}" for v in bound(name).figures()[0]))


if __name__ == "__main__":
    main()

"""Many closed loops with the same worlds: what the paper's figures 2-6 are made of."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..models.geometry.regions import contains, polygon
from ..models.random import generator
from ..models.records import Array, Objects
from ..simulate.surveillance import world
from .surveillance import Params, loop


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """R runs of n steps with B regions: mean, variance and true number (R, n, B), view (R, n)."""

    mean: Array
    variance: Array
    true: Array
    view: Array

    @property
    def error(self) -> Array:
        """Absolute error of the number of targets (R, n, B)."""
        return np.asarray(np.abs(self.mean - self.true))

    def looks(self) -> Array:
        """Share of looks at each region (R, B)."""
        return np.stack([(self.view == b).mean(1) for b in range(self.mean.shape[2])], 1)


def campaign(params: Params, runs: Iterable[int], seed: int) -> Runs:
    """Closed loops of the ``runs``; the same run has the same targets under any policy."""
    found = [_run(params, run, seed) for run in runs]
    return Runs(*(np.stack(column) for column in zip(*found, strict=True)))


def join(parts: Iterable[Runs]) -> Runs:
    """The runs of all parts."""
    columns = zip(*((p.mean, p.variance, p.true, p.view) for p in parts), strict=True)
    return Runs(*map(np.concatenate, columns))


def numbers(objects: Objects, regions: Iterable[tuple[float, ...]]) -> Array:
    """True number of targets (n, B) in each region at each time."""
    n = len(objects.time_ns)
    step = np.repeat(np.arange(n), np.diff(objects.row_offset))
    inside = (contains(polygon(box), objects.columns("x", "y")) for box in regions)
    return np.stack([np.bincount(step[i], minlength=n) for i in inside], 1).astype(float)


def paired(difference: Array) -> tuple[float, float]:
    """Mean and standard error of paired differences (R,), NaN where a run has none."""
    d = difference[np.isfinite(difference)]
    return float(d.mean()), float(d.std(ddof=1) / np.sqrt(len(d)))


def mean_over(values: Array, where: Array) -> Array:
    """Mean (R,) of ``values`` (R, ...) of each run ``where`` true; NaN where it nowhere is."""
    axes = tuple(range(1, values.ndim))
    count = where.sum(axes)
    total = np.where(where, values, 0.0).sum(axes)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def _run(params: Params, run: int, seed: int) -> tuple[Array, Array, Array, Array]:
    drawn = world(params, generator(seed, "control", f"surveillance-{run:04d}"))
    steps = list(loop(params, drawn))
    return (
        np.array([s.mean for s in steps]),
        np.array([s.variance for s in steps]),
        numbers(drawn.objects, params.regions),
        np.array([s.view for s in steps]),
    )

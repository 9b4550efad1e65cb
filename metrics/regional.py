"""Numbers of targets in regions: their posterior mean and deviation against the true number.

``regional`` is the absolute error of the mean, ``regional-error`` its signed error,
``regional-std`` the posterior standard deviation, ``regional-true`` the number itself; the part is
the name of the region. Regions are those that the estimator was run with, or any others if it kept
its mixture (``estimate --keep``).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..models.errors import InputError
from ..models.geometry.regions import contains, polygon, polygons, statistics
from ..models.parameters import parameter
from ..models.records import Array, Estimates, Recording, Scores
from .kit.measured import Measured, Names
from .kit.series import Steps, parts, series
from .kit.sets import align
from .protocol import Metric


@dataclass(frozen=True, slots=True)
class Params(Steps):
    """Which regions and steps are scored."""

    regions: Any = parameter(
        {}, "m", "name to x_min, x_max, y_min, y_max or to corners; empty: the estimator's own"
    )

    def __post_init__(self) -> None:
        Steps.__post_init__(self)
        polygons(self.regions)


def measure(estimates: Estimates, recording: Recording, params: Params) -> Measured:
    """Errors, deviations and true numbers per step and region.

    Raises
    ------
    InputError : no truth, no regions, or regions of which the estimates say nothing
    """
    own = estimates.making.parameters.get("regions") or {}
    regions = params.regions or own
    if not regions:
        raise InputError(f"{estimates.meta.name}: no regions: give regional.regions.NAME=...")
    aligned = align(estimates, recording, params)
    values = {}
    for name, corners in regions.items():
        mean, variance = (v[aligned.steps] for v in _moments(estimates, name, corners, own))
        inside = contains(polygon(corners), aligned.position_truth[:, :2])
        step = np.repeat(np.arange(len(aligned)), aligned.counts[0])
        true = np.bincount(step[inside], minlength=len(aligned)).astype(float)
        std = np.sqrt(np.maximum(variance, 0.0))
        values[name] = np.stack((mean - true, std, true), 1)
    return Measured(aligned.time, values, aligned.left_out)


def summarise(names: Names, measured: Measured, params: Params) -> Scores:
    """Errors, deviations and true numbers per step and region, and their means."""
    error = {name: np.abs(values[:, 0]) for name, values in measured.values.items()}
    tables = [parts((*names, "regional"), measured, error, params.block)]
    for name, values in measured.values.items():
        for kind, column in zip(("error", "std", "true"), values.T, strict=True):
            key = (*names, f"regional-{kind}", name)
            tables.append(series(key, measured.time, column, params.block))
    return Scores.join(tables)


def _moments(
    estimates: Estimates, name: str, corners: Any, own: Mapping[str, Any]
) -> tuple[Array, Array]:
    """Mean and variance (n,) of the number of targets in a region at every step."""
    steps = estimates.steps
    if name in own and np.array_equal(polygon(own[name]), polygon(corners)):
        return steps[f"region_mean_{name}"], steps[f"region_variance_{name}"]
    if "mixture_weight" not in steps:
        raise InputError(
            f"{estimates.meta.name}: nothing known of region {name}: estimate with --keep"
        )
    columns = [steps[f"mixture_{key}"] for key in ("weight", "mean", "covariance", "detection")]
    region = {name: polygon(corners)}
    found = [_of_step(row, region)[name] for row in zip(*columns, strict=True)]
    mean, variance = np.reshape(found, (-1, 2)).T
    return mean, variance


def _of_step(
    mixture: tuple[Array, ...], regions: Mapping[str, Array]
) -> dict[str, tuple[float, float]]:
    w, m, P, detection = mixture
    used = w > 0
    return statistics(w[used], m[used], P[used], detection[used], regions)


METRIC = Metric(
    "number of targets in regions: error of its mean, and its standard deviation",
    Params,
    measure,
    summarise,
)

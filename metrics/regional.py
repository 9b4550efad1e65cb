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
from ..models.parameters import parameter
from ..models.records import Estimates, Recording, Scores
from ..models.regions import contains, polygon, polygons, statistics
from .series import Steps, parts
from .sets import sets
from .table import concatenate

SUMMARY = "number of targets in regions: error of its mean, and its standard deviation"
PARTS = ()
NEEDS_SCANS = False
QUADRATIC = ()
Array = np.ndarray[Any, Any]


@dataclass(frozen=True, slots=True)
class Params(Steps):
    """Which regions and steps are scored."""

    regions: Any = parameter(
        {}, "m", "name to x_min, x_max, y_min, y_max or to corners; empty: the estimator's own"
    )

    def __post_init__(self) -> None:
        Steps.__post_init__(self)
        polygons(self.regions)


def score(estimates: Estimates, recording: Recording, params: Params) -> Scores:
    """Errors, deviations and true numbers per step and region, and their means.

    Raises
    ------
    InputError : no truth, no regions, or regions of which the estimates say nothing
    """
    own = estimates.meta.provenance.get("parameters", {}).get("regions") or {}
    regions = params.regions or own
    if not regions:
        raise InputError(f"{estimates.meta.name}: no regions: give regional.regions.NAME=...")
    aligned = sets(estimates, recording, params)
    values: dict[str, dict[str, Array]] = {"": {}, "-error": {}, "-std": {}, "-true": {}}
    for name, corners in regions.items():
        mean, variance = (v[aligned.steps] for v in _moments(estimates, name, corners, own))
        inside = contains(polygon(corners), aligned.position_truth[:, :2])
        true = np.add.reduceat(
            np.append(inside, False).astype(float), aligned.truth.row_offset[:-1]
        )
        true[aligned.counts[0] == 0] = 0.0
        found = (np.abs(mean - true), mean - true, np.sqrt(np.maximum(variance, 0.0)), true)
        for kind, value in zip(values, found, strict=True):
            values[kind][name] = value
    names = recording.meta.name, estimates.estimator
    return concatenate(
        parts((*names, f"regional{kind}"), aligned, found, params.block)
        for kind, found in values.items()
    )


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
    found = [_of_step(*row, region)[name] for row in zip(*columns, strict=True)]
    mean, variance = np.reshape(found, (-1, 2)).T
    return mean, variance


def _of_step(
    w: Array, m: Array, P: Array, detection: Array, regions: Mapping[str, Array]
) -> dict[str, tuple[float, float]]:
    used = w > 0
    return statistics(w[used], m[used], P[used], detection[used], regions)

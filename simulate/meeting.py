"""Targets that come close in the middle of the recording and part again.

After Williams, Marginal multi-Bernoulli filters: RFS derivation of MHT, JIPDA, and
association-based MeMBer, 2015, section VII: all are drawn around one point for the middle step,
and walk from there both forwards and backwards in time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..models.parameters import parameter
from ..models.records import Recording
from . import points
from .targets import from_middle, objects

SUMMARY = "four targets that come close in the middle, among clutter; positions"


@dataclass(frozen=True, slots=True)
class Params(points.Positions):
    """Scans and targets."""

    steps: int = parameter(81, "1", "number of scans", within="[1, inf)")
    p_detect: float = parameter(0.9, "1", "probability that a target is detected", within="[0, 1]")
    clutter_rate: float = parameter(10.0, "1", "expected false alarms per scan", within="[0, inf)")
    clutter_region: tuple[float, float, float, float] = parameter(
        (0.0, 300.0, 0.0, 300.0), "m", "x_min, x_max, y_min, y_max of the false alarms"
    )
    std_position: float = parameter(1.0, "m", "standard deviation of x and of y", within="[0, inf)")
    targets: int = parameter(4, "1", "number of targets", within="[0, inf)")
    centre: tuple[float, float] = parameter((150.0, 150.0), "m", "where they meet")
    spread: float = parameter(
        0.1,
        "m2, m2 s-2",
        "variance of each position and velocity in the middle step",
        within="[0, inf)",
    )
    noise_density: float = parameter(
        0.01, "m2 s-3", "power spectral density of the targets' acceleration", within="[0, inf)"
    )
    first: tuple[int, ...] = parameter(
        (), "1", "first steps of the first targets, others 1", within="[1, inf)"
    )
    last: tuple[int, ...] = parameter(
        (40,), "1", "last steps of the first targets, others all", within="[1, inf)"
    )


def simulate(params: Params, rng: np.random.Generator, name: str) -> Recording:
    """A recording of the scene with its truth, called ``name``."""
    n, count = params.steps, params.targets
    middle = np.sqrt(params.spread) * rng.normal(size=(count, 4)) + (*params.centre, 0, 0)
    state = from_middle(middle, n, params.dt, params.noise_density, rng)
    first, last = np.ones(count), np.full(count, n)
    first[: len(params.first)] = params.first[:count]
    last[: len(params.last)] = params.last[:count]
    step = np.arange(1, n + 1)[:, None]
    alive = (first <= step) & (step <= last)
    return points.positions(params, objects(params.time_ns, alive, state), rng, name)

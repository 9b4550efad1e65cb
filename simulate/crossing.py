"""Targets on nearly straight lines that cross: each from a given state, over given steps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..models.parameters import parameter
from ..models.records import Recording
from . import points
from .targets import Starts, check_starts, objects, walk

SUMMARY = "targets on nearly straight lines that cross, among clutter; positions"


@dataclass(frozen=True, slots=True)
class Params(points.Positions):
    """Scans and targets."""

    targets: Starts = parameter(
        (
            (-500.0, -200.0, 10.0, 4.0, 1, 100),
            (-500.0, 200.0, 10.0, -4.0, 1, 100),
            (0.0, -500.0, 0.0, 10.0, 1, 100),
            (-300.0, 400.0, 8.0, -3.0, 31, 80),
        ),
        "m, m, m s-1, m s-1, 1, 1",
        "x, y, vx, vy at the first step, first and last step of each target",
    )
    noise_density: float = parameter(
        0.001, "m2 s-3", "power spectral density of the targets' acceleration", within="[0, inf)"
    )

    def __post_init__(self) -> None:
        points.Positions.__post_init__(self)
        check_starts(self.targets)


def simulate(params: Params, rng: np.random.Generator, name: str) -> Recording:
    """A recording of the scene with its truth, called ``name``."""
    alive, state = walk(params.targets, params.steps, params.dt, params.noise_density, rng)
    return points.positions(params, objects(params.time_ns, alive, state), rng, name)

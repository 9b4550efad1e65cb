"""Targets seen in range and bearing by the radar of a platform that moves and turns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..models.parameters import parameter
from ..models.records import Array, Recording
from . import points
from .targets import Starts, check_starts, objects, walk

SUMMARY = "targets around a moving and turning platform, among clutter; range and bearing"


@dataclass(frozen=True, slots=True)
class Params(points.Bearings):
    """Scans, platform and targets."""

    steps: int = parameter(150, "1", "number of scans", within="[1, inf)")
    p_detect: float = parameter(
        0.9, "1", "probability that a target in view is detected", within="[0, 1]"
    )
    clutter_rate: float = parameter(10.0, "1", "expected false alarms per scan", within="[0, inf)")
    platform: tuple[float, float, float] = parameter(
        (0.0, 0.0, 0.0), "m, m, rad", "x, y and heading of the platform at the first scan"
    )
    speed: float = parameter(5.0, "m s-1", "speed of the platform")
    turn_rate: float = parameter(0.01, "rad s-1", "turn rate of the platform, anticlockwise")
    targets: Starts = parameter(
        (
            (300.0, -200.0, 2.0, 3.0, 1, 150),
            (500.0, 300.0, -4.0, 0.0, 1, 150),
            (-200.0, 250.0, 5.0, 0.0, 1, 150),
            (100.0, 500.0, 2.0, -4.0, 1, 100),
            (400.0, 0.0, 0.0, 0.0, 51, 150),
        ),
        "m, m, m s-1, m s-1, 1, 1",
        "x, y, vx, vy at the first step, first and last step of each target",
    )
    noise_density: float = parameter(
        0.01, "m2 s-3", "power spectral density of the targets' acceleration", within="[0, inf)"
    )

    def __post_init__(self) -> None:
        points.Bearings.__post_init__(self)
        check_starts(self.targets)


def simulate(params: Params, rng: np.random.Generator, name: str) -> Recording:
    """A recording of the scene with its truth, called ``name``."""
    alive, state = walk(params.targets, params.steps, params.dt, params.noise_density, rng)
    targets = objects(params.time_ns, alive, state)
    return points.bearings(params, targets, poses(params), rng, name)


def poses(params: Params) -> Array:
    """x, y [m] and heading [rad] of the platform at each scan, (steps, 3): a circle or a line."""
    x, y, heading = params.platform
    t = np.arange(params.steps) * params.dt
    turned = params.turn_rate * t
    chord = params.speed * t * np.sinc(turned / (2 * np.pi))
    along = heading + turned / 2
    return np.column_stack((x + chord * np.cos(along), y + chord * np.sin(along), heading + turned))

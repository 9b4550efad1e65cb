"""Targets that go straight, turn and stop, all at the same times, each to its own side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..models.motion import coordinated_turn
from ..models.parameters import parameter, require
from ..models.records import Array, Recording
from . import points
from .targets import objects, step_noise

SUMMARY = "targets that turn and stop among straight runs, among clutter; positions"


@dataclass(frozen=True, slots=True)
class Params(points.Positions):
    """Scans and targets."""

    clutter_region: tuple[float, float, float, float] = parameter(
        (-2000.0, 2000.0, -2000.0, 2000.0), "m", "x_min, x_max, y_min, y_max of the false alarms"
    )
    std_position: float = parameter(
        10.0, "m", "standard deviation of x and of y", within="[0, inf)"
    )
    targets: int = parameter(6, "1", "number of targets", within="[0, inf)")
    speed: tuple[float, float] = parameter(
        (10.0, 20.0), "m s-1", "least and greatest at the start", within="[0, inf)"
    )
    turns: tuple[tuple[int, int], ...] = parameter(
        ((21, 35), (61, 75)), "1", "first and last step of each turn, to either side"
    )
    turn_rate: float = parameter(0.15, "rad s-1", "of turns", within="[0, inf)")
    stops: tuple[tuple[int, int], ...] = parameter(
        ((46, 50),), "1", "first and last step of each time in which the speed halves at every step"
    )
    noise_density: float = parameter(
        0.01, "m2 s-3", "power spectral density of the targets' acceleration", within="[0, inf)"
    )

    def __post_init__(self) -> None:
        points.Positions.__post_init__(self)
        require(self.speed[0] <= self.speed[1], "speed", "least and greatest", self.speed)
        for name in ("turns", "stops"):
            for span in getattr(self, name):
                require(1 <= span[0] <= span[1], name, "1 <= first step <= last step", span)


def simulate(params: Params, rng: np.random.Generator, name: str) -> Recording:
    """A recording of the scene with its truth, called ``name``."""
    n, N = params.steps, params.targets
    low, high = np.reshape(params.clutter_region, (2, 2)).T
    speed, heading = rng.uniform(*params.speed, N), rng.uniform(-np.pi, np.pi, N)
    velocity = speed[:, None] * np.stack((np.cos(heading), np.sin(heading)), 1)
    x = np.hstack((rng.uniform(low / 2, high / 2, (N, 2)), velocity))
    side = rng.choice([-1.0, 1.0], (len(params.turns), N))
    state = np.zeros((n, N, 4))
    for k in range(n):
        if k:
            x = _moved(params, x, k + 1, side)
            x = x + step_noise(params.dt, params.noise_density, N, rng)
        state[k] = x
    alive = np.ones((n, N), bool)
    return points.positions(params, objects(params.time_ns, alive, state), rng, name)


def _moved(params: Params, x: Array, step: int, side: Array) -> Array:
    """States (N, 4) at ``step`` from those before, without noise."""
    rate = np.zeros(len(x))
    for (first, last), to in zip(params.turns, side, strict=True):
        if first <= step <= last:
            rate = params.turn_rate * to
    for first, last in params.stops:
        if first <= step <= last:
            x = np.hstack((x[:, :2], x[:, 2:] / 2))
    turned = [coordinated_turn(params.dt, r) @ one for r, one in zip(rate, x, strict=True)]
    return np.array(turned).reshape(-1, 4)

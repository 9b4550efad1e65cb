"""Vehicles on a roundabout: targets that turn all the time, under a radar among clutter.

Filters with a straight-line motion model lag behind them, the more the larger ``speed`` is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from echoset.models.parameters import parameter, require
from echoset.models.records import Objects, Recording
from echoset.simulate import points

SUMMARY = "vehicles that circle a roundabout, among clutter; positions"


@dataclass(frozen=True, slots=True)
class Params(points.Positions):
    """Scans (see :class:`echoset.simulate.points.Positions`) and vehicles."""

    steps: int = parameter(100, "1", "number of scans")
    dt: float = parameter(0.2, "s", "time between scans; scan k is at k dt")
    clutter_rate: float = parameter(5.0, "1", "expected false alarms per scan")
    clutter_region: tuple[float, float, float, float] = parameter(
        (-40.0, 40.0, -40.0, 40.0), "m", "x_min, x_max, y_min, y_max of the false alarms"
    )
    std_position: float = parameter(0.5, "m", "standard deviation of x and of y")
    vehicles: int = parameter(4, "1", "number of vehicles, evenly spaced")
    radius: float = parameter(20.0, "m", "radius of their circle")
    speed: float = parameter(8.0, "m s-1", "speed of all, anticlockwise")
    speed_std: float = parameter(0.2, "m s-1", "standard deviation of the speed of each")

    def __post_init__(self) -> None:
        points.Positions.__post_init__(self)
        require(self.vehicles >= 1, "vehicles", "at least 1", self.vehicles)
        require(self.radius > 0, "radius", "positive", self.radius)
        require(self.speed_std >= 0, "speed_std", "at least 0", self.speed_std)


def simulate(params: Params, rng: np.random.Generator, name: str) -> Recording:
    """A recording of the roundabout with its truth, called ``name``."""
    n, steps = params.vehicles, params.steps
    speed = params.speed + params.speed_std * rng.normal(size=n)
    start = rng.uniform(0, 2 * np.pi) + 2 * np.pi * np.arange(n) / n
    angle = start + np.outer(params.time_ns * 1e-9, speed / params.radius)
    across, along = np.cos(angle), np.sin(angle)
    state = np.stack(
        (params.radius * across, params.radius * along, -speed * along, speed * across), axis=-1
    )
    truth = Objects(
        params.time_ns,
        n * np.arange(steps + 1),
        np.tile(np.arange(n), steps),
        ("x", "y", "vx", "vy"),
        ("m", "m", "m s-1", "m s-1"),
        state.reshape(-1, 4),
    )
    return points.positions(params, truth, rng, name)

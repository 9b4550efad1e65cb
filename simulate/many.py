"""Many targets that appear anywhere at any time, live for a while, and leave."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..models.motion import constant_velocity
from ..models.parameters import parameter
from ..models.records import Array, Objects, Recording
from . import points
from .targets import STATE, UNITS, step_noise

SUMMARY = "many targets that are born and die, in clutter; positions"


@dataclass(frozen=True, slots=True)
class Params(points.Positions):
    """Scans, and the birth, motion and death of targets."""

    clutter_rate: float = parameter(60.0, "1", "expected false alarms per scan", within="[0, inf)")
    clutter_region: tuple[float, float, float, float] = parameter(
        (-1000.0, 1000.0, -1000.0, 1000.0),
        "m",
        "x_min, x_max, y_min, y_max of the false alarms and of the births",
    )
    birth_rate: float = parameter(0.4, "1", "expected births per scan", within="[0, inf)")
    initial_rate: float = parameter(
        20.0, "1", "expected number of targets at the first scan", within="[0, inf)"
    )
    p_survive: float = parameter(
        0.98, "1", "probability that a target lives to the next scan", within="[0, 1]"
    )
    std_velocity: float = parameter(
        10.0, "m s-1", "standard deviation of vx and of vy of a new target", within="[0, inf)"
    )
    noise_density: float = parameter(
        0.1, "m2 s-3", "power spectral density of the targets' acceleration", within="[0, inf)"
    )


def simulate(params: Params, rng: np.random.Generator, name: str) -> Recording:
    """A recording of the scene with its truth, called ``name``."""
    return points.positions(params, targets(params, rng), rng, name)


def targets(params: Params, rng: np.random.Generator) -> Objects:
    """Targets at every scan; who leaves the region is gone."""
    F, _ = constant_velocity(params.dt)
    x_min, x_max, y_min, y_max = params.clutter_region
    low, high = np.array((x_min, y_min)), np.array((x_max, y_max))

    def born(rate: float) -> Array:
        count = rng.poisson(rate)
        velocity = params.std_velocity * rng.normal(size=(count, 2))
        return np.hstack((rng.uniform(low, high, (count, 2)), velocity))

    x = born(params.initial_rate)
    label = np.arange(len(x))
    states, labels, used = [x], [label], len(x)
    for _ in range(params.steps - 1):
        x = x @ F.T + step_noise(params.dt, params.noise_density, len(x), rng)
        stays = rng.random(len(x)) < params.p_survive
        stays &= ((low <= x[:, :2]) & (x[:, :2] <= high)).all(1)
        new = born(params.birth_rate)
        x = np.vstack((x[stays], new))
        label = np.concatenate((label[stays], used + np.arange(len(new))))
        used += len(new)
        states.append(x)
        labels.append(label)
    offset = np.cumsum([0, *map(len, labels)])
    columns = (np.concatenate(labels), STATE, UNITS, np.vstack(states))
    return Objects(params.time_ns, offset, *columns)

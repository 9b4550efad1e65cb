"""Many targets that manoeuvre a little among clutter: as many of both as you like.

Half of the targets are there from the start, the others appear at any time of the first half; one
in four disappears at any time of the last quarter. They start in the inner four fifths of the area,
and none leaves it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..models.errors import ParameterError
from ..models.motion import constant_velocity
from ..models.parameters import parameter
from ..models.records import Array, Recording
from . import points
from .targets import objects, step_noise

SUMMARY = "any number of targets, born and gone at any time, in any clutter; positions"
_TRIES = 1000
_INNER = 0.8


@dataclass(frozen=True, slots=True)
class Params(points.Positions):
    """Scans and targets."""

    clutter_region: tuple[float, float, float, float] = parameter(
        (-1000.0, 1000.0, -1000.0, 1000.0),
        "m",
        "x_min, x_max, y_min, y_max of the false alarms, which targets do not leave",
    )
    std_position: float = parameter(
        10.0, "m", "standard deviation of x and of y", within="[0, inf)"
    )
    targets: int = parameter(20, "1", "number of targets", within="[0, inf)")
    std_velocity: float = parameter(
        6.0, "m s-1", "standard deviation of vx and of vy of a new target", within="[0, inf)"
    )
    noise_density: float = parameter(
        0.25, "m2 s-3", "power spectral density of the targets' acceleration", within="[0, inf)"
    )


def simulate(params: Params, rng: np.random.Generator, name: str) -> Recording:
    """A recording of the scene with its truth, called ``name``.

    Raises
    ------
    ParameterError : the targets do not stay in the area
    """
    n, count = params.steps, params.targets
    first, last = np.ones(count, int), np.full(count, n)
    late, gone = np.arange(count) >= (count + 1) // 2, np.arange(count) % 4 == 3
    first[late] = rng.integers(1, n // 2 + 1, late.sum(), endpoint=False) if n > 1 else 1
    last[gone] = rng.integers(n - n // 4, n, gone.sum(), endpoint=True)
    step = np.arange(1, n + 1)[:, None]
    alive = (first <= step) & (step <= last)
    state = _walks(params, alive, rng)
    return points.positions(params, objects(params.time_ns, alive, state), rng, name)


def _walks(params: Params, alive: Array, rng: np.random.Generator) -> Array:
    """States (n, N, 4) while the targets are ``alive`` (n, N), all in the area.

    Raises
    ------
    ParameterError : too many leave it
    """
    n, count = alive.shape
    x_min, x_max, y_min, y_max = params.clutter_region
    low, high = np.array((x_min, y_min)), np.array((x_max, y_max))
    margin = (1 - _INNER) / 2 * (high - low)
    F, _ = constant_velocity(params.dt)
    state = np.zeros((n, count, 4))
    left = np.arange(count)
    for _ in range(_TRIES):
        if not len(left):
            return state
        place = rng.uniform(low + margin, high - margin, (len(left), 2))
        x = np.hstack((place, params.std_velocity * rng.normal(size=(len(left), 2))))
        for k in range(n):
            begun = np.asarray(alive[:k, left].any(axis=0))
            moved = x @ F.T + step_noise(params.dt, params.noise_density, len(left), rng)
            x = np.where(begun[:, None], moved, x)
            state[k, left] = x
        out = (state[:, left, :2] < low) | (state[:, left, :2] > high)
        left = left[np.asarray((out & alive[:, left, None]).any(axis=(0, 2)))]
    raise ParameterError(f"targets: {len(left)} of {count} do not stay in the area")

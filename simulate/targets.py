"""Point targets in the plane that move at nearly constant velocity."""

from __future__ import annotations

import numpy as np

from ..models.motion import constant_velocity
from ..models.parameters import require
from ..models.records import Array, Objects

STATE, UNITS = ("x", "y", "vx", "vy"), ("m", "m", "m s-1", "m s-1")
Starts = tuple[tuple[float, float, float, float, int, int], ...]
"""State x y vx vy [m, m/s] of each target at its first step, and its first and last step from 1."""


def check_starts(targets: Starts) -> None:
    """Refuse targets that end before they start."""
    for target in targets:
        first, last = target[4:]
        require(1 <= first <= last, "targets", "with 1 <= first step <= last step", target)


def walk(
    targets: Starts, steps: int, dt: float, density: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """When ``targets`` live (steps, N) and their states (steps, N, 4), from the first steps on."""
    table = np.array(targets, float).reshape(-1, 6)
    step = np.arange(1, steps + 1)[:, None]
    first, last = table[:, 4], table[:, 5]
    F, _ = constant_velocity(dt)
    state = np.zeros((steps, len(table), 4))
    x = table[:, :4]
    for k in range(steps):
        moving = x @ F.T + step_noise(dt, density, len(table), rng)
        x = np.where((step[k] > first)[:, None], moving, x)
        state[k] = x
    return (first <= step) & (step <= last), state


def from_middle(
    middle: Array, steps: int, dt: float, density: float, rng: np.random.Generator
) -> Array:
    """States (steps, N, 4) that walk from ``middle`` (N, 4), the middle step's, both ways."""
    F, _ = constant_velocity(dt)
    count, k0 = len(middle), (steps - 1) // 2
    state = np.zeros((steps, count, 4))
    state[k0] = middle
    for k in range(k0 + 1, steps):
        state[k] = state[k - 1] @ F.T + step_noise(dt, density, count, rng)
    for k in range(k0 - 1, -1, -1):
        back = state[k + 1] - step_noise(dt, density, count, rng)
        state[k] = np.linalg.solve(F, back.T).T
    return state


def objects(time_ns: Array, alive: Array, state: Array) -> Objects:
    """Targets from ``alive`` (n, N) and ``state`` (n, N, 4); a label is the column."""
    _, label = np.nonzero(alive)
    offset = np.concatenate(([0], np.cumsum(alive.sum(1))))
    return Objects(time_ns, offset, label.astype(np.int64), STATE, UNITS, state[alive])


def step_noise(dt: float, density: float, count: int, rng: np.random.Generator) -> Array:
    """Noise (count, 4) of a step of constant velocity disturbed by white acceleration.

    ``density`` [m2 s-3] is the power spectral density of the acceleration along each axis:
    covariance ``density [[dt^3/3, dt^2/2], [dt^2/2, dt]]`` of position and velocity.
    """
    a, b = np.sqrt(density) * rng.normal(size=(2, count, 2))
    return np.hstack((np.sqrt(dt**3 / 3) * a, np.sqrt(3 * dt) / 2 * a + np.sqrt(dt) / 2 * b))

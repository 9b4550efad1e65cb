"""Particles that move as odometry tells: by its way, turned by the heading that each has."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, sqrt
from typing import TypeGuard

import numpy as np

from ...models.records import Array
from .odometry import Increment
from .state import State

LEAST = 1e-9
"""Least variance of an increment [m^2, rad^2]."""
ENOUGH = 0.5
"""Share of an interval of which odometry has to tell."""


def is_told(moved: Increment | None) -> TypeGuard[Increment]:
    """Whether odometry tells of the interval."""
    return moved is not None and moved.covered > ENOUGH


def first_headings(moved: Sequence[Increment | None], n: int, rng: np.random.Generator) -> Array:
    """Headings (n,) at first: as last told, or anything; none (0,) without odometry."""
    told = [one for one in moved if one is not None]
    if not told:
        return np.zeros(0)
    known = [one for one in told if np.isfinite(one.heading)]
    if known:
        return np.asarray(known[-1].heading + sqrt(known[-1].heading_variance) * rng.normal(size=n))
    return 2 * pi * rng.random(n)


def drive(
    state: State, dt: float, moved: Increment, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Positions and velocities (4, N) after an increment, and headings (N,)."""
    root = np.linalg.cholesky(moved.covariance + LEAST * np.eye(3))
    noise = root @ rng.normal(size=(3, state.y.shape[1]))
    # of what is not covered, the covered part tells
    ahead, left = moved.displacement[:, None] / moved.covered + noise[:2]
    c, s = np.cos(state.heading), np.sin(state.heading)
    step = np.stack((c * ahead - s * left, s * ahead + c * left))
    motion = np.vstack((state.y[:2] + step, step / dt))
    return motion, state.heading + moved.turn / moved.covered + noise[2]


def log_heading(state: State, moved: Increment) -> Array:
    """Log-likelihood (N,) of the absolute heading that odometry tells."""
    v = max(moved.heading_variance, LEAST)
    e = (state.heading - moved.heading + pi) % (2 * pi) - pi
    return np.asarray(-0.5 * e**2 / v - 0.5 * np.log(2 * pi * v))

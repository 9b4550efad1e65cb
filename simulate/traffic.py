"""Vehicles on lanes and pedestrians on crosswalks, each in one of five kinds of motion.

Whoever turns leaves its line on a quarter circle for another line at right angles. Scenes are drawn
until all stay in the area and keep clear of each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..models.errors import ParameterError
from ..models.records import Array

MOTIONS = ("static", "uniform", "turn", "accelerated", "decelerated")
_TRIES = 2000


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A lane or crosswalk from ``start`` (2,) [m] along the unit vector ``u`` for ``length``."""

    start: Array
    u: Array
    length: float

    @staticmethod
    def of(ends: Sequence[float]) -> Line:
        """The line of x0, y0, x1, y1."""
        a, b = np.asarray(ends, float).reshape(2, 2)
        length = float(np.hypot(*(b - a)))
        return Line(a, (b - a) / length, length)

    def points(self, spacing: float) -> Array:
        """Points (n, 2) in the middle of equal parts that are ``spacing`` long or a little less."""
        n = int(np.ceil(self.length / spacing))
        return np.asarray(self.start + (np.arange(n) + 0.5)[:, None] * (self.length / n) * self.u)


@dataclass(frozen=True, slots=True, eq=False)
class Walker:
    """A moving target: its lines, speeds [m s-1], turn radii [m] and room about its centre [m]."""

    lines: Mapping[str, Sequence[float]]
    speed: tuple[float, float]
    turn_radius: tuple[float, float]
    room: float


def draw(
    walkers: Sequence[Walker], t: Array, half: float, clearance: float, rng: np.random.Generator
) -> tuple[Array, Array]:
    """States x y vx vy (n, T, 4) and headings (n, T) [rad] of walkers at times ``t`` (T,) [s].

    All centres stay within ``half`` [m] of both axes; any two keep their room and ``clearance``.

    Raises
    ------
    ParameterError : no such scene was found
    """
    for _ in range(_TRIES):
        found: list[tuple[Array, Array]] = []
        for i, walker in enumerate(walkers):
            for _ in range(20):
                state, heading = _track(walker, t, rng)
                if np.abs(state[:, :2]).max() <= half and all(
                    np.hypot(*(state[:, :2] - other[:, :2]).T).min()
                    >= walker.room + walkers[j].room + clearance
                    for j, (other, _) in enumerate(found)
                ):
                    found.append((state, heading))
                    break
            if len(found) <= i:
                break
        else:
            return np.array([s for s, _ in found]), np.array([h for _, h in found])
    raise ParameterError(f"clearance: no room for {len(walkers)} objects with {clearance:g} m")


def _track(walker: Walker, t: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """State (T, 4) and heading (T,) of one walker."""
    lines = [Line.of(ends) for ends in walker.lines.values()]
    motion = MOTIONS[rng.integers(len(MOTIONS))]
    line = lines[rng.integers(len(lines))]
    low, high = walker.speed
    v = rng.uniform(low, high)
    duration = max(float(t[-1]), 1e-9)
    change = {"accelerated": high - v, "decelerated": -v}.get(motion, 0.0) * rng.random()
    if motion == "static":
        v = 0.0
    s = v * t + change / duration * t**2 / 2
    speed = v + change / duration * t
    s = s + rng.uniform(0.0, line.length)
    across = [other for other in lines if abs(other.u @ line.u) < 1e-6]
    if motion == "turn" and across:
        radius = rng.uniform(*walker.turn_radius)
        return _turning(line, across[rng.integers(len(across))], radius, s, speed)
    return _state(line.start + s[:, None] * line.u, np.tile(line.u, (len(t), 1)), speed)


def _turning(a: Line, b: Line, radius: float, s: Array, speed: Array) -> tuple[Array, Array]:
    """Along ``a`` to the arc that leads into the direction of ``b``, and on along ``b``."""
    corner = a.start + ((b.start - a.start) @ a.u) * a.u
    before = (corner - a.start) @ a.u - radius
    phi = np.clip((s - before) / radius, 0.0, np.pi / 2)
    arc = (
        a.start
        + before * a.u
        + radius * (np.sin(phi)[:, None] * a.u + (1 - np.cos(phi))[:, None] * b.u)
    )
    way = np.minimum(s - before, 0.0)[:, None] * a.u
    way = way + np.maximum(s - before - radius * np.pi / 2, 0.0)[:, None] * b.u
    u = np.cos(phi)[:, None] * a.u + np.sin(phi)[:, None] * b.u
    return _state(arc + way, u, speed)


def _state(p: Array, u: Array, speed: Array) -> tuple[Array, Array]:
    return np.hstack((p, speed[:, None] * u)), np.arctan2(u[:, 1], u[:, 0])

"""Vehicles on lanes and pedestrians on crosswalks, each in one of five kinds of motion.

Whoever turns leaves its line on a quarter circle for another line at right angles. How each moves
is drawn first; then places are drawn until all stay in the area and keep clear of each other, so
that it is not the slow and the parked who are left. Motions are drawn anew only if none fit.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..models.errors import ParameterError
from ..models.records import Array

MOTIONS = ("static", "uniform", "turn", "accelerated", "decelerated")
_ROUNDS, _SCENES, _PLACES = 20, 50, 100
"""Motions that are drawn, scenes for each, places for each target."""


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
    """A moving target: its lines, speeds [m s-1], turn radii [m], half its length and width [m]."""

    lines: Mapping[str, Sequence[float]]
    speed: tuple[float, float]
    turn_radius: tuple[float, float]
    body: tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """How a walker moves along its line: way (T,) [m] and speed (T,) [m s-1].

    It turns with ``radius`` [m], or not (0).
    """

    way: Array
    speed: Array
    radius: float


def draw(
    walkers: Sequence[Walker],
    t: Array,
    area: tuple[float, ...],
    clearance: float,
    rng: np.random.Generator,
) -> tuple[Array, Array]:
    """States x y vx vy (n, T, 4) and headings (n, T) [rad] of walkers at times ``t`` (T,) [s].

    All centres stay within ``area`` (x_min, x_max, y_min, y_max); between the bodies of any two,
    rectangles along their headings, there is a gap of ``clearance`` [m].

    Raises
    ------
    ParameterError : no such scene was found
    """
    for _ in range(_ROUNDS):
        motions = [_motion(walker, t, rng) for walker in walkers]
        for _ in range(_SCENES):
            found = _placed(walkers, motions, np.asarray(area), clearance, rng)
            if found is not None:
                states, headings = (np.array(parts) for parts in zip(*found, strict=True))
                return states, headings
    raise ParameterError(f"clearance: no room for {len(walkers)} objects with {clearance:g} m")


def _placed(
    walkers: Sequence[Walker],
    motions: Sequence[Motion],
    area: Array,
    clearance: float,
    rng: np.random.Generator,
) -> list[tuple[Array, Array]] | None:
    """States and headings of walkers that keep clear of each other, or None."""
    found: list[tuple[Array, Array]] = []
    for walker, motion in zip(walkers, motions, strict=True):
        for _ in range(_PLACES):
            state, heading = _track(walker, motion, rng)
            p = state[:, :2]
            if (p >= area[::2]).all() and (p <= area[1::2]).all():
                mine = state, heading, walker.body
                if all(
                    clear(*mine, *other, walkers[j].body, clearance)
                    for j, other in enumerate(found)
                ):
                    found.append((state, heading))
                    break
        else:
            return None
    return found


def clear(
    state: Array,
    heading: Array,
    body: tuple[float, float],
    other_state: Array,
    other_heading: Array,
    other_body: tuple[float, float],
    clearance: float,
) -> bool:
    """Whether two bodies keep ``clearance`` [m] at all times."""
    d = np.hypot(*(state[:, :2] - other_state[:, :2]).T)
    near = d < np.hypot(*body) + np.hypot(*other_body) + clearance
    if not near.any():
        return True
    gaps = gap(
        state[near, :2], heading[near], body, other_state[near, :2], other_heading[near], other_body
    )
    return bool((gaps > 0).all() and (gaps >= clearance).all())


def gap(
    p: Array,
    heading: Array,
    half: tuple[float, float],
    q: Array,
    other: Array,
    also: tuple[float, float],
) -> Array:
    """Distance (T,) [m] of rectangles about p, q (T, 2) with headings (T,); 0 where they overlap.

    ``half`` and ``also`` are half their lengths and widths. Of two convex shapes that are apart a
    corner of one is nearest to the other, and an axis of one separates them.
    """
    apart = np.zeros(len(p), bool)
    nearest = np.full(len(p), np.inf)
    for a, turn, size, b, turned, sizes in (
        (p, heading, half, q, other, also),
        (q, other, also, p, heading, half),
    ):
        corner = np.array(sizes) * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]])
        c, s = np.cos(turned - turn), np.sin(turned - turn)
        x = corner[:, 0] * c[:, None] - corner[:, 1] * s[:, None]
        y = corner[:, 0] * s[:, None] + corner[:, 1] * c[:, None]
        d = b - a
        x = x + (d[:, 0] * np.cos(turn) + d[:, 1] * np.sin(turn))[:, None]
        y = y + (d[:, 1] * np.cos(turn) - d[:, 0] * np.sin(turn))[:, None]
        for along, limit in ((x, size[0]), (y, size[1])):
            apart |= (along.min(1) > limit) | (along.max(1) < -limit)
        beyond = np.hypot(
            np.maximum(np.abs(x) - size[0], 0.0), np.maximum(np.abs(y) - size[1], 0.0)
        )
        nearest = np.minimum(nearest, beyond.min(1))
    return np.where(apart, nearest, 0.0)


def _motion(walker: Walker, t: Array, rng: np.random.Generator) -> Motion:
    """How one walker moves, wherever it is."""
    kind = MOTIONS[rng.integers(len(MOTIONS))]
    low, high = walker.speed
    v = 0.0 if kind == "static" else rng.uniform(low, high)
    duration = max(float(t[-1]), 1e-9)
    change = {"accelerated": high - v, "decelerated": -v}.get(kind, 0.0) * rng.random()
    radius = rng.uniform(*walker.turn_radius) if kind == "turn" else 0.0
    return Motion(v * t + change / duration * t**2 / 2, v + change / duration * t, radius)


def _track(walker: Walker, motion: Motion, rng: np.random.Generator) -> tuple[Array, Array]:
    """State (T, 4) and heading (T,) of one walker, from a place on one of its lines."""
    lines = [Line.of(ends) for ends in walker.lines.values()]
    line = lines[rng.integers(len(lines))]
    s = motion.way + rng.uniform(0.0, line.length)
    across = [other for other in lines if abs(other.u @ line.u) < 1e-6]
    if motion.radius and across:
        return _turning(line, across[rng.integers(len(across))], motion.radius, s, motion.speed)
    u = np.tile(line.u, (len(s), 1))
    return _state(line.start + s[:, None] * line.u, u, motion.speed)


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

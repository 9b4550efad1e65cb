"""From a start to the least cost, for given parameters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ....models.records import Array
from ..state import Height
from .fixes import Fixes
from .gather import Data
from .motion import Layout, Motion
from .params import Params
from .problem import Problem

WIDEN = (8.0, 3.0)
"""Factors of the standard deviations in the first minimisations."""
EARLY = 15
"""Steps of these at most."""
FOLLOWED = 2
"""Starts that are followed to the end."""
ALONG = 60
"""Times over which the way of odometry is laid beside the fixes."""
HEADINGS = 8
"""Headings that are tried where none is told."""
LONG = 1000
"""With more times than these the way lies beside the fixes without fail."""


class Solution(NamedTuple):
    """A trajectory ``x`` (n, d) of least ``cost`` [nats] for a problem."""

    problem: Problem
    x: Array
    cost: float


def problem_of(data: Data, params: Params, height: Height, centre: Array, reach: float) -> Problem:
    """The problem for these parameters."""
    wide = height.std if np.isfinite(height.std) else (height.high - height.low) / 2
    layout = Layout.of(data, params, height.is_known)
    told = (height.mean, wide)
    motion = Motion.of(data, params, layout, centre, reach, told)
    return Problem(data, params, motion, height.mean)


def solution(problem: Problem, starts: Sequence[Array]) -> Solution:
    """The least of the minima that are reached from ``starts`` (n, d).

    With wide noise a minimum is reached from far; the best of those are followed.
    """
    first, *others = WIDEN
    wide = sorted((problem.minimise(x, first, EARLY) for x in starts), key=lambda one: one[1])
    found = []
    for x, _ in wide[:FOLLOWED]:
        for widen in others:
            x, _ = problem.minimise(x, widen, EARLY)
        found.append(Solution(problem, *problem.minimise(x)))
    return min(found, key=lambda one: one.cost)


def carried(other: Solution, problem: Problem) -> Array:
    """The trajectory (n, d) of another problem; what that lacks is as it is believed at first."""
    L, from_ = problem.layout, other.problem.layout
    x = _unknown(problem)
    x[:, :4] = other.x[:, :4]
    for name in ("heading", "height", "scale"):
        k, own = getattr(from_, name), getattr(L, name)
        if k >= 0 and own >= 0:
            x[:, own] = other.x[:, k]
    if L.bias >= 0 and from_.bias >= 0:
        x[:, L.biases] = other.x[:, from_.biases]
    return x


def _unknown(problem: Problem) -> Array:
    """The mean of the first state at all times (n, d)."""
    x = np.tile(problem.motion.mean, (len(problem.data.time_ns), 1))
    k = problem.layout.height
    if k >= 0:
        # at the height of the anchors nothing tells up from down
        x[:, k] += problem.motion.first[k, k] ** -0.5
    return x


def starts(problem: Problem, path: Fixes) -> list[Array]:
    """Trajectories (n, d) to begin from: the path, with headings that fit it."""
    D, L = problem.data, problem.layout
    time = (D.time_ns - D.time_ns[0]) * 1e-9
    x = _unknown(problem)
    for j in (0, 1):
        x[:, j] = np.interp(time, path.seconds, path.p[:, j])
    if L.heading < 0:
        return [x]
    if not D.increments:
        return [_headed(x, L.heading, heading) for heading in _tagged(D, path, time)]
    turned = np.cumsum([one.turn for one in D.increments])
    before = turned - np.array([one.turn for one in D.increments])
    way = np.cumsum(
        np.exp(1j * before) * np.array([complex(*one.displacement) for one in D.increments])
    )
    if len(problem.motion.way.when):
        k, value = problem.motion.way.when, problem.motion.way.value
        offset = np.interp(time, time[k], np.unwrap(value - turned[k]))
        return [_headed(x, L.heading, turned + offset)]
    found = [_headed(x, L.heading, turned + _beside(x[:, 0] + 1j * x[:, 1], way))]
    if len(time) > LONG:
        return found
    angles = np.arange(HEADINGS) * 2 * np.pi / HEADINGS
    return found + [_headed(x, L.heading, turned + angle) for angle in angles]


def _tagged(data: Data, path: Fixes, time: Array) -> list[Array]:
    """Headings (n,) of a body that fit the places of its tags about the path, and others."""
    p = np.stack([np.interp(time, path.seconds, path.p[:, j]) for j in (0, 1)], 1)[data.step]
    away = p - data.place[:, :2]
    u = away / np.maximum(np.linalg.norm(away, axis=1), 1e-6)[:, None]
    # z = d + u . R o: linear in cosine and sine of the heading, and in what is common to all tags
    o = data.offset - data.offset.mean(0)
    G = np.stack(((u * o).sum(1), u[:, 1] * o[:, 0] - u[:, 0] * o[:, 1]), 1)
    r = data.z - np.linalg.norm(away, axis=1)
    key = data.step * data.anchors + data.anchor
    first = np.flatnonzero(np.diff(np.sort(key), prepend=-1))
    order = np.argsort(key, kind="stable")
    count = np.diff(np.append(first, len(key)))
    for values in (r, *G.T):
        values[order] -= np.repeat(np.add.reduceat(values[order], first) / count, count)
    n = len(time)
    A, b = np.zeros((n, 2, 2)), np.zeros((n, 2))
    np.add.at(A, data.step, G[:, :, None] * G[:, None])
    np.add.at(b, data.step, G * r[:, None])
    A, b = (np.cumsum(c, 0) for c in (A, b))
    last = np.minimum(np.arange(n) + ALONG // 4, n - 1)
    before = np.maximum(np.arange(n) - ALONG // 4, 0)
    vector = np.linalg.solve(
        A[last] - A[before] + 1e-6 * np.eye(2), (b[last] - b[before])[..., None]
    )
    heading = np.unwrap(np.arctan2(vector[:, 1, 0], vector[:, 0, 0]))
    return [heading, np.zeros(n), np.full(n, np.pi)]


def _headed(x: Array, column: int, heading: Array) -> Array:
    x = x.copy()
    x[:, column] = heading
    return x


def _beside(p: Array, way: Array) -> Array:
    """Angles (n,) by which the ``way`` (n,) of odometry is turned to lie beside positions (n,)."""
    n = len(p)
    first, last = np.maximum(np.arange(n) - ALONG // 2, 0), np.minimum(np.arange(n) + ALONG // 2, n)
    sums = [np.append(0, np.cumsum(c)) for c in (p, way, p * way.conj())]
    total, other, both = (s[last] - s[first] for s in sums)
    return np.unwrap(np.angle(both - total * other.conj() / (last - first)))

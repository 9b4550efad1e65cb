"""Where the trajectory may begin: positions by a few ranges, and the best way through them.

Consecutive ranges are cut into windows. From several points each window is multilaterated by a
robust loss, all at once; a window may have several minima. The path through one minimum of each
window that costs least, in residuals and in speed, is found by dynamic programming (Viterbi).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....models.records import Array
from .gather import Data

RANGES = 12
"""Ranges of a window."""
MOST = 1500
"""Windows at most."""
ANNEAL = (16.0, 8.0, 4.0, 4.0, 2.0, 2.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
"""Factors of the standard deviations in successive Gauss-Newton steps."""


class Fixes(NamedTuple):
    """Positions ``p`` (W, 2) [m] at the times ``seconds`` (W,) after the first."""

    seconds: Array
    p: Array


def fixes(
    data: Data, height: float, excess_std: float, speed: float, centre: Array, reach: float
) -> Fixes:
    """The best path; ``excess_std`` [m] is what ranges may have too much, ``speed`` [m/s]."""
    time = (data.time_ns - data.time_ns[0]) * 1e-9
    M = len(data.z)
    size = min(RANGES, M)
    step = max(size // 2, -(-M // MOST))
    rows = np.arange(0, M - size + 1, step)[:, None] + np.arange(size)
    place, z = data.place[rows], data.z[rows]
    other, is_difference = data.other[rows], data.reference[rows] >= 0
    at = time[data.step[rows]]
    std = np.sqrt(
        data.std[rows] ** 2
        + data.shared[rows] ** 2
        + excess_std**2
        + (speed * (at - at.mean(1)[:, None])) ** 2
    )
    x = np.broadcast_to(_starts(centre, reach), (len(rows), 17, 2))
    both = place, other, is_difference, height
    for factor in ANNEAL:
        d, u = _lengths(x, *both)
        r = (z[:, None] - d) / (factor * std[:, None])
        w = 1 / (1 + r**2) / (factor * std[:, None]) ** 2
        J = np.einsum("wsm,wsmi,wsmj->wsij", w, u, u) + 1e-4 * w.sum(-1)[..., None, None] * np.eye(
            2
        )
        g = np.einsum("wsm,wsmi->wsi", w, u * (z[:, None] - d)[..., None])
        move = np.linalg.solve(J, g[..., None])[..., 0]
        far = np.linalg.norm(move, axis=-1, keepdims=True)
        x = x + move / np.maximum(1.0, far / (reach / 4))
    d, _ = _lengths(x, *both)
    cost = np.log1p(((z[:, None] - d) / std[:, None]) ** 2).sum(-1)
    return Fixes(at.mean(1), _path(x, cost, at.mean(1), speed, std.mean()))


def _starts(centre: Array, reach: float) -> Array:
    """Points (17, 2): the centre, and two rings."""
    angle = np.arange(8) * np.pi / 4
    ring = np.stack((np.cos(angle), np.sin(angle)), 1)
    return centre + np.concatenate((np.zeros((1, 2)), 0.4 * reach * ring, 0.9 * reach * ring))


def _lengths(
    x: Array, place: Array, other: Array, is_difference: Array, height: float
) -> tuple[Array, Array]:
    """Distances, or differences of two, (W, S, M), and their gradients (W, S, M, 2)."""
    d, u = _distances(x, place, height)
    if is_difference.any():
        off, v = _distances(x, other, height)
        d = d - is_difference[:, None] * off
        u = u - is_difference[:, None, :, None] * v
    return d, u


def _distances(x: Array, place: Array, height: float) -> tuple[Array, Array]:
    away = x[:, :, None] - place[:, None, :, :2]
    drop = (place[..., 2] - height) ** 2
    d = np.maximum(np.sqrt((away**2).sum(-1) + drop[:, None]), 1e-6)
    return d, away / d[..., None]


def _path(x: Array, cost: Array, time: Array, speed: float, std: float) -> Array:
    """The cheapest path (W, 2) through the candidates ``x`` (W, S, 2) with ``cost`` (W, S)."""
    total, back = cost[0], []
    for k in range(1, len(x)):
        wide = std**2 + (speed * (time[k] - time[k - 1])) ** 2
        way = ((x[k, :, None] - x[k - 1, None]) ** 2).sum(-1) / (2 * wide)
        ways = total + way
        back.append(ways.argmin(1))
        total = cost[k] + ways.min(1)
    best = [int(total.argmin())]
    for links in reversed(back):
        best.append(int(links[best[-1]]))
    return np.asarray(x[np.arange(len(x)), best[::-1]])

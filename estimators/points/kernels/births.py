"""Where targets are expected to appear: Gaussian components (w, m, P) of the state x y vx vy ..."""

from __future__ import annotations

import numpy as np

from ....models.records import Array
from .gaussians import falling

Components = tuple[Array, Array, Array]
"""Weights (B,), means (B, 4) and covariances (B, 4, 4)."""


def none(width: int = 4) -> Components:
    """No births, of a state of so many entries."""
    return np.zeros(0), np.zeros((0, width)), np.zeros((0, width, width))


def join(a: Components, b: Components) -> Components:
    """The components of both."""
    return np.concatenate((a[0], b[0])), np.concatenate((a[1], b[1])), np.concatenate((a[2], b[2]))


def static(components: Array) -> Components:
    """The components (B, 9): weight, x y vx vy and their standard deviations."""
    c = np.asarray(components, float).reshape(-1, 9)
    return c[:, 0], c[:, 1:5], c[:, 5:, None] ** 2 * np.eye(4)


def along_edge(
    rate: float, edge: Array, count: int, across: float, velocity: Array, std_velocity: Array
) -> Components:
    """``rate`` targets in ``count`` equal components along the line ``edge`` (x0, y0, x1, y1).

    Each spreads by its share of the length along the edge, so that neighbours overlap and their
    sum is flat, and by ``across`` [m] at right angles to it.
    """
    start, stop = np.asarray(edge, float).reshape(2, 2)
    length = np.hypot(*(stop - start))
    u = (stop - start) / length
    at = (np.arange(count) + 0.5) / count
    m = np.hstack((start + at[:, None] * (stop - start), np.tile(velocity, (count, 1))))
    v = np.array([-u[1], u[0]])
    along = length / count
    P = np.zeros((count, 4, 4))
    P[:, :2, :2] = along**2 * np.outer(u, u) + across**2 * np.outer(v, v)
    P[:, 2:, 2:] = np.diag(np.square(std_velocity))
    return np.full(count, rate / count), m, P


def at_most_one(w: Array, m: Array, P: Array) -> Components:
    """The components as Bernoullis: one that expects more targets becomes as many as it needs."""
    copies = np.maximum(np.ceil(w), 1).astype(int)
    return np.repeat(w / copies, copies), np.repeat(m, copies, 0), np.repeat(P, copies, 0)


def shares(rate: float, novelty: Array) -> Array:
    """Expected targets (n,) at detections that share ``rate`` by ``novelty``, and at most that."""
    total = novelty.sum()
    return np.asarray(np.minimum(novelty, rate * novelty / total) if total > 0 else 0.0 * novelty)


def at_detections(rate: float, m: Array, P: Array, novelty: Array, limit: int) -> Components:
    """``rate`` targets with moments m (n, 4), P by the detections, shared by ``novelty``.

    ``novelty`` (n,) is the probability that no known target made the detection; the ``limit``
    most novel ones are used, which share the rate of all, and none gets more than its novelty: what
    the others would have got is cut. S. Reuter et al., "The labeled
    multi-Bernoulli filter", IEEE Trans. Signal Process. 62 (2014) 3246-3260, eqs. 74-75.
    """
    best = np.arange(len(novelty))
    if len(novelty) > limit:
        best = np.sort(falling(novelty, m[:, :2])[:limit])
    best = best[novelty[best] > 0]
    return shares(rate, novelty)[best], m[best], P[best]

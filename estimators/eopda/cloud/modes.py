"""Where a device can be, by the ranges of a moment: the modes of a robust likelihood.

Any two ranges to different anchors meet in at most two points; from these and a few heights
Gauss-Newton steps lead to the local maxima of a likelihood in which every range may be false. What
is linear near a maximum has a Gaussian, from the information matrix. They serve to propose
particles, which are weighed by what is really believed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....models.records import Array

STARTS = 64
"""Points from which maxima are sought."""
MOST = 12
"""Maxima that are kept."""
GRID = 9
"""Points a side from which the meetings of hyperbolas are sought."""
DROP = 25.0
"""A maximum this much below the highest [nats] is left out."""
ANNEAL = (64.0, 16.0, 4.0, 4.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0)
"""Factors of the ranges' variance in successive Gauss-Newton steps."""


class Ranges(NamedTuple):
    """Ranges that may be direct: of anchors at ``anchor`` (M, 3) [m], taken ``age`` (M,) [s] ago.

    ``z`` (M,) [m] and ``variance`` (M,) [m^2], with all that is uncertain about them. Of a
    difference ``other`` (M, 3) is the anchor whose distance is taken off; NaN for a range, and
    empty where there are only ranges.
    """

    anchor: Array
    age: Array
    z: Array
    variance: Array
    other: Array = np.zeros((0, 3))

    @property
    def are_ranges(self) -> Array:
        """Which are no differences, (M,)."""
        return np.isnan(self.other[:, 0]) if len(self.other) else np.ones(len(self.z), bool)


class Modes(NamedTuple):
    """Gaussians of position, velocity and height: ``mean`` (K, 5), ``covariance`` (K, 5, 5)."""

    mean: Array
    covariance: Array
    share: Array


def modes(
    ranges: Ranges, floor: float, speed_std: float, height: tuple[float, float], reach: float
) -> Modes:
    """The modes of the ranges' likelihood, with shares (K,) that sum to one; none for one anchor.

    ``floor`` [1/m] is the density of false ranges, ``height`` mean and standard deviation of the
    prior, ``reach`` [m] the scale beyond which nothing is known.
    """
    prior = np.array([reach**-2.0, reach**-2.0, speed_std**-2.0, speed_std**-2.0, 0.0])
    known = height[1] == 0.0
    prior[4] = 1e12 if known else height[1] ** -2.0
    heights = (
        [height[0]] if known else [height[0], height[0] + height[1], height[0] + height[1] / 3]
    )
    starts = [np.concatenate((_meetings(ranges, h), _grid(ranges))) for h in heights]
    x = np.concatenate([_state(p, h) for p, h in zip(starts, heights, strict=True)])
    if not len(x):
        return Modes(np.zeros((0, 5)), np.zeros((0, 5, 5)), np.zeros(0))
    best = np.argsort(-_score(x, ranges, floor, 16.0), kind="stable")[:STARTS]
    x, centre = x[best], np.array([0.0, 0.0, 0.0, 0.0, height[0]])
    for factor in ANNEAL:
        d, H = _path(x, ranges)
        v = factor * ranges.variance
        g = np.exp(-((ranges.z - d) ** 2) / (2 * v)) / np.sqrt(2 * np.pi * v)
        weight = g / (floor + g) / v
        J = np.einsum("km,kmi,kmj->kij", weight, H, H) + np.diag(prior)
        J[:, :2, :2] += 1e-3 * np.einsum("km->k", weight)[:, None, None] * np.eye(2)
        pull = np.where(np.arange(5) < 2, 0.0, prior) * (centre - x)
        slope = np.einsum("km,kmi,km->ki", weight, H, ranges.z - d) + pull
        step = np.linalg.solve(J, slope[..., None])[..., 0]
        x = x + step / np.maximum(1.0, np.linalg.norm(step[:, :2], axis=1) / (reach / 4))[:, None]
    return _distinct(x, ranges, floor, prior)


def _distinct(x: Array, ranges: Ranges, floor: float, prior: Array) -> Modes:
    """The maxima among ``x``, each once."""
    d, H = _path(x, ranges)
    g = np.exp(-((ranges.z - d) ** 2) / (2 * ranges.variance))
    g /= np.sqrt(2 * np.pi * ranges.variance)
    J = np.einsum("km,kmi,kmj->kij", g / (floor + g) / ranges.variance, H, H) + np.diag(prior)
    score = _score(x, ranges, floor, 1.0)
    kept: list[int] = []
    for k in np.argsort(-score, kind="stable").tolist():
        if len(kept) == MOST or score[k] < score.max() - DROP:
            break
        apart = [(x[k] - x[i]) @ J[i] @ (x[k] - x[i]) > 1.0 for i in kept]
        if all(apart):
            kept.append(k)
    share = np.exp((score[kept] - score.max()) / 4) + 0.05
    return Modes(x[kept], np.linalg.inv(J[kept]), share / share.sum())


def _path(x: Array, ranges: Ranges) -> tuple[Array, Array]:
    """Lengths (K, M) of the direct paths, and their gradients (K, M, 5)."""
    p = x[:, None, :2] - ranges.age[:, None] * x[:, None, 2:4]
    away = np.concatenate((p, np.broadcast_to(x[:, None, 4:], (*p.shape[:2], 1))), -1)
    away = away - ranges.anchor
    d = np.maximum(np.linalg.norm(away, axis=-1), 1e-6)
    u = away / d[..., None]
    k = np.flatnonzero(~ranges.are_ranges)
    if len(k):
        away = away[:, k] + ranges.anchor[k] - ranges.other[k]
        off = np.maximum(np.linalg.norm(away, axis=-1), 1e-6)
        d[:, k] -= off
        u[:, k] -= away / off[..., None]
    return d, np.concatenate((u[..., :2], -ranges.age[:, None] * u[..., :2], u[..., 2:]), -1)


def _score(x: Array, ranges: Ranges, floor: float, factor: float) -> Array:
    """Log-likelihood (K,) with the variances times ``factor``."""
    d, _ = _path(x, ranges)
    v = factor * ranges.variance
    g = np.exp(-((ranges.z - d) ** 2) / (2 * v)) / np.sqrt(2 * np.pi * v)
    return np.asarray(np.log(1 + g / floor).sum(1))


def _state(p: Array, height: float) -> Array:
    return np.hstack((p, np.zeros((len(p), 2)), np.full((len(p), 1), height)))


def _meetings(ranges: Ranges, height: float) -> Array:
    """Points (k, 2) where two circles of ranges meet, or come next to each other."""
    circles = np.flatnonzero(ranges.are_ranges)
    i, j = np.triu_indices(len(circles), 1)
    i, j = circles[i], circles[j]
    a, b = ranges.anchor[i, :2], ranges.anchor[j, :2]
    rho = np.sqrt(np.maximum(ranges.z**2 - (ranges.anchor[:, 2] - height) ** 2, 1e-4))
    D = np.linalg.norm(b - a, axis=1)
    apart = D > 1e-3
    if not apart.any():
        return np.zeros((0, 2))
    a, b, D, r, s = a[apart], b[apart], D[apart], rho[i][apart], rho[j][apart]
    along = (r**2 - s**2 + D**2) / (2 * D)
    limit = np.maximum(r, s)
    along = np.clip(along, -limit, D + limit)
    # circles that touch or miss are given a little width, so that both sides are tried
    across = np.sqrt(np.maximum(r**2 - along**2, (0.05 * np.minimum(r, s)) ** 2))
    u = (b - a) / D[:, None]
    n = np.stack((-u[:, 1], u[:, 0]), 1)
    middle = a + along[:, None] * u
    return np.concatenate((middle + across[:, None] * n, middle - across[:, None] * n))


def _grid(ranges: Ranges) -> Array:
    """Points (k, 2) about the anchors of differences, whose hyperbolas meet anywhere."""
    k = ~ranges.are_ranges
    if not k.any():
        return np.zeros((0, 2))
    corners = np.concatenate((ranges.anchor[k, :2], ranges.other[k, :2]))
    centre, half = (corners.min(0) + corners.max(0)) / 2, np.ptp(corners, axis=0).max()
    side = np.linspace(-1.0, 1.0, GRID)
    return np.asarray(centre + half * np.stack(np.meshgrid(side, side), -1).reshape(-1, 2))

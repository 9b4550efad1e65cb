"""Matern's hard-core point process of the second kind, in a box of two or three dimensions."""

from __future__ import annotations

from math import log1p, pi

import numpy as np
from scipy.spatial import cKDTree

from .parameters import require
from .records import Array


def ball(radius: float, dimension: int) -> float:
    """Volume of a ball: area of the disc in two dimensions."""
    return pi * radius**2 if dimension == 2 else 4 / 3 * pi * radius**3


def parent_intensity(retained: float, radius: float, dimension: int = 3) -> float:
    """Intensity of the parents whose hard core leaves ``retained`` points per volume.

    Inverts (1 - exp(-lambda V)) / V with the volume V of the ball of ``radius``.

    Raises
    ------
    ParameterError : no intensity leaves as many: at most one point per ball does
    """
    V = ball(radius, dimension)
    require(retained * V < 1, "mean number of points", "below one per ball", retained * V)
    return -log1p(-retained * V) / V if V else retained


def matern_ii(
    lower: Array, upper: Array, radius: float, retained: float, rng: np.random.Generator
) -> Array:
    """Points (n, d) of the box [lower, upper] (d,) of which no two are within ``radius``.

    Parents are a Poisson process on the box and ``radius`` around it, with independent uniform
    marks; kept is a point of the box whose mark is the smallest within ``radius``, so that the mean
    number per volume is ``retained``. B. Matern, Spatial Variation, 1960.
    """
    d = len(lower)
    low, high = lower - radius, upper + radius
    mean = parent_intensity(retained, radius, d) * float(np.prod(high - low))
    points = rng.uniform(low, high, (rng.poisson(mean), d))
    mark = rng.random(len(points))
    kept = np.ones(len(points), bool)
    close = cKDTree(points).query_pairs(radius, output_type="ndarray")
    i, j = close.reshape(-1, 2).T
    kept[np.where(mark[i] > mark[j], i, j)] = False
    inside = ((points >= lower) & (points <= upper)).all(1)
    return np.asarray(points[kept & inside])

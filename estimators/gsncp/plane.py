"""The plane as space whose third axis is exact.

All is reckoned in three dimensions. What lies in the plane has a region that is flat along z and
extents of 1 there, along which nothing moves; the third variance of a detection, the sensor's and
the extent's together, is 1 / (2 pi), so that its density along z is one.
"""

from __future__ import annotations

from math import pi

import numpy as np

from ...models.geometry.grids import Grid
from ...models.records import Array

THIRD = 1 / (2 * pi) - 1
"""Variance [m2] along z that a sensor is given beside that of the extent."""


def columns(dimension: int) -> list[int]:
    """Those of the nine numbers of a target that count: all, or those in the plane."""
    return list(range(9)) if dimension == 3 else [0, 1, 3, 4, 5]


def box(region: tuple[float, ...]) -> tuple[Array, Array]:
    """Lower and upper corner (3,) of a region of two or three pairs."""
    r = np.array([*region, 0.0, 0.0][:6])
    return r[::2], r[1::2]


def extents(low: Array, high: Array) -> tuple[Array, Array]:
    """Least and largest extents (6,) with the third axis as it is in the plane."""
    third = np.array([0.0, 0.0, 1.0])
    return np.append(low[:3], third), np.append(high[:3], third)


def sensed(table: Array) -> Array:
    """Detection probability and covariance (..., 7) of a sensor, exact along z."""
    flat = table.copy()
    flat[..., [3, 5]], flat[..., 6] = 0.0, THIRD
    return flat


def grid(flat: Grid) -> Grid:
    """A grid of two axes as one of three, with one layer."""
    return Grid(np.append(flat.origin, 0.0), np.append(flat.spacing, 1.0), (*flat.shape, 1))

"""Range-angle maps resampled on the pixels of the plane, and added up.

E. Favarelli et al., "Multi-base station cooperative sensing with AI-aided tracking", section III:
the maps of all stations are rotated, translated, resampled on one grid and summed to the soft map.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from ....models.radar.detection import polar
from ....models.records import Array

EDGE = 1e-9
"""Cells that a pixel may lie outside of a map by rounding."""


@dataclass(frozen=True, slots=True)
class Pixels:
    """Pixels of the plane: ``nx`` by ``ny`` squares of side ``cell`` [m] from the corner x0, y0.

    A map of them has shape (ny, nx): rows run along y, columns along x, both upwards.
    """

    x0: float
    y0: float
    cell: float
    nx: int
    ny: int

    @staticmethod
    def of(region: tuple[float, ...], cell: float) -> Pixels:
        """Those that fill x_min, x_max, y_min, y_max, the last of each row perhaps beyond it."""
        x0, x1, y0, y1 = region
        nx, ny = (int(np.ceil((b - a) / cell - 1e-9)) for a, b in ((x0, x1), (y0, y1)))
        return Pixels(x0, y0, cell, nx, ny)

    def x(self, column: Array) -> Array:
        """x of the centres of the pixels in these columns [m]."""
        return self.x0 + (column + 0.5) * self.cell

    def y(self, row: Array) -> Array:
        """y of the centres of the pixels in these rows [m]."""
        return self.y0 + (row + 0.5) * self.cell

    def centres(self) -> Array:
        """Centres of all pixels (ny nx, 2) [m], row by row."""
        y, x = np.meshgrid(self.y(np.arange(self.ny)), self.x(np.arange(self.nx)), indexing="ij")
        return np.stack((x.ravel(), y.ravel()), 1)

    def above(self, map_: Array, threshold: float) -> tuple[Array, Array, Array]:
        """Rows (n,), columns (n,) and centres (n, 2) [m] of the pixels of a map that exceed it."""
        row, column = np.nonzero(map_ > threshold)
        return row, column, np.stack((self.x(column), self.y(row)), 1)


@dataclass(frozen=True, slots=True, eq=False)
class Table:
    """Where a map meets the pixels, for each of the n pixels inside it.

    ``pixel`` (n,) counts through the pixels, ``corner`` (n,) through the map's cells: the one of
    least range and azimuth about the pixel; ``u``, ``v`` (n,) are how far it is from there to the
    next range and azimuth.
    """

    pixel: Array
    corner: Array
    u: Array
    v: Array


def table(
    pixels: Pixels, distance: Array, azimuth: Array, position: Array, rotation: Array
) -> Table:
    """Bilinear weights of a map with the uniform axes ``distance`` [m] and ``azimuth`` [rad].

    The station is at ``position`` (3,), its axes are turned to the map's by ``rotation`` (3, 3).
    Pixels are on the ground. Ranges are slant; a line array along y sees the angle to its normal
    plane.
    """
    local = (pixels.centres() - position[:2]) @ rotation[:2, :2]
    r, a = polar(local)
    up = -position[2] * rotation[2]
    if up.any() or rotation[2, 2] != 1:
        x, y = (local + up[:2]).T
        z = (pixels.centres() - position[:2]) @ rotation[:2, 2] + up[2]
        r = np.sqrt(x * x + y * y + z * z)
        a = np.arctan2(y, np.copysign(np.hypot(x, z), x))
    steps = [(axis[-1] - axis[0]) / (len(axis) - 1) for axis in (distance, azimuth)]
    slip = EDGE * steps[1]
    t = np.stack(
        (
            (r - distance[0]) / steps[0],
            ((a - azimuth[0] + slip) % (2 * pi) - slip) / steps[1],
        )
    )
    last = np.array([[len(distance) - 1], [len(azimuth) - 1]])
    pixel = np.flatnonzero(((t >= -EDGE) & (t <= last + EDGE)).all(0))
    t = np.clip(t[:, pixel], 0, last)
    i, j = np.minimum(t.astype(np.int64), last - 1)
    u, v = (t - (i, j)).astype(np.float32)
    corner = (i * len(azimuth) + j).astype(np.int32)
    return Table(pixel.astype(np.int32), corner, u, v)


def add(soft: Array, power: Array, pixel: Array, corner: Array, u: Array, v: Array) -> None:
    """Add a map's ``power`` (n_range, n_azimuth) to the ``soft`` map (ny, nx), in place.

    Both are float32; the rest is its :class:`Table`. Bilinear in range and azimuth.
    """
    flat, n = power.reshape(-1), power.shape[1]
    near = (1 - v) * flat[corner] + v * flat[corner + 1]
    far = (1 - v) * flat[corner + n] + v * flat[corner + n + 1]
    soft.reshape(-1)[pixel] += (1 - u) * near + u * far

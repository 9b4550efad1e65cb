"""Ranges of an ultra-wideband network: path lengths, free-space amplitudes and range noise.

Positions are (..., 2), or (..., 3) where heights count, and broadcast against each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .records import Array

SPEED_OF_LIGHT = 299_792_458.0
"""Speed of light [m/s]."""
CELLS = 200
"""Cells a side in which the area of a region is counted."""


def range_std(amplitude: Any, rms_bandwidth: float) -> Any:
    """Standard deviation [m] of a range measured at an amplitude, by Fisher information.

    ``amplitude`` (...) is normalised: the square root of the signal-to-noise ratio;
    ``rms_bandwidth`` [Hz] is the root mean squared bandwidth. Zhu et al., below eq. (4).
    """
    return SPEED_OF_LIGHT / (np.sqrt(8.0) * np.pi * rms_bandwidth * amplitude)


def free_space_amplitude(path_length: Any, snr_db: float) -> Any:
    """Normalised amplitude (...) over a path (...) [m], with ``snr_db`` [dB] at one metre."""
    return 10.0 ** (snr_db / 20.0) / path_length


def distance(start: Array, end: Array) -> Array:
    """Length (...) [m] of the direct path between two positions; of the LOS path in eq. (4)."""
    length: Array = np.hypot(start[..., 0] - end[..., 0], start[..., 1] - end[..., 1])
    if start.shape[-1] == 3:
        length = np.hypot(length, start[..., 2] - end[..., 2])
    return length


def at_height(position: Array, height: Any) -> Array:
    """Positions (..., 3) of points (..., 2) of the plane that are ``height`` (...) [m] above it."""
    z = np.broadcast_to(height, position.shape[:-1])
    return np.concatenate((position, z[..., None]), axis=-1)


def scatter_distance(tx: Array, scatterer: Array, rx: Array) -> Array:
    """Length (...) [m] of the path from ``tx`` over a scatterer to ``rx``, h_P of eq. (8)."""
    return distance(tx, scatterer) + distance(scatterer, rx)


def device_position(centre: Array, bias_distance: Any, bias_angle: Any) -> Array:
    """Position (..., 2) of the device of an object at ``centre``, eq. (3).

    The bias b from centre to device has length b_rho [m] and angle b_phi [rad].
    """
    offset = np.stack((np.cos(bias_angle), np.sin(bias_angle)), axis=-1)
    position: Array = centre + np.asarray(bias_distance)[..., None] * offset
    return position


def error_bound(points: Array, anchors: Array, std: Array) -> Array:
    """Position error bound (...) [m] at ``points`` (..., 2) of one range from each anchor.

    ``anchors`` (a, 2), ``std`` (..., a) [m] of the ranges; the root of the trace of J^-1 with J the
    sum of u u^T / std^2 over the unit vectors u from the anchors; infinite where J is singular.
    """
    away = points[..., None, :] - anchors
    u = away / np.maximum(np.linalg.norm(away, axis=-1), 1e-12)[..., None]
    J = np.einsum("...ai,...aj,...a->...ij", u, u, std**-2.0)
    determinant = J[..., 0, 0] * J[..., 1, 1] - J[..., 0, 1] ** 2
    trace = J[..., 0, 0] + J[..., 1, 1]
    regular = determinant > 1e-12 * trace**2
    square = np.divide(trace, determinant, out=np.full_like(trace, np.inf), where=regular)
    return np.asarray(np.sqrt(square))


SPARSE = 1e-3
"""Share of its bounding box below which a region is not drawn from by rejection."""


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """Where a device may be: within ``reach`` [m] of an anchor (J, 2), or in a ``box``.

    The box is x min, y min, x max, y max [m].
    """

    anchors: Array
    reach: float
    box: tuple[float, float, float, float] | None = None

    def limits(self) -> tuple[Array, Array]:
        """Corners (2,), (2,) of the bounding box."""
        if self.box is not None:
            return np.array(self.box[:2]), np.array(self.box[2:])
        return self.anchors.min(0) - self.reach, self.anchors.max(0) + self.reach

    def contains(self, p: Array) -> Array:
        """Whether points (2, n) are inside."""
        low, high = self.limits()
        inside = (p >= low[:, None]).all(0) & (p <= high[:, None]).all(0)
        if self.box is None:
            away = ((p[:, None] - self.anchors.T[:, :, None]) ** 2).sum(0).min(0)
            inside &= away <= self.reach**2
        return np.asarray(inside)

    def cells(self) -> Array:
        """Centres (2, n) of the cells of a grid that are inside, or of one around each anchor."""
        low, high = self.limits()
        side = (np.arange(CELLS) + 0.5) / CELLS
        grid = np.stack(np.meshgrid(side, side)).reshape(2, -1)
        if not self._is_sparse():
            p = low[:, None] + (high - low)[:, None] * grid
            return np.asarray(p[:, self.contains(p)])
        disc, parts = self.reach * (2 * grid - 1), []
        for j, anchor in enumerate(self.anchors):
            p = anchor[:, None] + disc[:, (disc**2).sum(0) <= self.reach**2]
            away = ((p[:, None] - self.anchors[:j].T[:, :, None]) ** 2).sum(0)
            parts.append(p[:, (away > self.reach**2).all(0)])
        return np.concatenate(parts, 1)

    def area(self) -> float:
        """Area [m^2]."""
        low, high = self.limits()
        of = (2 * self.reach) ** 2 if self._is_sparse() else np.prod(high - low)
        return float(self.cells().shape[1] / CELLS**2 * of)

    def covariance(self) -> Array:
        """Covariance (2, 2) [m^2] of a uniform position."""
        return np.cov(self.cells(), bias=True)

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """``n`` uniform points (2, n)."""
        low, high = self.limits()
        found = np.zeros((2, 0))
        while found.shape[1] < n:
            if self._is_sparse():
                p = self._around(2 * n, rng)
            else:
                p = low[:, None] + (high - low)[:, None] * rng.random((2, 2 * n))
                p = p[:, self.contains(p)]
            found = np.concatenate((found, p), 1)
        return found[:, :n]

    def _is_sparse(self) -> bool:
        """Whether hardly any of the bounding box is inside."""
        low, high = self.limits()
        discs = len(self.anchors) * np.pi * self.reach**2
        return self.box is None and bool(discs < SPARSE * np.prod(high - low))

    def _around(self, n: int, rng: np.random.Generator) -> Array:
        """At most ``n`` uniform points (2, m) of discs around anchors, few of which need overlap.

        A point of k discs is drawn k times as often as others, and kept with probability 1/k.
        """
        which, angle = rng.integers(len(self.anchors), size=n), 2 * np.pi * rng.random(n)
        away = self.reach * np.sqrt(rng.random(n)) * np.stack((np.cos(angle), np.sin(angle)))
        offset = self.anchors[which].T[:, :, None] - self.anchors.T[:, None]
        times = (((offset + away[:, :, None]) ** 2).sum(0) <= self.reach**2).sum(1)
        kept = rng.random(n) * np.maximum(times, 1) < 1
        return np.asarray((self.anchors[which].T + away)[:, kept])

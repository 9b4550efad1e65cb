"""Regions of the plane: boxes and polygons, the points in them, and the targets to expect there.

E. Delande et al., "Regional variance for multi-object filtering", IEEE Trans. Signal Process. 62
(2014) 3415-3428; M. Andrecki et al., "Sensor management with regional statistics for the PHD
filter", eqs. 5-7.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.special import owens_t

from ..errors import ParameterError
from ..records import Array

CULL = 9.0
"""Standard deviations beyond which a Gaussian has no mass in double precision."""


def polygon(corners: Any, name: str = "region") -> Array:
    """Corners (v, 2), anticlockwise, of a box x_min, x_max, y_min, y_max or of a convex polygon.

    Raises
    ------
    ParameterError : neither, or of no area
    """
    try:
        a = np.asarray(corners, float)
    except (TypeError, ValueError):
        a = np.zeros(0)
    if a.shape == (4,):
        x0, x1, y0, y1 = a
        if not (x0 < x1 and y0 < y1):
            raise ParameterError(f"{name} must be x_min < x_max, y_min < y_max, got {corners!r}")
        a = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    if a.ndim != 2 or a.shape[1] != 2 or len(a) < 3 or not np.isfinite(a).all():
        raise ParameterError(f"{name} must be a box or a list of three or more corners")
    edge = np.roll(a, -1, 0) - a
    turn = _cross(edge, np.roll(edge, -1, 0))
    if (turn < 0).all():
        a, turn = a[::-1], -turn
    angle = np.arctan2(turn, (edge * np.roll(edge, -1, 0)).sum(1)).sum()
    if not (turn > 0).all() or abs(abs(angle) - 2 * np.pi) > 1e-6:
        raise ParameterError(f"{name} must be convex, without corners on a line")
    return a


@lru_cache(maxsize=64)
def box(bounds: tuple[float, ...]) -> Array:
    """Corners of a box of parameters, made once; not to be written to."""
    return polygon(bounds)


def polygons(regions: Mapping[str, Any]) -> dict[str, Array]:
    """Corners of all named regions; ParameterError for the first that is none."""
    if not isinstance(regions, Mapping):
        raise ParameterError(f"regions must map names to boxes or corners, got {regions!r}")
    return {str(name): polygon(corners, f"regions.{name}") for name, corners in regions.items()}


def contains(corners: Array, points: Array) -> Array:
    """Whether ``points`` (n, 2) lie in the convex polygon ``corners`` (v, 2), edges included."""
    edge = np.roll(corners, -1, 0) - corners
    return np.asarray((_cross(edge, points[:, None] - corners) >= 0).all(1))


def area(corners: Array) -> float:
    """Area of a simple polygon (v, 2), positive if anticlockwise."""
    return 0.5 * float(_cross(corners, np.roll(corners, -1, 0)).sum())


def mass(m: Array, P: Array, corners: Array) -> Array:
    """Mass (J,) of Gaussians with means m (J, 2), covariances P (J, 2, 2) in a simple polygon.

    ``corners`` (v, 2) run anticlockwise. With y = L^-1 (x - m) the Gaussian is round; each edge
    and the origin span a triangle, whose mass in polar coordinates is that of its angle less two
    values of Owen's T function, T(h, t) with the distance h of the edge's line and the tangents t
    of the angles to the edge's ends. The triangles add up with their signs. D. B. Owen, Ann. Math.
    Statist. 27 (1956) 1075-1090.
    """
    low, high = corners.min(0), corners.max(0)
    reach = CULL * np.sqrt(np.diagonal(P, axis1=1, axis2=2))
    near = ((m + reach >= low) & (m - reach <= high)).all(1)
    out = np.zeros(len(m))
    if near.any():
        out[near] = _mass(m[near], P[near], corners)
    return out


def statistics(
    w: Array, m: Array, P: Array, detection: Array, regions: Mapping[str, Array]
) -> dict[str, tuple[float, float]]:
    """Mean and variance of the number of targets in each region, by its name.

    Parameters
    ----------
    w, m, P : (L,), (L, >=2), (L, >=2, >=2) components of the posterior, none merged
    detection : (L,) index of the detection that updated the component, -1 where it was missed
    regions : corners (v, 2), anticlockwise, by name
    """
    return {
        name: moments(w * mass(m[:, :2], P[:, :2, :2], corners), detection)
        for name, corners in regions.items()
    }


def moments(w: Array, detection: Array) -> tuple[float, float]:
    """Mean and variance of a number: Poisson where missed, one trial per detection else."""
    part = np.bincount(detection + 1, w, 1)
    q = part[1:]
    return float(part.sum()), float(part[0] + q @ (1 - q))


def _mass(m: Array, P: Array, corners: Array) -> Array:
    l00 = np.sqrt(P[:, 0, 0])
    l10 = P[:, 0, 1] / l00
    l11 = np.sqrt(P[:, 1, 1] - l10**2)
    v = corners - m[:, None]
    a0 = v[..., 0] / l00[:, None]
    a1 = (v[..., 1] - l10[:, None] * a0) / l11[:, None]
    e0, e1 = np.roll(a0, -1, 1) - a0, np.roll(a1, -1, 1) - a1
    length = np.hypot(e0, e1)
    h = (a0 * e1 - a1 * e0) / length
    along = (a0 * e0 + a1 * e1) / length
    # The smallest number keeps the angle right where the origin lies on an edge's line.
    distance = np.maximum(np.abs(h), 1e-300)
    start, stop = along / distance, (along + length) / distance
    angle = (np.arctan(stop) - np.arctan(start)) / (2 * np.pi)
    triangle = angle - (owens_t(h, stop) - owens_t(h, start))
    return np.asarray(np.clip((np.sign(h) * triangle).sum(1), 0.0, 1.0))


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])

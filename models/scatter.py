"""Where an extended object scatters: the ideal sector and its approximation by an ellipse.

Scatterers face the *receiving* anchor: a sector of the object's rim with opening angle omega about
the direction phi of that anchor. Zhu et al., "Multi-Sensor Fusion of Active and Passive
Measurements for Extended Object Tracking", sections III-B and IV. Positions are (..., 2); all
arguments broadcast.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .records import Array
from .uwb import scatter_distance

SIGMA_SPREAD = 3.0
"""n + kappa of the unscented transform."""


def bearing(centre: Array, anchor: Array) -> Array:
    """Angle phi (...) [rad] of ``anchor`` as seen from ``centre``; below eq. (6)."""
    phi: Array = np.arctan2(anchor[..., 1] - centre[..., 1], anchor[..., 0] - centre[..., 0])
    return phi


def sector(
    u: Any, s: Any, centre: Array, anchor: Array, semi_axes: Array, width: Any, opening: float
) -> Array:
    """Scatterers (..., 2) of an ellipse that faces ``anchor``, from points of the unit square.

    ``u`` in [0, 1] runs over the opening angle [rad] of the parametric angle, ``s`` in [0, 1] over
    the depth: 0 is the rim and 1 lies the factor ``1 - width / mean semi-axis`` closer to the
    centre. ``semi_axes`` (..., 2) [m] lie along x and y; ``width`` (...) [m]. Independent uniform
    ``u`` and ``s`` give the scatterers of the ideal model, section IV.
    """
    angle, shrink = _angle_and_shrink(u, s, centre, anchor, semi_axes, width, opening)
    rim = semi_axes * np.stack((np.cos(angle), np.sin(angle)), axis=-1)
    q: Array = centre + shrink[..., None] * rim
    return q


def sector_gradient(
    u: Array, s: Array, centre: Array, anchor: Array, semi_axes: Array, width: float, opening: float
) -> Array:
    """Gradients (K, 2, 5) of the scatterers of :func:`sector` in centre, semi-axes and width.

    One object and anchor: ``u`` and ``s`` are (K,), positions and semi-axes (2,).
    """
    angle, shrink = _angle_and_shrink(u, s, centre, anchor, semi_axes, width, opening)
    cos, sin = np.cos(angle), np.sin(angle)
    rim, turn = np.stack([cos, sin], -1) * semi_axes, np.stack([-sin, cos], -1) * semi_axes
    d, total = anchor - centre, semi_axes.sum()
    phi_centre = np.array([d[1], -d[0]]) / (d @ d)
    G = np.zeros((len(u), 2, 5))
    G[:, :, :2] = np.eye(2) + (shrink[:, None] * turn)[:, :, None] * phi_centre
    G[:, :, 2:4] = ((2 * s * width / total**2)[:, None] * rim)[:, :, None]
    G[:, 0, 2] += shrink * cos
    G[:, 1, 3] += shrink * sin
    G[:, :, 4] = (-2 * s / total)[:, None] * rim
    return G


def _angle_and_shrink(
    u: Any, s: Any, centre: Array, anchor: Array, semi_axes: Array, width: Any, opening: float
) -> tuple[Array, Array]:
    """Parametric angle and share of the way from centre to rim, for points of the unit square."""
    angle = bearing(centre, anchor) + opening * (np.asarray(u) - 0.5)
    return angle, 1.0 - np.asarray(s) * width / semi_axes.mean(axis=-1)


def unit_square_nodes(n: int) -> tuple[Array, Array]:
    """Quadrature nodes u (n,), s (n,) of equal weight on the unit square.

    A Fibonacci-like lattice: u at the midpoints of n equal cells, s by the golden ratio. Its error
    falls as 1/n against 1/sqrt(n) of random draws, and the nodes are sorted by angle.
    """
    k = np.arange(n) + 0.5
    return k / n, np.modf(k * (np.sqrt(5.0) - 1.0) / 2.0)[0]


def scatter_ellipse(
    centre: Array, anchor: Array, radius: Any, width: Any, opening: float
) -> tuple[Array, Array]:
    """Centre (..., 2) and root covariance (..., 2, 2) of the scatter ellipse, eqs. (6) and (7).

    The ellipse touches the circle of ``radius`` (...) [m] about ``centre`` where it faces
    ``anchor``: tangential semi-axis ``l = radius sin(opening / 2)``, radial semi-axis ``width``.
    The columns of the root are its principal axes, scaled to one standard deviation: l/2 and w/2.
    """
    phi = bearing(centre, anchor)
    radial = np.stack((np.cos(phi), np.sin(phi)), axis=-1)
    tangential = np.stack((-radial[..., 1], radial[..., 0]), axis=-1)
    r, w = np.asarray(radius)[..., None], np.asarray(width)[..., None]
    root = np.stack((r * np.sin(opening / 2) / 2 * tangential, w / 2 * radial), axis=-1)
    return centre + r * radial, root


def path_moments(tx: Array, rx: Array, centre: Array, root: Array) -> tuple[Array, Array, Array]:
    """Length of the path at the ellipse's centre, and its mean and variance over the ellipse.

    All (...) [m], [m], [m^2]; the moments by the unscented transform with n + kappa = 3. Eq. (8)
    takes the first as the mean and the last as sigma_lambda^2.
    """
    spread = np.sqrt(SIGMA_SPREAD) * np.moveaxis(root, -1, 0)
    points = np.stack((centre + 0.0 * spread[0], *(centre + spread), *(centre - spread)))
    h = scatter_distance(tx, points, rx)
    weight = np.full(5, 0.5 / SIGMA_SPREAD)
    weight[0] = 1.0 - 2.0 / SIGMA_SPREAD
    mean = np.tensordot(weight, h, 1)
    return h[0], mean, np.tensordot(weight, (h - mean) ** 2, 1)

"""Paths of one UWB link and their gradients in the state of the ideal scattering model.

The state is y = (p_x, p_y, v_x, v_y, b_rho, b_phi, a, b, w): centre and velocity of an ellipse that
does not rotate, offset of the device in polar coordinates, semi-axes along x and y, and depth of
the sector of scatterers. Quadrature points take the place of the scatterers, which are uniform in
parametric angle and depth. Equations as in Zhu et al., Multi-sensor fusion of active and passive
measurements for extended object tracking, 2025.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from ...models.records import Array
from ...models.scatter import sector, sector_gradient
from ...models.uwb import device_position

STATE = ("x", "y", "vx", "vy", "b_rho", "b_phi", "a", "b", "w")
_ANGLES, _DEPTHS = 64, 16


@cache
def nodes() -> tuple[Array, Array, Array]:
    """Gauss-Legendre nodes in angle and depth, both in [0, 1], with their weights (K,).

    So many that the bound of ``uwb-olos`` does not change in the fourth digit: near an anchor the
    paths of neighbours must differ by less than the noise.
    """
    (u, wu), (t, wt) = (np.polynomial.legendre.leggauss(n) for n in (_ANGLES, _DEPTHS))
    angle, depth = np.meshgrid((u + 1) / 2, (t + 1) / 2, indexing="ij")
    return angle.ravel(), depth.ravel(), np.outer(wu, wt).ravel() / 4


def scatterers(y: Array, anchor: Array, opening: float) -> tuple[Array, Array]:
    """Quadrature points (K, 2) of the sector that faces ``anchor`` (2,), and gradients (K, 2, 9).

    The points are those of :func:`echoset.models.scatter.sector`.
    """
    u, s, _ = nodes()
    shape = y[:2], anchor, y[6:8], y[8], opening
    G = np.zeros((len(u), 2, len(STATE)))
    G[:, :, [0, 1, 6, 7, 8]] = sector_gradient(u, s, *shape)
    return sector(u, s, *shape), G


def device(y: Array) -> tuple[Array, Array]:
    """Position (2,) of the device (eq. 3) and its gradient (2, 9)."""
    rho, phi = y[4:6]
    along, across = np.array([np.cos(phi), np.sin(phi)]), np.array([-np.sin(phi), np.cos(phi)])
    G = np.zeros((2, len(STATE)))
    G[:, :2], G[:, 4], G[:, 5] = np.eye(2), along, rho * across
    return device_position(y[:2], rho, phi), G


def distance(q: Array, q_y: Array, r: Array, r_y: Array, rise: float = 0.0) -> tuple[Array, Array]:
    """Distances (...) between points q and r (..., 2), ``rise`` [m] apart in height.

    The second value is their gradient (..., 9).
    """
    delta = q - r
    d = np.sqrt((delta**2).sum(-1) + rise**2)
    return d, np.einsum("...i,...ij->...j", delta / d[..., None], q_y - r_y)


def scattered(
    y: Array, tx: Array | None, rx: Array, opening: float, height: float = 0.0
) -> tuple[Array, Array]:
    """Lengths (K,) of the paths tx -> scatterer -> rx and gradients (K, 9); tx None: the device.

    Anchors are (2,), in the plane of device and scatterers, or (3,) with these at ``height`` [m].
    """
    q, q_y = scatterers(y, rx[:2], opening)
    still = np.zeros((2, len(STATE)))
    sender, sender_y = device(y) if tx is None else (tx[:2], still)
    rise = 0.0 if tx is None else _rise(tx, height)
    there, there_y = distance(q, q_y, sender, sender_y, rise)
    back, back_y = distance(q, q_y, rx[:2], still, _rise(rx, height))
    return there + back, there_y + back_y


def direct(y: Array, rx: Array, height: float = 0.0) -> tuple[Array, Array]:
    """Length (1,) of the path device -> rx, which is as in :func:`scattered`; gradient (1, 9)."""
    m, m_y = device(y)
    return distance(m[None], m_y[None], rx[:2], np.zeros((2, len(STATE))), _rise(rx, height))


def _rise(anchor: Array, height: float) -> float:
    return float(anchor[2] - height) if len(anchor) == 3 else 0.0

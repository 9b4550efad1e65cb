"""A Gaussian as a mixture of narrower ones along one direction of the plane.

Where something is known of a part of a Gaussian only, such as that a sensor has looked there, its
pieces can be told apart.
"""

from __future__ import annotations

import numpy as np

from ....models.records import Array
from .gaussians import moments

OFFSET = 0.7 * np.arange(-3, 4)
"""Means of the pieces of a standard Gaussian, close enough for their sum to be smooth."""
WEIGHT = np.exp(-0.5 * (OFFSET / 0.88) ** 2)
WEIGHT /= WEIGHT.sum()
SHRUNK = float(1 - WEIGHT @ OFFSET**2)
"""Variance of a piece, so that the sum has variance 1."""


def split(m: Array, P: Array, across: Array) -> tuple[Array, Array]:
    """Means (J, k, dx) and covariances (J, dx, dx) of pieces, whose weights are ``WEIGHT`` (k,).

    They tell apart where a Gaussian is in the direction ``across`` (J, 2), of any length, and where
    that is zero along its longest axis.
    """
    longest = np.linalg.eigh(P[:, :2, :2])[1][:, :, 1]
    u = np.where((across == 0).all(1, keepdims=True), longest, across)
    variance = np.einsum("ja,jab,jb->j", u, P[:, :2, :2], u)
    # Along the regression of the state on that coordinate, which takes the velocity along.
    d = (P[:, :, :2] @ u[..., None])[..., 0] / np.sqrt(variance)[:, None]
    pieces = m[:, None] + OFFSET[:, None] * d[:, None]
    return pieces, P - (1 - SHRUNK) * d[:, :, None] * d[:, None, :]


def united(w: Array, m: Array, P: Array) -> tuple[Array, Array]:
    """Means (J, dx) and covariances (J, dx, dx) of pieces (J, k, dx) with weights w (J, k)."""
    k = w.shape[1]
    whole = [moments(a, b, np.repeat(c[None], k, 0)) for a, b, c in zip(w, m, P, strict=True)]
    dx = m.shape[-1]
    return (
        np.array([b for _, b, _ in whole]).reshape(-1, dx),
        np.array([c for _, _, c in whole]).reshape(-1, dx, dx),
    )

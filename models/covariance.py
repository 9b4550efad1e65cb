"""Whether symmetric matrices are covariances, whatever the units of what they are of."""

from __future__ import annotations

import numpy as np

from .records import Array

ROUNDING = 1e-9
"""How far below zero, of correlations, an eigenvalue of a covariance may be."""


def indefinite(P: Array) -> Array:
    """Which (...,) of the symmetric matrices P (..., dx, dx) are not positive semidefinite.

    Where a variance is zero, its correlations count as if it were the least positive number.
    """
    std = np.sqrt(np.diagonal(P, axis1=-2, axis2=-1).clip(np.finfo(float).tiny))
    with np.errstate(over="ignore"):
        correlation = (P / std[..., :, None] / std[..., None, :]).clip(-1e9, 1e9)
    return np.asarray(np.linalg.eigvalsh(correlation)[..., 0] < -ROUNDING)

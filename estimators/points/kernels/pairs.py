"""Algebra of pairs of a Gaussian and a detection, each pair by itself.

Where most Gaussians are far from most detections, what is near is a list of pairs, not an array of
all with all.
"""

from __future__ import annotations

import numpy as np

from ....models.records import Array
from .gaussians import innovation


def log_likelihood(z: Array, z_hat: Array, S: Array, period: Array, gate: float) -> Array:
    """Log densities (k,) of detections z (k, dz) under N(z_hat, S), one Gaussian each.

    Those whose squared Mahalanobis distance exceeds ``gate`` get -inf.
    """
    if not len(z):
        return np.zeros(0)
    L = np.linalg.cholesky(S)
    e = np.linalg.solve(L, innovation(z, z_hat, period)[..., None])[..., 0]
    d2 = (e**2).sum(-1)
    log_det = 2 * np.log(np.diagonal(L, axis1=-2, axis2=-1)).sum(-1)
    log_l = -0.5 * (d2 + log_det + z.shape[1] * np.log(2 * np.pi))
    return np.asarray(np.where(d2 > gate, -np.inf, log_l))


def matched(group: Array, w: Array, m: Array, P: Array, G: int) -> tuple[Array, Array, Array]:
    """Weights (G,), means (G, dx) and covariances (G, dx, dx) that match those of G mixtures.

    Components with weights w (k,), means m (k, dx) and covariances P belong to the mixtures
    ``group`` (k,). One without weight has mean 0 and covariance 0.
    """
    total = np.bincount(group, w, G)
    share = w / np.where(total > 0, total, 1.0)[group]
    mean, spread = np.zeros((G, m.shape[1])), np.zeros((G, m.shape[1], m.shape[1]))
    np.add.at(mean, group, share[:, None] * m)
    v = m - mean[group]
    np.add.at(spread, group, share[:, None, None] * (P + v[:, :, None] * v[:, None, :]))
    return total, mean, spread

"""Algebra of pairs of a Gaussian and a detection, each pair by itself.

Where most Gaussians are far from most detections, what is near is a list of pairs, not an array of
all with all.
"""

from __future__ import annotations

import numpy as np

from ....models.records import Array
from .gaussians import innovation


def log_likelihood(
    z: Array, z_hat: Array, S: Array, R: Array, period: Array, target: Array, detection: Array,
    gate: float,
) -> Array:  # fmt: skip
    """Log densities (k,) of the pairs ``target`` (k,), ``detection`` (k,).

    Detections z (n, dz) have the noise R, (1, dz, dz) or (n, dz, dz), and are expected at z_hat
    (T, dz) with covariances S without it. Those whose squared Mahalanobis distance exceeds ``gate``
    get -inf.
    """
    if not len(target):
        return np.zeros(0)
    L = np.linalg.cholesky(S[target] + (R if len(R) == 1 else R[detection]))
    v = innovation(z[detection], z_hat[target], period)
    e = np.linalg.solve(L, v[..., None])[..., 0]
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

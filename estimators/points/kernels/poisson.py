"""The Poisson part of a multi-Bernoulli mixture: targets that no detection has told of yet.

J. L. Williams, "Marginal multi-Bernoulli filters: RFS derivation of MHT, JIPDA and
association-based MeMBer", IEEE Trans. Aerosp. Electron. Syst. 51 (2015) 1664-1687, theorem 2.
"""

from __future__ import annotations

import numpy as np

from ....models.records import Array


def first_detections(w: Array, m: Array, P: Array) -> tuple[Array, Array, Array]:
    """What the detections say, each if it is the first of its target.

    Undetected targets are J components, of density ``w`` (J, n) at the detections (weight,
    probability of detection and likelihood), updated by each to means m (J, n, dx) and covariances
    P (J, n, dx, dx). Returned are the density (n,) of all, their mean and covariance.
    """
    total = w.sum(axis=0)
    share = w / np.where(total > 0, total, 1.0)
    mean = np.einsum("jn,jna->na", share, m)
    v = m - mean
    spread = P + v[..., :, None] * v[..., None, :]
    return total, mean, np.einsum("jn,jnab->nab", share, spread)

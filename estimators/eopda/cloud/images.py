"""Clouds apart: the images of a position that ranges have not told from each other yet.

Along its longest axis a cloud is cut in two where that takes most of the variance (Otsu, "A
threshold selection method from gray-level histograms", IEEE Trans. SMC 9 (1979) 62-66, by the
iterations of 2-means); both parts are images of their own where little is left, and may be cut
again. A Gaussian keeps 0.36 of its variance, an even spread 0.25.
"""

from __future__ import annotations

import numpy as np

from ....models.records import Array

APART = 0.15
"""Share of the variance along the axis that is left at most, where a cloud is cut."""
LEAST, MEMBERS = 1e-3, 50
"""Weight of an image, and its effective number of particles that differ."""
CUTS = 2
"""Times that an image may be cut again."""
_ROUNDS = 8


def images(p: Array, w: Array, cuts: int = CUTS) -> list[Array]:
    """Indices of the particles of each image, from positions (2, n) and weights (n,)."""
    whole = np.arange(len(w))
    total = w.sum()
    d = p - (p @ w / total)[:, None]
    variance, axes = np.linalg.eigh((w * d) @ d.T / total)
    if variance[1] <= 0:
        return [whole]
    t, cut = axes[:, 1] @ d, 0.0
    for _ in range(_ROUNDS):
        right = t > cut
        share = w[right].sum() / total
        if not LEAST < share < 1 - LEAST:
            return [whole]
        high = t[right] @ w[right] / total / share
        low = -high * share / (1 - share)
        cut = (high + low) / 2
    if share * (1 - share) * (high - low) ** 2 < (1 - APART) * variance[1]:
        return [whole]
    parts = np.flatnonzero(~right), np.flatnonzero(right)
    if min(_members(t[part], w[part]) for part in parts) < MEMBERS:
        return [whole]
    if cuts == 1:
        return list(parts)
    return [part[own] for part in parts for own in images(p[:, part], w[part], cuts - 1)]


def _members(t: Array, w: Array) -> float:
    """The effective number of particles at different places ``t``, copies counted as one."""
    _, which = np.unique(t, return_inverse=True)
    return float(w.sum() ** 2 / (np.bincount(which, w) ** 2).sum())

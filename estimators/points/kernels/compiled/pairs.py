"""Compiled twins of :mod:`echoset.estimators.points.kernels.pairs`."""

from __future__ import annotations

import numpy as np
from numba import njit

from .....models.records import Array
from .gaussians import _cholesky, _wrapped


@njit(cache=True)
def log_likelihood(
    z: Array, z_hat: Array, S: Array, R: Array, period: Array, target: Array, detection: Array,
    gate: float,
) -> Array:  # fmt: skip
    """Log densities (k,) of pairs, -inf outside the gate; see the definition."""
    k, d = len(target), z.shape[1]
    out = np.empty(k)
    L, e = np.empty((d, d)), np.empty(d)
    half = 0.0
    for p in range(k):
        t, i = target[p], detection[p]
        if p == 0 or len(R) > 1 or target[p - 1] != t:
            _cholesky(S[t] + (R[i] if len(R) > 1 else R[0]), L)
            half = 0.5 * d * np.log(2 * np.pi)
            for r in range(d):
                half += np.log(L[r, r])
        d2 = 0.0
        for r in range(d):
            s = _wrapped(z[i, r] - z_hat[t, r], period[r])
            for c in range(r):
                s -= L[r, c] * e[c]
            e[r] = s / L[r, r]
            d2 += e[r] * e[r]
        out[p] = -np.inf if d2 > gate else -0.5 * d2 - half
    return out


@njit(cache=True)
def matched(group: Array, w: Array, m: Array, P: Array, G: int) -> tuple[Array, Array, Array]:
    """Weights, means and covariances that match those of G mixtures; see the definition."""
    k, d = m.shape
    total, mean, spread = np.empty(G), np.empty((G, d)), np.empty((G, d, d))
    for g in range(G):
        total[g] = 0.0
        for r in range(d):
            mean[g, r] = 0.0
            for c in range(d):
                spread[g, r, c] = 0.0
    for i in range(k):
        total[group[i]] += w[i]
    for i in range(k):
        g = group[i]
        share = w[i] / total[g] if total[g] > 0 else w[i]
        for r in range(d):
            mean[g, r] += share * m[i, r]
    for i in range(k):
        g = group[i]
        share = w[i] / total[g] if total[g] > 0 else w[i]
        for r in range(d):
            v = m[i, r] - mean[g, r]
            for c in range(r + 1):
                spread[g, r, c] += share * (P[i, r, c] + v * (m[i, c] - mean[g, c]))
    for g in range(G):
        for r in range(d):
            for c in range(r):
                spread[g, c, r] = spread[g, r, c]
    return total, mean, spread

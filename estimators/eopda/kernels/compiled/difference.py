"""Compiled twin of :mod:`echoset.estimators.eopda.kernels.difference`."""

from __future__ import annotations

from math import log, pi, sqrt

import numpy as np
from numba import njit

from .....models.records import Array
from ....kernels.compiled.gauss import FAST, exp_negative


@njit(cache=True, fastmath=FAST, error_model="numpy")
def difference(
    device: Array,
    height: Array,
    anchors: Array,
    reference: Array,
    rx: Array,
    offset: Array,
    z: Array,
    variance: Array,
    correlation: float,
    mean: Array,
    covariance: Array,
    floor: float,
    los: float,
) -> tuple[Array, Array, Array]:
    """Log-likelihood (N,) of differences, and mean and covariance of theta after them."""
    N, D = mean.shape
    log_l = np.zeros(N)
    out, spread = mean.copy(), covariance.copy()
    m, P = np.zeros(D + 1), np.zeros((D + 1, D + 1))
    H, K, d = np.zeros(D + 1), np.zeros(D + 1), np.empty(len(anchors))
    for n in range(N):
        m[:D], P[:D, :D] = out[n], spread[n]
        m[D], P[D, :], P[:, D] = 0.0, 0.0, 0.0
        for j in range(len(anchors)):
            dx, dy = device[0, n] - anchors[j, 0], device[1, n] - anchors[j, 1]
            dz = height[n] - anchors[j, 2]
            d[j] = sqrt(dx * dx + dy * dy + dz * dz)
        last = -1
        for e in range(len(rx)):
            i, j = reference[e], rx[e]
            if i != last and offset[e + 1] > offset[e]:
                last = i
                m[D], P[D, :], P[:, D] = 0.0, 0.0, 0.0
                P[D, D] = correlation * variance[offset[e]]
            away = d[j] - d[i]
            H[:] = 0.0
            H[D] = -1.0
            if D > 0:
                H[0], H[1 + j], H[1 + i] = away, 1.0, -1.0
            for l in range(offset[e], offset[e + 1]):
                S, nu = (1 - correlation) * variance[l], z[l] - away
                for k in range(D + 1):
                    K[k] = 0.0
                    for h in range(D + 1):
                        K[k] += P[k, h] * H[h]
                for k in range(D + 1):
                    S += K[k] * H[k]
                    nu -= H[k] * m[k]
                g = los * exp_negative(nu * nu / (2 * S)) / sqrt(2 * pi * S)
                r = g / (floor + g)
                log_l[n] += log(floor + g)
                shrink = r / S - r * (1 - r) * (nu / S) ** 2
                for k in range(D + 1):
                    m[k] += r * nu / S * K[k]
                    for h in range(D + 1):
                        P[k, h] -= shrink * K[k] * K[h]
        out[n], spread[n] = m[:D], P[:D, :D]
    return log_l, out, spread

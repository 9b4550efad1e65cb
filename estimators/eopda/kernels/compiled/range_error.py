"""Compiled twin of :mod:`echoset.estimators.eopda.kernels.range_error`."""

from __future__ import annotations

from math import erfc, exp, log, pi, sqrt

import numpy as np
from numba import njit

from .....models.records import Array
from ....kernels.compiled.gauss import FAST, exp_negative
from ..range_error import LARGE


@njit(cache=True, fastmath=FAST, error_model="numpy")
def excess(length: Array, mean: Array, covariance: Array, rx: Array) -> tuple[Array, Array]:
    """Mean [m] and variance [m^2], both (L, N), of what ranges over paths (L, N) have too much."""
    shift, doubt = np.empty(length.shape), np.empty(length.shape)
    for e in range(len(rx)):
        j = 1 + rx[e]
        for i in range(length.shape[1]):
            h = length[e, i]
            shift[e, i] = mean[i, 0] * h + mean[i, j]
            doubt[e, i] = covariance[i, j, j] + h * (
                2 * covariance[i, 0, j] + h * covariance[i, 0, 0]
            )
    return shift, doubt


@njit(cache=True, fastmath=FAST, error_model="numpy")
def direct(
    device: Array,
    height: Array,
    anchors: Array,
    rx: Array,
    offset: Array,
    z: Array,
    variance: Array,
    mean: Array,
    covariance: Array,
    floor: float,
    los: float,
    late: float,
    detour: float,
) -> tuple[Array, Array, Array]:
    """Log-likelihood (N,) of active links, and mean and covariance of theta after them."""
    N, D = mean.shape
    log_l = np.zeros(N)
    mean, covariance = mean.copy(), covariance.copy()
    K = np.empty(D)
    for i in range(N):
        for e in range(len(rx)):
            j = rx[e]
            dx, dy = device[0, i] - anchors[j, 0], device[1, i] - anchors[j, 1]
            dz = height[i] - anchors[j, 2]
            d = sqrt(dx * dx + dy * dy + dz * dz)
            for l in range(offset[e], offset[e + 1]):
                S, nu = variance[l], z[l] - d
                if D > 0:
                    for k in range(D):
                        K[k] = covariance[i, k, 0] * d + covariance[i, k, 1 + j]
                    S += d * K[0] + K[1 + j]
                    nu -= d * mean[i, 0] + mean[i, 1 + j]
                g = exp_negative(nu * nu / (2 * S)) / sqrt(2 * pi * S)
                f = exponential(nu, S, detour) if late > 0 else 0.0
                Z = floor + los * g + late * f
                log_l[i] += log(Z)
                if D > 0:
                    slope = (late * (g - f) / detour - los * nu / S * g) / Z
                    bend = los * ((nu / S) ** 2 - 1 / S) * g
                    bend -= late * (nu / S * g + (g - f) / detour) / detour
                    shrink = slope * slope - bend / Z
                    for k in range(D):
                        mean[i, k] -= slope * K[k]
                        for m in range(D):
                            covariance[i, k, m] -= shrink * K[k] * K[m]
    return log_l, mean, covariance


@njit(cache=True, error_model="numpy")
def exponential(nu: float, S: float, detour: float) -> float:
    """Density [1/m] of the sum of a Gaussian of variance ``S`` and an exponential length."""
    x = (S / detour - nu) / sqrt(2 * S)
    if x < LARGE:
        return exp(S / (2 * detour**2) - nu / detour) * erfc(x) / (2 * detour)
    y = 1 / (2 * x * x)
    tail = (1 - y * (1 - 3 * y * (1 - 5 * y))) / (x * sqrt(pi))
    return exp(-nu * nu / (2 * S)) * tail / (2 * detour)

"""Compiled twin of :mod:`echoset.estimators.eopda.kernels.bias_proposal`."""

from __future__ import annotations

from math import cos, log, pi, sin, sqrt

import numpy as np
from numba import njit

from .....models.records import Array
from ....kernels.compiled.gauss import FAST, exp_negative


@njit(cache=True, fastmath=FAST, error_model="numpy")
def propose_bias(
    centre: Array,
    height: Array,
    length: Array,
    angle: Array,
    pick: Array,
    anchors: Array,
    rx: Array,
    offset: Array,
    z: Array,
    variance: Array,
    shift: Array,
    doubt: Array,
    floor: float,
    los: float,
) -> tuple[Array, Array, Array]:
    """Length (N,), angle (N,) and log weight correction (N,) of the biases that are kept."""
    K, N = length.shape
    kept_length, kept_angle, correction = np.empty(N), np.empty(N), np.empty(N)
    g, x, y = np.empty((K, N)), np.empty(N), np.empty(N)
    h, loose = np.empty(N), np.zeros(N)
    for k in range(K):
        for i in range(N):
            x[i] = centre[0, i] + length[k, i] * cos(angle[k, i])
            y[i] = centre[1, i] + length[k, i] * sin(angle[k, i])
            g[k, i] = 1.0
        for e in range(len(rx)):
            ax, ay, az = anchors[rx[e], 0], anchors[rx[e], 1], anchors[rx[e], 2]
            for i in range(N):
                h[i] = sqrt((x[i] - ax) ** 2 + (y[i] - ay) ** 2 + (height[i] - az) ** 2)
            if len(shift) > 0:
                for i in range(N):
                    h[i] += shift[e, i]
                    loose[i] = doubt[e, i]
            for l in range(offset[e], offset[e + 1]):
                for i in range(N):
                    half = 0.5 / (variance[l] + loose[i])
                    peak = los / floor * sqrt(half / pi)
                    g[k, i] *= 1 + peak * exp_negative((z[l] - h[i]) ** 2 * half)
    for i in range(N):
        total = g[:, i].sum()
        k, below = 0, g[0, i]
        while k < K - 1 and below < pick[i] * total:
            k += 1
            below += g[k, i]
        kept_length[i], kept_angle[i] = length[k, i], angle[k, i]
        correction[i] = log(total / K / g[k, i])
    return kept_length, kept_angle, correction

"""Compiled twin of :mod:`echoset.estimators.eopda.kernels.link_likelihood`.

``geo`` runs over blocks of particles, ``ideal`` over the scatterers of one particle: the inner
loops have no branches and vectorise. Scatterers and their distances to a receiver are shared by
the successive links of that receiver. Factors are multiplied before the logarithm is taken, at
most ``FACTORS`` of them, so that a product neither under- nor overflows.
"""

from __future__ import annotations

from math import log, pi, sqrt

import numpy as np
from numba import njit

from .....models.records import Array
from ....kernels.compiled.gauss import FAST, exp_negative

BLOCK = 128
FACTORS = 16


@njit(cache=True, fastmath=FAST, error_model="numpy")
def geo(
    centre: Array,
    device: Array,
    height: Array,
    anchors: Array,
    tx: Array,
    rx: Array,
    offset: Array,
    z: Array,
    variance: Array,
    shift: Array,
    doubt: Array,
    clutter: float,
    los: float,
    scatter: float,
    radius: Array,
    width: Array,
    opening: float,
    transform: bool,
) -> Array:
    """One Gaussian of the scatter ellipse."""
    N = centre.shape[1]
    log_l = np.zeros(N)
    q, d_rx = np.empty((2, 5, BLOCK)), np.empty((5, BLOCK))
    mean, spread = np.empty(BLOCK), np.empty(BLOCK)
    direct, f = np.empty(BLOCK), np.empty(BLOCK)
    rise_rx, rise_tx, loose = np.zeros(BLOCK), np.zeros(BLOCK), np.zeros(BLOCK)
    half, root3 = np.sin(opening / 2) / 2, sqrt(3.0)
    biased = len(shift) > 0
    for start in range(0, N, BLOCK):
        n = min(BLOCK, N - start)
        p, m = centre[:, start : start + n], device[:, start : start + n]
        up, out = height[start : start + n], log_l[start : start + n]
        for e in range(len(tx)):
            ax, ay = anchors[rx[e], 0], anchors[rx[e], 1]
            if e == 0 or rx[e] != rx[e - 1]:
                for i in range(n):
                    rise_rx[i] = (up[i] - anchors[rx[e], 2]) ** 2
                    dx, dy = ax - p[0, i], ay - p[1, i]
                    d = sqrt(dx * dx + dy * dy)
                    c, s = (dx / d, dy / d) if d > 0 else (1.0, 0.0)
                    r, w = radius[start + i], root3 / 2 * width[start + i]
                    t = root3 * half * r
                    x, y = p[0, i] + r * c, p[1, i] + r * s
                    q[0, 0, i], q[1, 0, i] = x, y
                    q[0, 1, i], q[1, 1, i] = x - t * s, y + t * c
                    q[0, 2, i], q[1, 2, i] = x + t * s, y - t * c
                    q[0, 3, i], q[1, 3, i] = x + w * c, y + w * s
                    q[0, 4, i], q[1, 4, i] = x - w * c, y - w * s
                for k in range(5):
                    for i in range(n):
                        dx, dy = q[0, k, i] - ax, q[1, k, i] - ay
                        d_rx[k, i] = sqrt(dx * dx + dy * dy + rise_rx[i])
            active = tx[e] == len(anchors)
            for i in range(n):
                rise_tx[i] = 0.0 if active else (up[i] - anchors[tx[e], 2]) ** 2
            for k in range(5):
                for i in range(n):
                    if active:
                        bx, by = m[0, i], m[1, i]
                    else:
                        bx, by = anchors[tx[e], 0], anchors[tx[e], 1]
                    dx, dy = q[0, k, i] - bx, q[1, k, i] - by
                    h = d_rx[k, i] + sqrt(dx * dx + dy * dy + rise_tx[i])
                    if k == 0:
                        direct[i], mean[i], spread[i] = h, 0.0, 0.0
                    else:
                        h -= direct[i]
                        mean[i] += h / 6
                        spread[i] += h * h / 6
            for i in range(n):
                spread[i] -= mean[i] ** 2
                mean[i] = direct[i] + (mean[i] if transform else 0.0)
            if active:
                for i in range(n):
                    dx, dy = m[0, i] - ax, m[1, i] - ay
                    direct[i] = sqrt(dx * dx + dy * dy + rise_rx[i])
            if biased:
                for i in range(n):
                    mean[i] += shift[e, start + i]
                    direct[i] += shift[e, start + i]
                    loose[i] = doubt[e, start + i]
                    spread[i] += loose[i]
            for first in range(offset[e], offset[e + 1], FACTORS):
                f[:] = 1.0
                for l in range(first, min(first + FACTORS, offset[e + 1])):
                    v_own, v_los = variance[l], variance[l]
                    peak = los / sqrt(2 * pi * v_los)
                    for i in range(n):
                        v = 2 * (v_own + spread[i])
                        g = exp_negative((z[l] - mean[i]) ** 2 / v) / sqrt(pi * v)
                        factor = clutter + scatter * g
                        if active:
                            if biased:
                                v_los = v_own + loose[i]
                                peak = los / sqrt(2 * pi * v_los)
                            factor += peak * exp_negative((z[l] - direct[i]) ** 2 / (2 * v_los))
                        f[i] *= factor
                for i in range(n):
                    out[i] += log(f[i])
    return log_l


@njit(cache=True, fastmath=FAST, error_model="numpy")
def ideal(
    centre: Array,
    device: Array,
    height: Array,
    anchors: Array,
    tx: Array,
    rx: Array,
    offset: Array,
    z: Array,
    variance: Array,
    shift: Array,
    doubt: Array,
    clutter: float,
    los: float,
    scatter: float,
    semi_axes: Array,
    width: Array,
    opening: float,
    u: Array,
    s: Array,
) -> Array:
    """Average of Gaussians over scatterers of the sector."""
    N, K = centre.shape[1], len(u)
    log_l = np.zeros(N)
    cos_u, sin_u = np.cos(opening * (u - 0.5)), np.sin(opening * (u - 0.5))
    qx, qy, d_rx, h = np.empty(K), np.empty(K), np.empty(K), np.empty(K)
    biased, too_long, loose = len(shift) > 0, 0.0, 0.0
    for i in range(N):
        px, py = centre[0, i], centre[1, i]
        a, b = semi_axes[0, i], semi_axes[1, i]
        depth = width[i] / (0.5 * (a + b))
        total, f, factors = 0.0, 1.0, 0
        for e in range(len(tx)):
            ax, ay = anchors[rx[e], 0], anchors[rx[e], 1]
            rise_rx, rise_tx = (height[i] - anchors[rx[e], 2]) ** 2, 0.0
            if e == 0 or rx[e] != rx[e - 1]:
                dx, dy = ax - px, ay - py
                d = sqrt(dx * dx + dy * dy)
                c, sn = (dx / d, dy / d) if d > 0 else (1.0, 0.0)
                for k in range(K):
                    shrink = 1 - s[k] * depth
                    qx[k] = px + shrink * a * (c * cos_u[k] - sn * sin_u[k])
                    qy[k] = py + shrink * b * (sn * cos_u[k] + c * sin_u[k])
                    dx, dy = qx[k] - ax, qy[k] - ay
                    d_rx[k] = sqrt(dx * dx + dy * dy + rise_rx)
            active = tx[e] == len(anchors)
            bx, by = device[0, i], device[1, i]
            if not active:
                bx, by = anchors[tx[e], 0], anchors[tx[e], 1]
                rise_tx = (height[i] - anchors[tx[e], 2]) ** 2
            direct = sqrt((bx - ax) ** 2 + (by - ay) ** 2 + rise_rx)
            if biased:
                too_long, loose = shift[e, i], doubt[e, i]
            near, far = np.inf, 0.0
            for k in range(K):
                dx, dy = qx[k] - bx, qy[k] - by
                h[k] = d_rx[k] + sqrt(dx * dx + dy * dy + rise_tx)
                near, far = min(near, h[k]), max(far, h[k])
            for l in range(offset[e], offset[e + 1]):
                zl, v = z[l] - too_long, variance[l] + loose
                peak = 1 / sqrt(2 * pi * v)
                gate = 8 * sqrt(v)
                g = 0.0
                if near - gate < zl < far + gate:
                    for k in range(K):
                        g += exp_negative((zl - h[k]) ** 2 / (2 * v))
                    g *= scatter * peak / K
                if active:
                    g += los * peak * exp_negative((zl - direct) ** 2 / (2 * v))
                f *= clutter + g
                factors += 1
                if factors == FACTORS:
                    total, f, factors = total + log(f), 1.0, 0
        log_l[i] = total + log(f)
    return log_l


@njit(cache=True, fastmath=FAST, error_model="numpy")
def point(
    centre: Array,
    device: Array,
    height: Array,
    anchors: Array,
    tx: Array,
    rx: Array,
    offset: Array,
    z: Array,
    variance: Array,
    shift: Array,
    doubt: Array,
    clutter: float,
    p_detect: float,
) -> Array:
    """At most one range a link, detected with ``p_detect``."""
    N = centre.shape[1]
    log_l = np.zeros(N)
    h, total, loose = np.empty(N), np.empty(N), np.zeros(N)
    for e in range(len(tx)):
        ax, ay, az = anchors[rx[e], 0], anchors[rx[e], 1], anchors[rx[e], 2]
        if tx[e] == len(anchors):
            for i in range(N):
                rise = (height[i] - az) ** 2
                h[i] = sqrt((device[0, i] - ax) ** 2 + (device[1, i] - ay) ** 2 + rise)
        else:
            bx, by, bz = anchors[tx[e], 0], anchors[tx[e], 1], anchors[tx[e], 2]
            for i in range(N):
                x, y, up = centre[0, i], centre[1, i], height[i]
                h[i] = sqrt((x - ax) ** 2 + (y - ay) ** 2 + (up - az) ** 2)
                h[i] += sqrt((x - bx) ** 2 + (y - by) ** 2 + (up - bz) ** 2)
        if len(shift) > 0:
            for i in range(N):
                h[i] += shift[e, i]
                loose[i] = doubt[e, i]
        total[:] = 0.0
        for l in range(offset[e], offset[e + 1]):
            for i in range(N):
                half = 0.5 / (variance[l] + loose[i])
                total[i] += sqrt(half / pi) * exp_negative((z[l] - h[i]) ** 2 * half)
        for i in range(N):
            log_l[i] += log(1 - p_detect + p_detect / clutter * total[i])
    return log_l

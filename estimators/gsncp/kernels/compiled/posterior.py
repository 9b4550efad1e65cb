"""Compiled twin of :mod:`echoset.estimators.gsncp.kernels.posterior`: one column of eta at a time.

Within a sensor state detections are in order along x, so that those near a target are a range that
bisection finds, and a move costs in proportion to the detections of that range. Products of
ratios stand for sums of logarithms.
"""

from __future__ import annotations

from math import log, pi, sin, sqrt

import numpy as np
from numba import njit

from .....models.radar.ofdm import LIGHT
from .....models.records import Array
from ..posterior import MAX_GATE, Scene, State

_STEPS = 64
_EXP = np.exp(-np.arange(int(MAX_GATE / 2 * _STEPS) + 2) / _STEPS)
"""exp(-n / 64): with five terms of its series in the rest it is exp(-y) to 1e-14."""


@njit(cache=True, error_model="numpy")
def sensor(scene: Scene, k: int, c: Array, out: Array) -> None:
    """p_D and covariance (7,) of sensor state k at c, into ``out``."""
    _, nx, ny, nz, _ = scene.table.shape
    x = (c[0] - scene.origin[0]) / scene.spacing[0] if nx > 1 else 0.0
    y = (c[1] - scene.origin[1]) / scene.spacing[1] if ny > 1 else 0.0
    z = (c[2] - scene.origin[2]) / scene.spacing[2] if nz > 1 else 0.0
    if x < 0 or x > nx - 1 or y < 0 or y > ny - 1 or z < 0 or z > nz - 1:
        for j in range(7):
            out[j] = scene.outside[j]
        return
    i0, j0, k0 = (
        min(int(x), max(nx - 2, 0)),
        min(int(y), max(ny - 2, 0)),
        min(int(z), max(nz - 2, 0)),
    )
    x, y, z = x - i0, y - j0, z - k0
    for j in range(7):
        out[j] = 0.0
    for corner in range(8):
        i, j, h = corner & 1, (corner >> 1) & 1, corner >> 2
        w = (x if i else 1 - x) * (y if j else 1 - y) * (z if h else 1 - z)
        if w > 0:
            for n in range(7):
                out[n] += w * scene.table[k, i0 + i, j0 + j, k0 + h, n]


@njit(cache=True, error_model="numpy")
def resolved(scene: Scene, k: int, c: Array) -> float:
    """Resolution of sensor state k at c: the cell without angles."""
    cell = scene.cell[k]
    if cell[0] == 0.0:
        return float(cell[4])
    flat2, q1, q2 = 0.0, 0.0, 0.0
    for i in range(3):
        q = 0.0
        for j in range(3):
            q += scene.frame[k, i, j] * (c[j] - scene.position[k, j])
        if i == 1:
            q1 = q
        if i == 2:
            q2 = q
        else:
            flat2 += q * q
    if q1 == 0.0:
        return 1.0
    R2 = flat2 + q2 * q2
    sin_theta = sqrt(flat2 / R2)
    d_phi = 2 * sqrt(flat2) / (cell[2] * (cell[1] - 1) * abs(q1))
    d_theta = 2 / (cell[3] * (cell[1] - 1) * sin_theta)
    width = LIGHT / (2 * cell[0])
    V = d_phi * 2 * sin_theta * sin(d_theta / 2) * (R2 * width + width**3 / 12)
    return float(min(max(1 / V, 1.0), cell[4])) if V > 0 else 1.0


@njit(cache=True, error_model="numpy")
def bisect(x: Array, a: int, b: int, value: float) -> int:
    """First index of x[a:b] whose value is not below."""
    while a < b:
        middle = (a + b) // 2
        if x[middle] < value:
            a = middle + 1
        else:
            b = middle
    return a


@njit(cache=True, error_model="numpy")
def column(
    scene: Scene, c: Array, e: Array, first: Array, last: Array, fresh: Array, A: Array
) -> float:
    """Sum of rho over the sensor states of a target; its eta into ``fresh`` (M,) at the ranges
    ``first`` to ``last`` (K,), its precision into ``A`` (3, 3)."""
    total, reach, gate = 0.0, sqrt(scene.gate), scene.gate
    volume = e[0] * e[2] * e[5]
    X, Y, Z = scene.z[0], scene.z[1], scene.z[2]
    c0, c1, c2 = c[0], c[1], c[2]
    value = np.empty(7)
    E00, E10, E11 = e[0] * e[0], e[0] * e[1], e[1] * e[1] + e[2] * e[2]
    E20, E21 = e[0] * e[3], e[1] * e[3] + e[2] * e[4]
    E22 = e[3] * e[3] + e[4] * e[4] + e[5] * e[5]
    A[:] = 0.0
    for k in range(len(scene.offset) - 1):
        sensor(scene, k, c, value)
        rho = max(scene.p_false, value[0]) * max(1.0, volume * resolved(scene, k, c))
        total += rho
        xx = value[1] + E00
        l00 = 1 / sqrt(xx)
        l10 = (value[2] + E10) * l00
        l20 = (value[3] + E20) * l00
        l11 = 1 / sqrt(value[4] + E11 - l10 * l10)
        l21 = (value[5] + E21 - l20 * l10) * l11
        l22 = 1 / sqrt(value[6] + E22 - l20 * l20 - l21 * l21)
        # rows of the inverse of the Cholesky factor
        i10 = -l10 * l00 * l11
        i21 = -l21 * l11 * l22
        i20 = -(l20 * l00 + l21 * i10) * l22
        w = rho if scene.informed else 1.0
        A[0, 0] += w * (l00 * l00 + i10 * i10 + i20 * i20)
        A[1, 0] += w * (i10 * l11 + i20 * i21)
        A[1, 1] += w * (l11 * l11 + i21 * i21)
        A[2, 0] += w * i20 * l22
        A[2, 1] += w * i21 * l22
        A[2, 2] += w * l22 * l22
        peak = rho * l00 * l11 * l22 / (2 * pi) ** 1.5
        a, b = scene.offset[k], scene.offset[k + 1]
        a = bisect(X, a, b, c0 - reach * sqrt(xx))
        b = bisect(X, a, b, c0 + reach * sqrt(xx))
        first[k], last[k] = a, b
        for m in range(a, b):
            x, y, z = X[m] - c0, Y[m] - c1, Z[m] - c2
            x, y, z = l00 * x, i10 * x + l11 * y, i20 * x + i21 * y + l22 * z
            fresh[m] = x * x + y * y + z * z
        for m in range(a, b):
            if fresh[m] <= gate:
                y = 0.5 * fresh[m]
                n = int(y * _STEPS)
                y -= n / _STEPS
                series = 1 - y * (1 - y / 2 * (1 - y / 3 * (1 - y / 4 * (1 - y / 5))))
                fresh[m] = peak * _EXP[n] * series / scene.beyond[m]
            else:
                fresh[m] = 0.0
    A[0, 1], A[0, 2], A[1, 2] = A[1, 0], A[2, 0], A[2, 1]
    for a in range(3):
        if not scene.upper[a] > scene.lower[a]:
            A[a, :], A[:, a] = 0.0, 0.0
            A[a, a] = 1.0
    return total


@njit(cache=True, error_model="numpy")
def span(scene: Scene, state: State, l: int, first: Array, last: Array, fresh: Array) -> None:
    """Widen the ranges of ``fresh`` to those of column l, by zeros."""
    for k in range(len(first)):
        a, b = state.first[l, k], state.last[l, k]
        if a >= b:
            continue
        if first[k] >= last[k]:
            first[k], last[k] = a, a
        for m in range(a, first[k]):
            fresh[m] = 0.0
        for m in range(last[k], b):
            fresh[m] = 0.0
        first[k], last[k] = min(a, first[k]), max(b, last[k])


@njit(cache=True, error_model="numpy")
def log_change(
    state: State, l: int, first: Array, last: Array, fresh: Array, clutter: float
) -> float:
    """Change of sum log Z if column l becomes ``fresh``, whose ranges hold all that changes."""
    total, after, before, n = 0.0, 1.0, 1.0, 0
    eta, shot = state.eta[l], state.shot
    for k in range(len(first)):
        for m in range(first[k], last[k]):
            Z = clutter + shot[m]
            before *= Z
            after *= max(Z + (fresh[m] - eta[m]), clutter)
            n += 1
            if n & 15 == 0:
                total += log(after / before)
                after, before = 1.0, 1.0
    return total + log(after / before)


@njit(cache=True, error_model="numpy")
def put(state: State, l: int, first: Array, last: Array, fresh: Array) -> None:
    """Let ``fresh`` be column l."""
    for k in range(len(first)):
        for m in range(first[k], last[k]):
            state.shot[m] = max(state.shot[m] + fresh[m] - state.eta[l, m], 0.0)
            state.eta[l, m] = fresh[m]
    state.first[l], state.last[l] = first, last


@njit(cache=True, error_model="numpy")
def refresh(scene: Scene, state: State) -> None:
    """Compute all that follows from size, c and e; eta is zero beyond size."""
    state.eta[: state.size[0]] = 0.0
    state.shot[:] = 0.0
    state.first[:], state.last[:] = 0, 0
    for l in range(state.size[0]):
        state.rho[l] = column(
            scene, state.c[l], state.e[l], state.first[l], state.last[l], state.eta[l], state.A[l]
        )
        for k in range(len(scene.offset) - 1):
            for m in range(state.first[l, k], state.last[l, k]):
                state.shot[m] += state.eta[l, m]


@njit(cache=True, error_model="numpy")
def log_posterior(scene: Scene, state: State, intensity: Array) -> float:
    """The logarithm of the posterior of a state that satisfies the prior."""
    L, K = state.size[0], len(scene.offset) - 1
    D, E = 1.0, 1.0
    for a in range(3):
        if scene.upper[a] > scene.lower[a]:
            D *= scene.upper[a] - scene.lower[a]
    for a in range(6):
        if scene.e_upper[a] > scene.e_lower[a]:
            E *= scene.e_upper[a] - scene.e_lower[a]
    total = float(K * (1 - intensity[1]) * D + L * (log(intensity[0]) - log(E)))
    for l in range(L):
        total -= state.rho[l]
    for m in range(len(state.shot)):
        total += log(scene.beyond[m] * (intensity[1] + state.shot[m]))
    return total


@njit(cache=True, error_model="numpy")
def mean_shot(scene: Scene, c: Array, e: Array) -> Array:
    """Mean over the extents e (n, 6) of the sum of eta over all detections, at c (J, 3)."""
    K = len(scene.offset) - 1
    first, last, fresh = np.zeros(K, np.int64), np.zeros(K, np.int64), np.zeros(scene.z.shape[1])
    A, mean = np.zeros((3, 3)), np.zeros(len(c))
    for j in range(len(c)):
        for i in range(len(e)):
            column(scene, c[j], e[i], first, last, fresh, A)
            for k in range(K):
                for m in range(first[k], last[k]):
                    mean[j] += fresh[m] / len(e)
    return mean

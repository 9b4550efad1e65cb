"""Compiled twins of :mod:`echoset.estimators.points.kernels.gaussians`."""

from __future__ import annotations

import numpy as np
from numba import njit

from .....models.records import Array
from .parts import falling, inner


@inner
def _cholesky(A: Array, L: Array) -> None:
    """Lower Cholesky factor of A (d, d) into L; a matrix that is not positive gives NaN."""
    d = len(A)
    for r in range(d):
        for c in range(r + 1):
            s = A[r, c]
            for k in range(c):
                s -= L[r, k] * L[c, k]
            if r == c:
                L[r, r] = np.sqrt(s) if s > 0 else np.nan
            else:
                L[r, c] = s / L[c, c]


@inner
def _wrapped(v: float, period: float) -> float:
    return v - period * np.rint(v / period) if period > 0 else v


@njit(cache=True)
def predict(m: Array, P: Array, F: Array, Q: Array) -> tuple[Array, Array]:
    """Means (J, dx) and covariances (J, dx, dx) after x -> F x + noise; see the definition."""
    J, d = m.shape
    m_out, P_out, FP = np.empty((J, d)), np.empty((J, d, d)), np.empty((d, d))
    for j in range(J):
        for r in range(d):
            m_out[j, r] = 0.0
            for c in range(d):
                m_out[j, r] += F[r, c] * m[j, c]
                s = 0.0
                for k in range(d):
                    s += F[r, k] * P[j, k, c]
                FP[r, c] = s
        for r in range(d):
            for c in range(d):
                s = Q[r, c]
                for k in range(d):
                    s += FP[r, k] * F[c, k]
                P_out[j, r, c] = s
    return m_out, P_out


@njit(cache=True)
def log_likelihood(z: Array, z_hat: Array, S: Array, period: Array, gate: float) -> Array:
    """Log densities (J, n) of detections, -inf outside the gate; see the definition."""
    n, d = z.shape
    J, k = len(z_hat), S.shape[1]
    out = np.empty((J, n))
    L, e = np.empty((d, d)), np.empty(d)
    half = 0.0
    for j in range(J):
        for i in range(n):
            if i == 0 or k > 1:
                _cholesky(S[j, i], L)
                half = 0.5 * d * np.log(2 * np.pi)
                for r in range(d):
                    half += np.log(L[r, r])
            d2 = 0.0
            for r in range(d):
                s = _wrapped(z[i, r] - z_hat[j, r], period[r])
                for c in range(r):
                    s -= L[r, c] * e[c]
                e[r] = s / L[r, r]
                d2 += e[r] * e[r]
            out[j, i] = -np.inf if d2 > gate else -0.5 * d2 - half
    return out


@njit(cache=True)
def gain(P: Array, C: Array, S: Array) -> tuple[Array, Array]:
    """Kalman gains and updated covariances; see the definition."""
    J, dx, dz = C.shape
    K, P_out = np.empty((J, dx, dz)), np.empty((J, dx, dx))
    L, e = np.empty((dz, dz)), np.empty((dx, dz))
    for j in range(J):
        _cholesky(S[j], L)
        for x in range(dx):
            for r in range(dz):
                s = C[j, x, r]
                for c in range(r):
                    s -= L[r, c] * e[x, c]
                e[x, r] = s / L[r, r]
            for r in range(dz - 1, -1, -1):
                s = e[x, r]
                for c in range(r + 1, dz):
                    s -= L[c, r] * K[j, x, c]
                K[j, x, r] = s / L[r, r]
        for x in range(dx):
            for y in range(x + 1):
                s = 0.5 * (P[j, x, y] + P[j, y, x])
                for r in range(dz):
                    s -= e[x, r] * e[y, r]
                P_out[j, x, y] = P_out[j, y, x] = s
    return K, P_out


@njit(cache=True)
def correct(m: Array, K: Array, z: Array, z_hat: Array, period: Array) -> Array:
    """Means m + K (z - z_hat); see the definition."""
    J, dx, dz = K.shape
    out = m.copy()
    for j in range(J):
        for r in range(dz):
            v = _wrapped(z[j, r] - z_hat[j, r], period[r])
            for x in range(dx):
                out[j, x] += K[j, x, r] * v
    return out


@njit(cache=True)
def merge(
    w: Array, m: Array, P: Array, scale: Array, threshold: float, by_leader: bool = False
) -> tuple[Array, Array, Array, Array]:
    """Merge what is close to the strongest, and so on; see the definition."""
    J, d = m.shape
    L = np.empty((J, d, d))
    for j in range(J):
        _cholesky(scale[j], L[j])
    left = falling(w)
    count, G = J, 0
    w_out, m_out, P_out = np.empty(J), np.empty((J, d)), np.empty((J, d, d))
    leader, near, e = np.empty(J, np.int64), np.empty(J, np.int64), np.empty(d)
    while count:
        l, size, rest, total = left[0], 0, 0, 0.0
        for r in range(d):
            m_out[G, r] = 0.0
            for c in range(d):
                P_out[G, r, c] = 0.0
        for at in range(count):
            j = left[at]
            k = l if by_leader else j
            d2 = 0.0
            for r in range(d):
                s = m[j, r] - m[l, r]
                for c in range(r):
                    s -= L[k, r, c] * e[c]
                e[r] = s / L[k, r, r]
                d2 += e[r] * e[r]
                if d2 > threshold:
                    break
            if j == l or d2 <= threshold:
                near[size] = j
                size += 1
                total += w[j]
                for r in range(d):
                    m_out[G, r] += w[j] * m[j, r]
            else:
                left[rest] = j
                rest += 1
        for r in range(d):
            m_out[G, r] /= total
        for at in range(size):
            j = near[at]
            q = w[j] / total
            for r in range(d):
                v = m[j, r] - m_out[G, r]
                for c in range(r + 1):
                    P_out[G, r, c] += q * (P[j, r, c] + v * (m[j, c] - m_out[G, c]))
        for r in range(d):
            for c in range(r):
                P_out[G, c, r] = P_out[G, r, c]
        leader[G], w_out[G], count = l, total, rest
        G += 1
    return w_out[:G], m_out[:G], P_out[:G], leader[:G]

"""Compiled twin in :mod:`echoset.estimators.points.kernels.bernoulli`."""

from __future__ import annotations

import numpy as np
from numba import njit

from .....models.records import Array
from .gaussians import _cholesky


@njit(cache=True)
def group(
    track: Array, weight: Array, r: Array, m: Array, P: Array, visible: Array,
    distance: float, existence: float,
) -> tuple[Array, Array, Array, Array, Array]:  # fmt: skip
    """Unite like Bernoullis of a track, the weightiest first; see the definition."""
    L, d = m.shape
    leader = np.full(L, -1)
    r_out, m_out, P_out, visible_out = r.copy(), m.copy(), P.copy(), visible.copy()
    order = np.argsort(-weight, kind="mergesort")
    near, root, e = np.empty(L, np.int64), np.zeros((d, d)), np.empty(d)
    for at in range(L):
        l = order[at]
        if leader[l] >= 0:
            continue
        leader[l], near[0], size, known = l, l, 1, False
        for later in range(at + 1, L):
            j = order[later]
            if leader[j] >= 0 or track[j] != track[l] or abs(r[j] - r[l]) > existence:
                continue
            if not known:
                _cholesky(P[l], root)
                known = True
            d2 = 0.0
            for a in range(d):
                e[a] = m[j, a] - m[l, a]
                for b in range(a):
                    e[a] -= root[a, b] * e[b]
                e[a] /= root[a, a]
                d2 += e[a] * e[a]
            if d2 <= distance:
                leader[j] = l
                near[size] = j
                size += 1
        total, mass = 0.0, 0.0
        for j in near[:size]:
            total += weight[j]
            mass += weight[j] * r[j]
        if size == 1 or mass == 0.0:
            continue
        m_out[l], P_out[l], visible_out[l] = 0.0, 0.0, 0.0
        for j in near[:size]:
            share = weight[j] * r[j] / mass
            visible_out[l] += share * visible[j]
            for a in range(d):
                m_out[l, a] += share * m[j, a]
        for j in near[:size]:
            share = weight[j] * r[j] / mass
            for a in range(d):
                for b in range(d):
                    spread = (m[j, a] - m_out[l, a]) * (m[j, b] - m_out[l, b])
                    P_out[l, a, b] += share * (P[j, a, b] + spread)
        r_out[l] = mass / total
    return leader, r_out, m_out, P_out, visible_out

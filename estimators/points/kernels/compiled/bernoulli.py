"""Compiled twin in :mod:`echoset.estimators.points.kernels.bernoulli`."""

from __future__ import annotations

import numpy as np
from numba import njit

from .....models.records import Array
from .gaussians import _cholesky
from .parts import falling, inner


@inner
def _by_track(order: Array, track: Array) -> tuple[Array, Array]:
    """The indices in the same order by track, and where each track ends."""
    T = 0
    for t in track:
        T = max(T, t + 1)
    end, place = np.empty(T + 1, np.int64), np.empty(len(order), np.int64)
    for t in range(T + 1):
        end[t] = 0
    for t in track:
        end[t + 1] += 1
    for t in range(T):
        end[t + 1] += end[t]
    for i in order:
        place[end[track[i]]] = i
        end[track[i]] += 1
    return place, end


@njit(cache=True)
def group(
    track: Array, weight: Array, r: Array, m: Array, P: Array, visible: Array,
    distance: float, existence: float,
) -> tuple[Array, Array, Array, Array, Array]:  # fmt: skip
    """Unite like Bernoullis of a track, the weightiest first; see the definition."""
    L, d = m.shape
    leader, near = np.empty(L, np.int64), np.empty(L, np.int64)
    root, e, root_of = np.empty((d, d)), np.empty(d), -1
    r_out, visible_out = np.empty(L), np.empty(L)
    m_out, P_out = np.empty((L, d)), np.empty((L, d, d))
    for l in range(L):
        leader[l], r_out[l], visible_out[l] = -1, r[l], visible[l]
        for a in range(d):
            m_out[l, a] = m[l, a]
            for b in range(d):
                P_out[l, a, b] = P[l, a, b]
    order, end = _by_track(falling(weight), track)
    for at in range(L):
        l = order[at]
        if leader[l] >= 0:
            continue
        leader[l], near[0], size = l, l, 1
        total, mass = weight[l], weight[l] * r[l]
        for later in range(at + 1, end[track[l]]):
            j = order[later]
            if leader[j] >= 0 or abs(r[j] - r[l]) > existence:
                continue
            if root_of != l:
                _cholesky(P[l], root)
                root_of = l
            d2 = 0.0
            for a in range(d):
                e[a] = m[j, a] - m[l, a]
                for b in range(a):
                    e[a] -= root[a, b] * e[b]
                e[a] /= root[a, a]
                d2 += e[a] * e[a]
            if d2 <= distance:
                leader[j], near[size] = l, j
                size += 1
                total += weight[j]
                mass += weight[j] * r[j]
        if size == 1 or mass == 0.0:
            continue
        r_out[l], visible_out[l] = mass / total, 0.0
        for a in range(d):
            m_out[l, a] = 0.0
            for b in range(d):
                P_out[l, a, b] = 0.0
        for s in range(size):
            j = near[s]
            share = weight[j] * r[j] / mass
            visible_out[l] += share * visible[j]
            for a in range(d):
                m_out[l, a] += share * m[j, a]
        for s in range(size):
            j = near[s]
            share = weight[j] * r[j] / mass
            for a in range(d):
                for b in range(d):
                    spread = (m[j, a] - m_out[l, a]) * (m[j, b] - m_out[l, b])
                    P_out[l, a, b] += share * (P[j, a, b] + spread)
    return leader, r_out, m_out, P_out, visible_out

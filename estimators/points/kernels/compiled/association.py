"""Compiled twin of :mod:`echoset.estimators.points.kernels.association`, part by part.

Pairs that no chain of others connects have no messages for each other: each part of the graph goes
on for as many rounds as it needs itself.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .....models.records import Array
from ..association import _ROUNDS, _STEADY, _SURE
from .parts import inner


@inner
def _root(above: Array, node: int) -> int:
    while above[node] != node:
        above[node] = above[above[node]]
        node = above[node]
    return node


@inner
def _by_part(target: Array, detection: Array, T: int, n: int) -> tuple[Array, Array]:
    """Order (k,) of the pairs by connected part, and where each part begins and the last ends."""
    above, start = np.empty(T + n, np.int64), np.empty(T + n + 1, np.int64)
    for i in range(T + n):
        above[i], start[i + 1] = i, 0
    for p in range(len(target)):
        above[_root(above, target[p])] = _root(above, T + detection[p])
    for p in range(len(target)):
        start[_root(above, target[p]) + 1] += 1
    start[0] = 0
    for i in range(T + n):
        start[i + 1] += start[i]
    order = np.empty(len(target), np.int64)
    for p in range(len(target)):
        root = _root(above, target[p])
        order[start[root]] = p
        start[root] += 1
    # Each now stands where the next begins.
    for i in range(T + n, 0, -1):
        start[i] = start[i - 1]
    start[0] = 0
    return order, start


@njit(cache=True)
def marginals(target: Array, detection: Array, odds: Array, T: int, n: int) -> tuple[Array, Array]:
    """Probability of each of k pairs, and (T,) that a target is missed; see the definition."""
    order, start = _by_part(target, detection, T, n)
    k = len(odds)
    psi, mu, nu, pair = np.empty(k), np.empty(k), np.empty(k), np.empty(k)
    by_target, by_detection, missed = np.empty(T), np.empty(n), np.empty(T)
    for p in range(k):
        psi[p], nu[p] = min(odds[p], _SURE), 1.0
    for part in range(T + n):
        for _ in range(_ROUNDS if start[part + 1] > start[part] else 0):
            for s in range(start[part], start[part + 1]):
                by_target[target[order[s]]] = by_detection[detection[order[s]]] = 0.0
            for s in range(start[part], start[part + 1]):
                p = order[s]
                by_target[target[p]] += psi[p] * nu[p]
            for s in range(start[part], start[part + 1]):
                p = order[s]
                mu[p] = psi[p] / (1 + by_target[target[p]] - psi[p] * nu[p])
                by_detection[detection[p]] += mu[p]
            change = 0.0
            for s in range(start[part], start[part + 1]):
                p = order[s]
                after = 1 / (1 + max(by_detection[detection[p]] - mu[p], 0.0))
                change = max(change, abs(after - nu[p]))
                nu[p] = after
            if change < _STEADY:
                break
    for t in range(T):
        by_target[t] = 1.0
    for p in range(k):
        by_target[target[p]] += psi[p] * nu[p]
    for p in range(k):
        pair[p] = psi[p] * nu[p] / by_target[target[p]]
    for t in range(T):
        missed[t] = 1 / by_target[t]
    return pair, missed

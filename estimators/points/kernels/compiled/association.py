"""Compiled twin of :mod:`echoset.estimators.points.kernels.association`, part by part.

Pairs that no chain of others connects have no messages for each other: each part of the graph goes
on for as many rounds as it needs itself.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .....models.records import Array
from ..association import _ROUNDS, _STEADY, _SURE


@njit(cache=True)
def _root(above: Array, node: int) -> int:
    while above[node] != node:
        above[node] = above[above[node]]
        node = above[node]
    return node


@njit(cache=True)
def _by_part(target: Array, detection: Array, T: int, n: int) -> tuple[Array, Array]:
    """Order (k,) of the pairs by connected part, and where each part begins and the last ends."""
    k = len(target)
    above = np.arange(T + n)
    for p in range(k):
        above[_root(above, target[p])] = _root(above, T + detection[p])
    start = np.zeros(T + n + 1, np.int64)
    for p in range(k):
        start[_root(above, target[p]) + 1] += 1
    start = np.cumsum(start)
    place, order = start.copy(), np.empty(k, np.int64)
    for p in range(k):
        root = _root(above, target[p])
        order[place[root]] = p
        place[root] += 1
    return order, start


@njit(cache=True)
def marginals(target: Array, detection: Array, odds: Array, T: int, n: int) -> tuple[Array, Array]:
    """Probability of each of k pairs, and (T,) that a target is missed; see the definition."""
    k = len(odds)
    order, start = _by_part(target, detection, T, n)
    psi, mu, nu = np.empty(k), np.empty(k), np.ones(k)
    by_target, by_detection = np.empty(T), np.empty(n)
    for p in range(k):
        psi[p] = min(odds[p], _SURE)
    for part in range(T + n):
        some = order[start[part] : start[part + 1]]
        for _ in range(_ROUNDS if len(some) else 0):
            for p in some:
                by_target[target[p]] = by_detection[detection[p]] = 0.0
            for p in some:
                by_target[target[p]] += psi[p] * nu[p]
            for p in some:
                mu[p] = psi[p] / (1 + by_target[target[p]] - psi[p] * nu[p])
                by_detection[detection[p]] += mu[p]
            change = 0.0
            for p in some:
                after = 1 / (1 + max(by_detection[detection[p]] - mu[p], 0.0))
                change = max(change, abs(after - nu[p]))
                nu[p] = after
            if change < _STEADY:
                break
    by_target[:] = 1.0
    for p in range(k):
        by_target[target[p]] += psi[p] * nu[p]
    pair, missed = np.empty(k), np.empty(T)
    for p in range(k):
        pair[p] = psi[p] * nu[p] / by_target[target[p]]
    for t in range(T):
        missed[t] = 1 / by_target[t]
    return pair, missed

"""Compiled twin of :mod:`..murty`: each part costs one augmenting path.

A part takes over the solution and the dual prices u, v of the problem it was split from. Only the
forbidden pair has lost its place, and one shortest augmenting path from its row back to its column
mends the solution. Free columns belong to one dummy row of zero cost and zero price. Paths that
cannot enter the k best are given up on the way. M. L. Miller, H. S. Stone and I. J. Cox,
"Optimizing Murty's ranked assignment method", IEEE Trans. Aerosp. Electron. Syst. 33 (1997)
851-862.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from .....models.records import Array
from .parts import inner


@inner
def _augment(
    C: Array, u: Array, v: Array, x: Array, y: Array, skip: Array, ban: Array, i: int, to: int,
    limit: float,
) -> float:  # fmt: skip
    """Give row ``i`` a column by the shortest path to column ``to`` (-1: to any free column).

    Row i may not use the columns ``ban``, no row those in ``skip``. The prices u (n,), v (m,), the
    columns x (n,) of the rows and the rows y (m,) of the columns are updated in place; returned is
    what the path costs, infinity (and nothing changed) where that is above ``limit``.
    """
    n, m = C.shape
    distance, source, done = np.empty(m), np.empty(m, np.int64), np.empty(m, np.int64)
    for j in range(m):
        distance[j], source[j], done[j] = np.inf, n, skip[j]
    row, base, free = i, 0.0, -1
    while True:
        nearest = -1
        for j in range(m):
            if done[j]:
                continue
            if row == n:
                d = base - v[j]
            elif row == i and ban[j]:
                d = np.inf
            else:
                d = base + C[row, j] - u[row] - v[j]
            if d < distance[j]:
                distance[j], source[j] = d, row
            if nearest < 0 or distance[j] < distance[nearest]:
                nearest = j
        if nearest < 0 or not distance[nearest] <= limit or distance[nearest] == np.inf:
            return np.inf
        done[nearest] = 1
        base = distance[nearest]
        if nearest == to or (to < 0 and y[nearest] < 0):
            break
        row = y[nearest]
        if row < 0:
            row, free = n, nearest
            for j in range(m):
                if y[j] < 0 and j != to and not done[j]:
                    done[j], distance[j] = 1, base
    for j in range(m):
        if done[j] and not skip[j] and distance[j] < base:
            v[j] -= base - distance[j]
            if y[j] >= 0:
                u[y[j]] += base - distance[j]
    u[i] += base
    if free >= 0:
        shift = base - distance[free]
        for r in range(n):
            u[r] -= shift
        for j in range(m):
            v[j] += shift
    j = nearest
    while True:
        row = source[j]
        if row == n:
            y[j], j = -1, free
            continue
        y[j], x[row], j = row, j, x[row]
        if row == i:
            return float(base)


@inner
def _keep(
    order: Array, size: int, cost: Array, C: Array, x: Array, u: Array, v: Array, X: Array,
    U: Array, V: Array,
) -> int:  # fmt: skip
    """Put a part into its place of ``order`` and its slot: which that is, or -1 for one too many.

    Its columns x (n,) and prices u (n,), v (m,) go into rows of X, U, V.
    """
    k, value = len(order), 0.0
    for i in range(len(x)):
        value += C[i, x[i]]
    if size == k and (k == 0 or value >= cost[order[k - 1]]):
        return -1
    slot = order[k - 1] if size == k else size
    at = min(size, k - 1)
    while at > 0 and cost[order[at - 1]] > value:
        order[at] = order[at - 1]
        at -= 1
    order[at], cost[slot] = slot, value
    for i in range(len(x)):
        X[slot, i], U[slot, i] = x[i], u[i]
    for j in range(len(v)):
        V[slot, j] = v[j]
    return int(slot)


@njit(cache=True)
def k_best(costs: Array, k: int, gap: float = np.inf) -> tuple[Array, Array, Array]:
    """The ``k`` cheapest assignments over all problems; see the definition."""
    G, n, m = costs.shape
    # Parts stand in slots, at most k; `order` lists the slots by increasing cost.
    X, U, V = np.empty((k, n), np.int64), np.empty((k, n)), np.empty((k, m))
    problem, start, order = np.empty(k, np.int64), np.empty(k, np.int64), np.empty(k, np.int64)
    ban, cost = np.empty((k, m), np.int64), np.empty(k)
    x, y, u, v = np.empty(n, np.int64), np.empty(m, np.int64), np.empty(n), np.empty(m)
    skip, taboo = np.empty(m, np.int64), np.empty(m, np.int64)
    # As constants, which have types of their own, they would be compiled for once more.
    size: Any = np.int64(0)
    free: Any = np.int64(-1)
    found = 0
    for g in range(G):
        for j in range(m):
            v[j], y[j], skip[j] = 0.0, -1, 0
        best = 0.0
        for i in range(n):
            x[i], u[i] = -1, 0.0
        for i in range(n):
            best = _augment(costs[g], u, v, x, y, skip, skip, i, free, np.inf)
            if best == np.inf:
                break
        slot = -1 if best == np.inf else _keep(order, size, cost, costs[g], x, u, v, X, U, V)
        if slot >= 0:
            size = min(size + 1, k)
            problem[slot], start[slot] = g, 0
            for j in range(m):
                ban[slot, j] = 0
    while found < size and cost[order[found]] <= cost[order[0]] + gap:
        parent = order[found]
        found += 1
        if found == k:
            break
        g, first = problem[parent], start[parent]
        for j in range(m):
            skip[j] = 0
        for i in range(first):
            skip[X[parent, i]] = 1
        for i in range(first, n):
            column, choices = X[parent, i], 0
            for j in range(m):
                choices += costs[g, i, j] < np.inf
            if choices == 1:
                skip[column] = 1
                continue
            worst = cost[order[0]] + gap
            if size == k:
                worst = min(worst, cost[order[k - 1]])
            for j in range(m):
                v[j], y[j], taboo[j] = V[parent, j], -1, ban[parent, j] if i == first else 0
            for r in range(n):
                x[r], u[r] = X[parent, r], U[parent, r]
                y[x[r]] = r
            taboo[column], y[column] = 1, -1
            limit = worst - cost[parent]
            if _augment(costs[g], u, v, x, y, skip, taboo, i, column, limit) < np.inf:
                slot = _keep(order, size, cost, costs[g], x, u, v, X, U, V)
                if slot >= 0:
                    size = min(size + 1, k)
                    problem[slot], start[slot] = g, i
                    for j in range(m):
                        ban[slot, j] = taboo[j]
            skip[column] = 1
    row, price = np.empty(found, np.int64), np.empty(found)
    columns = np.empty((found, n), np.int64)
    for s in range(found):
        slot = order[s]
        row[s], price[s] = problem[slot], cost[slot]
        for i in range(n):
            columns[s, i] = X[slot, i]
    return row, columns, price

"""Compiled twin of :mod:`..murty`: each part costs one augmenting path.

A part takes over the solution and the dual prices u, v of the problem it was split from. Only the
forbidden pair has lost its place, and one shortest augmenting path from its row back to its column
mends the solution. Free columns belong to one dummy row of zero cost and zero price. Paths that
cannot enter the k best are given up on the way. M. L. Miller, H. S. Stone and I. J. Cox,
"Optimizing Murty's ranked assignment method", IEEE Trans. Aerosp. Electron. Syst. 33 (1997)
851-862.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .....models.records import Array


@njit(cache=True)
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
    distance = np.full(m, np.inf)
    source = np.full(m, n)
    done = skip.copy()
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
        done[nearest] = True
        base = distance[nearest]
        if nearest == to or (to < 0 and y[nearest] < 0):
            break
        row = y[nearest]
        if row < 0:
            row, free = n, nearest
            for j in range(m):
                if y[j] < 0 and j != to and not done[j]:
                    done[j], distance[j] = True, base
    for j in range(m):
        if done[j] and not skip[j] and distance[j] < base:
            v[j] -= base - distance[j]
            if y[j] >= 0:
                u[y[j]] += base - distance[j]
    u[i] += base
    if free >= 0:
        shift = base - distance[free]
        u -= shift
        v += shift
    j = nearest
    while True:
        row = source[j]
        if row == n:
            y[j], j = -1, free
            continue
        y[j], x[row], j = row, j, x[row]
        if row == i:
            return float(base)


@njit(cache=True)
def _total(C: Array, x: Array) -> float:
    total = 0.0
    for i in range(len(x)):
        total += C[i, x[i]]
    return total


@njit(cache=True)
def _insert(order: Array, size: int, cost: Array, value: float) -> int:
    """Put a part of this cost into its place of ``order``: its slot, or -1 for one too many."""
    k = len(order)
    if size == k and (k == 0 or value >= cost[order[k - 1]]):
        return -1
    slot = order[k - 1] if size == k else size
    at = min(size, k - 1)
    while at > 0 and cost[order[at - 1]] > value:
        order[at] = order[at - 1]
        at -= 1
    order[at], cost[slot] = slot, value
    return int(slot)


@njit(cache=True)
def _solve(C: Array) -> tuple[Array, Array, Array, bool]:
    """Columns x (n,) and prices u (n,), v (m,) of the best assignment, and whether there is one."""
    n, m = C.shape
    u, v = np.zeros(n), np.zeros(m)
    x, y = np.full(n, -1), np.full(m, -1)
    none = np.zeros(m, np.bool_)
    for i in range(n):
        if _augment(C, u, v, x, y, none, none, i, -1, np.inf) == np.inf:
            return x, u, v, False
    return x, u, v, True


@njit(cache=True)
def k_best(costs: Array, k: int, gap: float = np.inf) -> tuple[Array, Array, Array]:
    """The ``k`` cheapest assignments over all problems; see the definition."""
    G, n, m = costs.shape
    # Parts stand in slots, at most k; `order` lists the slots by increasing cost.
    X, U, V = np.empty((k, n), np.int64), np.empty((k, n)), np.empty((k, m))
    problem, start = np.zeros(k, np.int64), np.zeros(k, np.int64)
    ban, cost = np.zeros((k, m), np.bool_), np.zeros(k)
    order, size, found = np.zeros(k, np.int64), 0, 0
    no_ban = np.zeros(m, np.bool_)
    choices = np.zeros((G, n), np.int64)
    for g in range(G):
        for i in range(n):
            for j in range(m):
                choices[g, i] += costs[g, i, j] < np.inf
        x, u, v, feasible = _solve(costs[g])
        slot = _insert(order, size, cost, _total(costs[g], x)) if feasible else -1
        if slot >= 0:
            size = min(size + 1, k)
            problem[slot], start[slot], ban[slot] = g, 0, no_ban
            X[slot], U[slot], V[slot] = x, u, v
    while found < size and cost[order[found]] <= cost[order[0]] + gap:
        parent = order[found]
        found += 1
        if found == k:
            break
        g, first = problem[parent], start[parent]
        C, skip = costs[g], np.zeros(m, np.bool_)
        skip[X[parent, :first]] = True
        for i in range(first, n):
            column = X[parent, i]
            if choices[g, i] == 1:
                skip[column] = True
                continue
            worst = cost[order[0]] + gap
            if size == k:
                worst = min(worst, cost[order[k - 1]])
            x, u, v, y = X[parent].copy(), U[parent].copy(), V[parent].copy(), np.full(m, -1)
            y[x] = np.arange(n)
            taboo = ban[parent].copy() if i == first else no_ban.copy()
            taboo[column], y[column] = True, -1
            if _augment(C, u, v, x, y, skip, taboo, i, column, worst - cost[parent]) < np.inf:
                slot = _insert(order, size, cost, _total(C, x))
                if slot >= 0:
                    size = min(size + 1, k)
                    problem[slot], start[slot], ban[slot] = g, i, taboo
                    X[slot], U[slot], V[slot] = x, u, v
            skip[column] = True
    kept = order[:found]
    return problem[kept], X[kept], cost[kept]

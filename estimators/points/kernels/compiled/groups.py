"""Compiled twins of :mod:`echoset.estimators.points.kernels.groups`."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from .....models.records import Array
from .association import _root
from .murty import k_best
from .parts import falling, inner


@inner
def members(group: Array, C: int) -> tuple[Array, Array]:
    """The indices (n,) by group, those of -1 left out; see the definition."""
    start = np.empty(C + 1, np.int64)
    for c in range(C + 1):
        start[c] = 0
    for c in group:
        if c >= 0:
            start[c + 1] += 1
    for c in range(C):
        start[c + 1] += start[c]
    order = np.empty(start[C], np.int64)
    for i in range(len(group)):
        if group[i] >= 0:
            order[start[group[i]]] = i
            start[group[i]] += 1
    # Each now stands where the next begins.
    for c in range(C, 0, -1):
        start[c] = start[c - 1]
    start[0] = 0
    return order, start


@njit(cache=True)
def together(group: Array, detection: Array, C: int, n: int) -> tuple[Array, Array]:
    """Which groups become one, and whose detections are; see the definition."""
    above, number = np.empty(C + n, np.int64), np.empty(C + n, np.int64)
    for i in range(C + n):
        above[i], number[i] = i, -1
    for p in range(len(group)):
        above[_root(above, C + detection[p])] = _root(above, group[p])
    into, of = np.empty(C, np.int64), np.empty(n, np.int64)
    count = 0
    for c in range(C):
        root = _root(above, c)
        if number[root] < 0:
            number[root] = count
            count += 1
        into[c] = number[root]
    for i in range(n):
        of[i] = number[_root(above, C + i)]
    return into, of


@njit(inline="always")
def _count(w: Array, c: int) -> int:
    """Number of hypotheses of a group, of w (K, C)."""
    n = 0
    while n < len(w) and w[n, c] > 0:
        n += 1
    return n


@njit(cache=True)
def join(w: Array, into: Array, k: int, gap: float) -> tuple[Array, Array, Array]:
    """The hypotheses of groups that become one; see the definition."""
    K, C = w.shape
    new: Any = np.int64(0)
    for c in into:
        new = max(new, c + 1)
    order, start = members(into, new)
    most = max(k, K)
    row, before = np.empty((most, C), np.int64), np.empty((most, C), np.int64)
    w_new, share, weight = np.empty((most, new)), np.empty(new), np.empty(most)
    for i in range(most):
        for c in range(C):
            row[i, c] = -1
    size = 1
    for c in range(new):
        first = order[start[c]]
        n = _count(w, first)
        for i in range(n):
            weight[i], row[i, first] = w[i, first], i
        for at in range(start[c] + 1, start[c + 1]):
            g = order[at]
            u = _count(w, g)
            product = np.empty(n * u)
            for i in range(n):
                for j in range(u):
                    product[i * u + j] = weight[i] * w[j, g]
            best = falling(product)
            least, kept = product[best[0]] * np.exp(-gap), 0
            while kept < min(n * u, max(k, u, n)) and product[best[kept]] >= least:
                kept += 1
            for b in range(start[c], at):
                for i in range(n):
                    before[i, order[b]], row[i, order[b]] = row[i, order[b]], -1
                for i in range(kept):
                    row[i, order[b]] = before[best[i] // u, order[b]]
            for i in range(kept):
                weight[i], row[i, g] = product[best[i]], best[i] % u
            n = kept
        share[c] = 0.0
        for i in range(n):
            share[c] += weight[i]
        for i in range(most):
            w_new[i, c] = weight[i] / share[c] if i < n else 0.0
        size = max(size, n)
    return row[:size], w_new[:size], share


@njit(inline="always")
def _k_best_of_one(costs: Array, k: int, gap: float) -> tuple[Array, Array, Array]:
    """:func:`k_best` where there is one row, which may have any column."""
    G, _, m = costs.shape
    gain = np.empty(G * m)
    for i in range(G * m):
        gain[i] = -costs[i // m, 0, i % m]
    order, size = falling(gain), 0
    while size < min(k, G * m) and -gain[order[size]] <= gap - gain[order[0]]:
        if gain[order[size]] == -np.inf:
            break
        size += 1
    row, column, cost = np.empty(size, np.int64), np.empty((size, 1), np.int64), np.empty(size)
    for s in range(size):
        row[s], column[s, 0], cost[s] = order[s] // m, order[s] % m, -gain[order[s]]
    return row, column, cost


@njit(cache=True)
def best(
    w: Array, table: Array, group: Array, gain: Array, miss: Array, of: Array, k: int, gap: float
) -> tuple[Array, Array, Array]:
    """The ``k`` best associations of each group; see the definition."""
    K, C = w.shape
    T, most = len(group), max(k, K)
    cost_out, row_out = np.empty((most, C)), np.empty((most, C), np.int64)
    detection_out, size = np.empty((most, T), np.int64), 1
    for s in range(most):
        for c in range(C):
            cost_out[s, c], row_out[s, c] = np.inf, -1
        for t in range(T):
            detection_out[s, t] = -1
    tracks, first = members(group, C)
    seen, begin = members(of, C)
    active = np.empty(T, np.int64)
    for c in range(C):
        those, n, G, m = begin[c], begin[c + 1] - begin[c], _count(w, c), 0
        before = np.empty(G)
        for g in range(G):
            before[g] = np.log(w[g, c])
        for a in range(first[c], first[c + 1]):
            is_active = False
            for g in range(G):
                l = table[g, tracks[a]]
                before[g] += miss[l]
                for i in range(n):
                    is_active = is_active or gain[l, seen[those + i]] > -np.inf
            if is_active:
                active[m] = tracks[a]
                m += 1
        if m == 0:
            order = falling(before)
            for s in range(G):
                cost_out[s, c], row_out[s, c] = -before[order[s]], order[s]
            size = max(size, G)
            continue
        costs = np.empty((G, m, n + m))
        for g in range(G):
            for a in range(m):
                l = table[g, active[a]]
                shift = before[g] if a == 0 else 0.0
                for i in range(n):
                    costs[g, a, i] = -gain[l, seen[those + i]] - shift
                for i in range(m):
                    costs[g, a, n + i] = -shift if i == a else np.inf
        row, column, cost = _k_best_of_one(costs, k, gap) if m == 1 else k_best(costs, k, gap)
        for s in range(len(cost)):
            cost_out[s, c], row_out[s, c] = cost[s], row[s]
            for a in range(m):
                if column[s, a] < n:
                    detection_out[s, active[a]] = seen[those + column[s, a]]
        size = max(size, len(cost))
    return cost_out[:size], row_out[:size], detection_out[:size]


@njit(inline="always")
def _variation(
    w: Array, c: int, choice: Array, p: Array, t: int, u: int, joint: Array, A: int, B: int
) -> float:
    """Total variation of the law of tracks t and u of group c from the product of that of each.

    Of A and B laws of either, each hypothesis has a ``choice`` (T, K), which exists with p (T, K).
    ``joint`` is room for those of both, and for the sums along both.
    """
    for i in range(A + 1):
        for j in range(B + 1):
            joint[i, j] = 0.0
    for g in range(_count(w, c)):
        a, b, q, r = choice[t, g], choice[u, g], p[t, g], p[u, g]
        joint[a, b] += w[g, c] * q * r
        joint[a, 0] += w[g, c] * q * (1 - r)
        joint[0, b] += w[g, c] * (1 - q) * r
        joint[0, 0] += w[g, c] * (1 - q) * (1 - r)
    for i in range(A):
        for j in range(B):
            joint[i, B] += joint[i, j]
            joint[A, j] += joint[i, j]
    total = 0.0
    for i in range(A):
        for j in range(B):
            total += abs(joint[i, j] - joint[i, B] * joint[A, j])
    return total / 2


@njit(cache=True)
def split(w: Array, table: Array, group: Array, r: Array, dependence: float) -> Array:
    """Groups (T,) in which all tracks depend on each other; see the definition."""
    (K, C), T = w.shape, len(group)
    order, start = members(group, C)
    choice, existence = np.empty((T, K), np.int64), np.empty((T, K))
    number, count = np.empty(len(r), np.int64), np.empty(T, np.int64)
    for l in range(len(r)):
        number[l] = 0
    above, found, names = np.empty(T, np.int64), np.empty(T, np.int64), np.empty(T, np.int64)
    for t in range(T):
        above[t], found[t], count[t] = t, -1, 1
    here = np.empty(T, np.int64)
    for c in range(C):
        n, most, G = 0, 1, _count(w, c)
        if start[c + 1] - start[c] == 1:
            continue
        for a in range(start[c], start[c + 1]):
            t, some = order[a], False
            for g in range(G):
                l = table[g, t]
                some = some or l != table[0, t]
                choice[t, g], existence[t, g] = 0, 0.0
                if l < 0:
                    continue
                if number[l] == 0:
                    number[l] = count[t]
                    count[t] += 1
                choice[t, g], existence[t, g] = number[l], r[l]
            if some:
                here[n] = t
                n, most = n + 1, max(most, count[t])
        joint = np.empty((most + 1, most + 1))
        for i in range(n):
            for j in range(i):
                t, u = here[i], here[j]
                if _root(above, t) != _root(above, u):
                    law = _variation(w, c, choice, existence, t, u, joint, count[t], count[u])
                    if law > dependence:
                        above[_root(above, t)] = _root(above, u)
    new = 0
    for t in range(T):
        root = _root(above, t)
        if found[root] < 0:
            found[root] = new
            new += 1
        names[t] = found[root]
    return names


@njit(cache=True)
def distinct(w: Array, table: Array, group: Array) -> tuple[Array, Array]:
    """The distinct hypotheses of each group by falling weight; see the definition."""
    K, C = w.shape
    order, start = members(group, C)
    row_out, w_out, size = np.empty((K, C), np.int64), np.empty((K, C)), 1
    key, one, total = np.empty(K, np.int64), np.empty(K, np.int64), np.empty(K)
    for c in range(C):
        kept = 0
        for g in range(K):
            row_out[g, c], w_out[g, c], total[g] = -1, 0.0, -1.0
            if w[g, c] <= 0:
                continue
            code = 1469598103934665603
            for a in range(start[c], start[c + 1]):
                code = (code ^ (table[g, order[a]] + 1)) * 1099511628211
            same = -1
            for s in range(kept):
                if key[s] == code:
                    equal = True
                    for a in range(start[c], start[c + 1]):
                        equal = equal and table[one[s], order[a]] == table[g, order[a]]
                    if equal:
                        same = s
                        break
            if same < 0:
                key[kept], one[kept], total[kept] = code, g, w[g, c]
                kept += 1
            else:
                total[same] += w[g, c]
                if w[g, c] > w[one[same], c]:
                    one[same] = g
        best = falling(total)
        for s in range(kept):
            row_out[s, c], w_out[s, c] = one[best[s]], total[best[s]]
        size = max(size, kept)
    return row_out[:size], w_out[:size]

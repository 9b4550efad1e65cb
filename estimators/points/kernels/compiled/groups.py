"""Compiled twins of :mod:`echoset.estimators.points.kernels.groups`."""

from __future__ import annotations

import numpy as np
from numba import njit

from .....models.records import Array
from .association import _root
from .murty import k_best


@njit(cache=True)
def members(group: Array, C: int) -> tuple[Array, Array]:
    """The indices (n,) by group, those of -1 left out; see the definition."""
    start = np.zeros(C + 1, np.int64)
    for i in range(len(group)):
        if group[i] >= 0:
            start[group[i] + 1] += 1
    for c in range(C):
        start[c + 1] += start[c]
    place, order = start.copy(), np.empty(start[C], np.int64)
    for i in range(len(group)):
        if group[i] >= 0:
            order[place[group[i]]] = i
            place[group[i]] += 1
    return order, start


@njit(cache=True)
def together(group: Array, detection: Array, C: int, n: int) -> tuple[Array, Array]:
    """Which groups become one, and whose detections are; see the definition."""
    above = np.arange(C + n)
    for p in range(len(group)):
        above[_root(above, C + detection[p])] = _root(above, group[p])
    number, into, of = np.full(C + n, -1), np.empty(C, np.int64), np.empty(n, np.int64)
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


@njit(cache=True)
def join(w: Array, into: Array, k: int, gap: float) -> tuple[Array, Array, Array]:
    """The hypotheses of groups that become one; see the definition."""
    K, C = w.shape
    count = np.zeros(C, np.int64)
    for c in range(C):
        while count[c] < K and w[count[c], c] > 0:
            count[c] += 1
    new = 0
    for c in range(C):
        new = max(new, into[c] + 1)
    order, start = members(into, new)
    most = max(k, K)
    row, w_new, size = np.full((most, C), -1), np.zeros((most, new)), 1
    share = np.zeros(new)
    for c in range(new):
        some = order[start[c] : start[c + 1]]
        n = count[some[0]]
        weight = w[:n, some[0]].copy()
        row[:n, some[0]] = np.arange(n)
        for at in range(1, len(some)):
            g = some[at]
            u = count[g]
            product = np.empty(n * u)
            for i in range(n):
                for j in range(u):
                    product[i * u + j] = weight[i] * w[j, g]
            best = np.argsort(-product, kind="mergesort")[: max(k, u, n)]
            least, kept = product[best[0]] * np.exp(-gap), 0
            while kept < len(best) and product[best[kept]] >= least:
                kept += 1
            before = row[:n].copy()
            weight = product[best[:kept]]
            for i in range(kept):
                for b in range(at):
                    row[i, some[b]] = before[best[i] // u, some[b]]
                row[i, g] = best[i] % u
            for i in range(kept, n):
                for b in range(at):
                    row[i, some[b]] = -1
            n = kept
        for i in range(n):
            share[c] += weight[i]
        for i in range(n):
            w_new[i, c] = weight[i] / share[c]
        size = max(size, n)
    return row[:size], w_new[:size], share


@njit(cache=True)
def _k_best_of_one(costs: Array, k: int, gap: float) -> tuple[Array, Array, Array]:
    """:func:`k_best` where there is one row, which may have any column."""
    G, _, m = costs.shape
    flat = np.empty(G * m)
    for g in range(G):
        flat[g * m : (g + 1) * m] = costs[g, 0]
    order, size = np.argsort(flat, kind="mergesort"), 0
    while size < min(k, G * m) and flat[order[size]] <= flat[order[0]] + gap:
        if flat[order[size]] == np.inf:
            break
        size += 1
    row, column, cost = np.empty(size, np.int64), np.empty((size, 1), np.int64), np.empty(size)
    for s in range(size):
        row[s], column[s, 0], cost[s] = order[s] // m, order[s] % m, flat[order[s]]
    return row, column, cost


@njit(cache=True)
def taken(values: Array, row: Array, column: Array, none: int) -> Array:
    """Entries (G', n) of values (G, n), of the ``row`` (G', C) that goes for each ``column`` (n,).

    It is ``none`` where there is no row: -1.
    """
    out = np.full((len(row), len(column)), none)
    for g in range(len(row)):
        for j in range(len(column)):
            from_ = row[g, column[j]]
            if from_ >= 0:
                out[g, j] = values[from_, j]
    return out


@njit(cache=True)
def best(
    w: Array, table: Array, group: Array, gain: Array, miss: Array, of: Array, k: int, gap: float
) -> tuple[Array, Array, Array]:
    """The ``k`` best associations of each group; see the definition."""
    K, C = w.shape
    T, most = len(group), max(k, K)
    cost_out, row_out = np.full((most, C), np.inf), np.full((most, C), -1)
    detection_out, size = np.full((most, T), -1), 1
    tracks, first = members(group, C)
    seen, begin = members(of, C)
    for c in range(C):
        here, those = tracks[first[c] : first[c + 1]], seen[begin[c] : begin[c + 1]]
        n, G = len(those), 0
        while G < K and w[G, c] > 0:
            G += 1
        before, is_active = np.empty(G), np.zeros(len(here), np.bool_)
        for g in range(G):
            before[g] = np.log(w[g, c])
            for a in range(len(here)):
                l = table[g, here[a]]
                before[g] += miss[l]
                for i in those:
                    if gain[l, i] > -np.inf:
                        is_active[a] = True
                        break
        active = here[is_active]
        m = len(active)
        if m == 0:
            order = np.argsort(-before, kind="mergesort")
            for s in range(G):
                cost_out[s, c], row_out[s, c] = -before[order[s]], order[s]
            size = max(size, G)
            continue
        costs = np.full((G, m, n + m), np.inf)
        for g in range(G):
            for a in range(m):
                l = table[g, active[a]]
                shift = before[g] if a == 0 else 0.0
                for i in range(n):
                    costs[g, a, i] = -gain[l, those[i]] - shift
                costs[g, a, n + a] = -shift
        row, column, cost = _k_best_of_one(costs, k, gap) if m == 1 else k_best(costs, k, gap)
        for s in range(len(cost)):
            cost_out[s, c], row_out[s, c] = cost[s], row[s]
            for a in range(m):
                if column[s, a] < n:
                    detection_out[s, active[a]] = those[column[s, a]]
        size = max(size, len(cost))
    return cost_out[:size], row_out[:size], detection_out[:size]


@njit(cache=True)
def _variation(
    w: Array, a: Array, b: Array, p: Array, q: Array, joint: Array, A: int, B: int
) -> float:
    """Total variation of the law of two tracks from the product of that of each."""
    joint[:A, :B] = 0.0
    for g in range(len(w)):
        joint[a[g], b[g]] += w[g] * p[g] * q[g]
        joint[a[g], 0] += w[g] * p[g] * (1 - q[g])
        joint[0, b[g]] += w[g] * (1 - p[g]) * q[g]
        joint[0, 0] += w[g] * (1 - p[g]) * (1 - q[g])
    total = 0.0
    column = np.zeros(B)
    for i in range(A):
        for j in range(B):
            column[j] += joint[i, j]
    for i in range(A):
        row = 0.0
        for j in range(B):
            row += joint[i, j]
        for j in range(B):
            total += abs(joint[i, j] - row * column[j])
    return total / 2


@njit(cache=True)
def split(w: Array, table: Array, group: Array, r: Array, dependence: float) -> Array:
    """Groups (T,) in which all tracks depend on each other; see the definition."""
    K, C = w.shape
    order, start = members(group, C)
    above = np.arange(len(group))
    choice, existence = np.zeros((len(group), K), np.int64), np.zeros((len(group), K))
    number, count = np.zeros(len(r), np.int64), np.ones(len(group), np.int64)
    for c in range(C):
        G = 0
        while G < K and w[G, c] > 0:
            G += 1
        here = order[start[c] : start[c + 1]]
        if len(here) == 1:
            continue
        some = np.zeros(len(here), np.bool_)
        for a in range(len(here)):
            t = here[a]
            for g in range(G):
                l = table[g, t]
                some[a] = some[a] or l != table[0, t]
                if l < 0:
                    continue
                if number[l] == 0:
                    number[l] = count[t]
                    count[t] += 1
                choice[t, g], existence[t, g] = number[l], r[l]
        here, most = here[some], 1
        for t in here:
            most = max(most, count[t])
        joint = np.empty((most, most))
        for i in range(len(here)):
            for j in range(i):
                t, u = here[i], here[j]
                if _root(above, t) == _root(above, u):
                    continue
                law = _variation(
                    w[:G, c], choice[t], choice[u], existence[t], existence[u], joint,
                    count[t], count[u],
                )  # fmt: skip
                if law > dependence:
                    above[_root(above, t)] = _root(above, u)
    found, names = np.full(len(group), -1), np.empty(len(group), np.int64)
    new = 0
    for t in range(len(group)):
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
    row_out, w_out, size = np.full((K, C), -1), np.zeros((K, C)), 1
    key, one, total = np.empty(K, np.uint64), np.empty(K, np.int64), np.empty(K)
    for c in range(C):
        here, kept = order[start[c] : start[c + 1]], 0
        for g in range(K):
            if w[g, c] <= 0:
                continue
            code = np.uint64(1469598103934665603)
            for t in here:
                code = (code ^ np.uint64(table[g, t] + 1)) * np.uint64(1099511628211)
            same = -1
            for s in range(kept):
                if key[s] == code:
                    equal = True
                    for t in here:
                        equal = equal and table[one[s], t] == table[g, t]
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
        best = np.argsort(-total[:kept], kind="mergesort")
        for s in range(kept):
            row_out[s, c], w_out[s, c] = one[best[s]], total[best[s]]
        size = max(size, kept)
    return row_out[:size], w_out[:size]

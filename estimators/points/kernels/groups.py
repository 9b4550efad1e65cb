"""Groups of tracks that are independent of each other, each with hypotheses of its own.

Tracks that may have made the same detection come into one group, whose hypotheses are the likeliest
pairs of those of both; tracks that depend on each other no more part. What is kept then grows with
the sum over groups, not with their product. D. B. Reid, "An algorithm for tracking multiple
targets", IEEE Trans. Autom. Control 24 (1979) 843-854, section III; T. Kurien, "Issues in the
design of practical multitarget tracking algorithms", in Multitarget-Multisensor Tracking, 1990.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ....models.records import Array
from .compiled.association import marginals
from .murty import k_best

SHARE = 0.5
"""Least share of the probability of what groups do together that the hypotheses kept must have."""
OVER = 0.5
"""Weight of the last of the hypotheses that are kept, of that of the best, from which on what is
not kept matters as well."""
OVER_MANY = 0.005
"""The same of a group with more than :data:`MANY` tracks, each of whose doubts multiplies them."""
MANY = 10
MOST = 40
"""Tracks of a group, from which on no number of hypotheses tells what matters."""


def members(group: Array, C: int) -> tuple[Array, Array]:
    """The indices (n,) by ``group`` (n,), those of -1 left out, and where (C + 1,) each begins."""
    order = np.argsort(group, kind="stable")
    start = np.searchsorted(group[order], np.arange(C + 1))
    return order, start


def together(group: Array, detection: Array, C: int, n: int) -> tuple[Array, Array]:
    """Which groups become one, by pairs (k,) of ``group`` and ``detection`` that may belong.

    Returned are for each of C groups the one that it goes ``into`` (C,), numbered as they come, and
    of which of these each of n detections is, -1 for none.
    """
    graph = coo_array((np.ones(len(group)), (group, C + detection)), (C + n, C + n))
    part = connected_components(graph, directed=False)[1]
    numbers, into = np.unique(part[:C], return_inverse=True)
    first = np.argsort(np.argsort([np.flatnonzero(part[:C] == p)[0] for p in numbers]))
    into = first[into] if C else into
    of = dict(zip(part[:C].tolist(), into.tolist(), strict=True))
    return into, np.array([of.get(p, -1) for p in part[C:].tolist()], np.int64)


def join(w: Array, into: Array, k: int, gap: float) -> tuple[Array, Array, Array]:
    """The hypotheses of groups with weights w (K, C) that go ``into`` (C,) others.

    Of each pair that which weighs most, at most ``k`` and within ``gap`` in log weight of the best.

    Returns
    -------
    row (K', C) : which hypothesis of each old group a new one is made of, -1 beyond the last
    w (K', C')
    share (C',) : probability of what is kept
    """
    joined, share = [], []
    for c in range(into.max(initial=-1) + 1):
        first, *others = np.flatnonzero(into == c)
        weight = w[w[:, first] > 0, first]
        rows = np.arange(len(weight))[:, None]
        for g in others:
            u = w[w[:, g] > 0, g]
            product = (weight[:, None] * u).ravel()
            best = np.argsort(-product, kind="stable")[: max(k, len(u), len(weight))]
            best = best[product[best] >= product[best[0]] * np.exp(-gap)]
            i, j = np.divmod(best, len(u))
            weight, rows = product[best], np.column_stack((rows[i], j))
        joined.append((weight / weight.sum(), rows))
        share.append(weight.sum())
    most = max((len(weight) for weight, _ in joined), default=1)
    row, w_new = np.full((most, len(into)), -1), np.zeros((most, len(joined)))
    for c, (weight, rows) in enumerate(joined):
        row[: len(rows), into == c] = rows
        w_new[: len(weight), c] = weight
    return row, w_new, np.array(share)


def taken(values: Array, row: Array, column: Array, none: int) -> Array:
    """Entries (G', n) of values (G, n), of the ``row`` (G', C) that goes for each ``column`` (n,).

    It is ``none`` where there is no row: -1.
    """
    each = row.take(column, axis=1)
    found = np.take_along_axis(values, np.maximum(each, 0), 0)
    return np.where(each >= 0, found, none)


def best(
    w: Array, table: Array, group: Array, gain: Array, miss: Array, of: Array, k: int, gap: float
) -> tuple[Array, Array, Array]:
    """The ``k`` best associations of each group over all its hypotheses.

    Parameters
    ----------
    w (K, C), table (K, T), group (T,) : of a mixture
    gain (L + 1, M) : log odds of each Bernoulli being detected as that detection against being
        missed and it being of none, -inf for what is not possible; last that of an absent track
    miss (L + 1,) : log probability that a Bernoulli is missed; last 0
    of (M,) : group of each detection, -1 for none
    k, gap : how many are kept, and how far in log weight below the best one

    Returns
    -------
    cost (K', C), infinite beyond the last, row (K', C) before, detection (K', T), -1 for a miss
    """
    found = []
    for c in range(w.shape[1]):
        tracks, seen = np.flatnonzero(group == c), np.flatnonzero(of == c)
        rows = table[w[:, c] > 0][:, tracks]
        before = np.log(w[w[:, c] > 0, c]) + miss[rows].sum(1)
        pairs = gain[rows][:, :, seen]
        active = np.flatnonzero((pairs > -np.inf).any((0, 2)))
        n, T = len(seen), len(active)
        if not T:
            order = np.argsort(-before, kind="stable")
            found.append((tracks, -before[order], order, np.full((len(order), len(tracks)), -1)))
            continue
        costs = np.full((len(rows), T, n + T), np.inf)
        costs[:, :, :n] = -pairs[:, active]
        costs[:, np.arange(T), n + np.arange(T)] = 0.0
        costs[:, 0] -= before[:, None]
        row, column, cost = k_best(costs, k, gap)
        detection = np.full((len(row), len(tracks)), -1)
        detection[:, active] = np.append(seen, np.full(T, -1))[column]
        found.append((tracks, cost, row, detection))
    most = max((len(cost) for _, cost, _, _ in found), default=1)
    cost_out, row_out = np.full((most, len(found)), np.inf), np.full((most, len(found)), -1)
    detection_out = np.full((most, len(group)), -1)
    for c, (tracks, cost, row, detection) in enumerate(found):
        cost_out[: len(cost), c], row_out[: len(row), c] = cost, row
        detection_out[: len(row), tracks] = detection
    return cost_out, row_out, detection_out


def marginal(
    w: Array, table: Array, gain: Array, miss: Array, seen: Array, k: int, gap: float
) -> tuple[list[tuple[Array, Array, Array]], Array]:
    """Associations of each of T tracks by itself, where those of all are too many to be told.

    By belief propagation, each track as in all hypotheses of its group, of w (G, T), together.
    ``gain`` and ``miss`` are as in :func:`best`, with the detections ``seen`` (n,).

    Returns
    -------
    for each track the cost, the row before and the detection, -1 for a miss, of what may be
    taken (n,) : probability that one of the tracks made the detection
    """
    T, n = table.shape[1], len(seen)
    prior, pairs = [], []
    for t in range(T):
        l, first, which = np.unique(table[:, t], return_index=True, return_inverse=True)
        weight = np.bincount(which.ravel(), w[:, t], len(l))
        missed = weight * np.exp(miss[l])
        hit = missed[:, None] * np.exp(gain[l][:, seen])
        prior.append((first, missed, hit))
        pairs.append(hit.sum(0) / missed.sum())
    odds = np.array(pairs).reshape(T, n)
    target, detection = np.nonzero(odds)
    chance = np.zeros((T, n))
    some, none = marginals(target, detection, odds[target, detection], T, n)
    chance[target, detection] = some
    found = []
    for t, (first, missed, hit) in enumerate(prior):
        share = chance[t] * hit / np.maximum(hit.sum(0), 1e-300)
        law = np.column_stack((none[t] * missed / missed.sum(), share)).ravel()
        order = np.argsort(-law, kind="stable")[:k]
        order = order[law[order] > law[order[0]] * np.exp(-gap)]
        row, column = np.divmod(order, n + 1)
        found.append((-np.log(law[order]), first[row], np.append(-1, seen)[column]))
    return found, np.minimum(chance.sum(0), 1.0)


def split(w: Array, table: Array, group: Array, r: Array, dependence: float) -> Array:
    """Groups (T,), numbered as they come, in which all tracks depend on each other.

    Two tracks depend on each other if the law of both, as which Bernoulli each exists or that it
    does not, is farther than ``dependence`` from the product of that of each: in total variation.
    """
    T = len(group)
    r = np.append(r, 0.0)
    linked = np.zeros((T, T))
    for t in range(T):
        for u in np.flatnonzero(group[:t] == group[t]):
            weight = w[:, group[t]]
            (a, i), (b, j) = (np.unique(table[:, x], return_inverse=True) for x in (t, u))
            joint = np.zeros((len(a) + 1, len(b) + 1))
            p, q = r[table[:, t]], r[table[:, u]]
            np.add.at(joint, (i + 1, j + 1), weight * p * q)
            np.add.at(joint[:, 0], i + 1, weight * p * (1 - q))
            np.add.at(joint[0], j + 1, weight * (1 - p) * q)
            joint[0, 0] = weight @ ((1 - p) * (1 - q))
            product = joint.sum(1)[:, None] * joint.sum(0)
            linked[t, u] = 0.5 * np.abs(joint - product).sum() > dependence
    one, other = np.nonzero(linked + np.eye(T))
    return together(one, other, T, T)[0]


def distinct(w: Array, table: Array, group: Array) -> tuple[Array, Array]:
    """The distinct hypotheses of each group by falling weight, each as its weightiest.

    Returns
    -------
    row (K', C), -1 beyond the last, and w (K', C)
    """
    found = []
    for c in range(w.shape[1]):
        kept = np.flatnonzero(w[:, c] > 0)
        rows = table[kept][:, group == c]
        _, first, same = np.unique(rows, axis=0, return_index=True, return_inverse=True)
        same, total = same.ravel(), np.bincount(same.ravel(), w[kept, c], len(first))
        weight = w[kept, c]
        heaviest = [np.where(same == s, weight, 0.0).argmax() for s in range(len(first))]
        order = np.lexsort((first, -total))
        found.append((kept[np.array(heaviest, np.int64)[order]], total[order]))
    most = max((len(row) for row, _ in found), default=1)
    row_out, w_out = np.full((most, len(found)), -1), np.zeros((most, len(found)))
    for c, (row, total) in enumerate(found):
        row_out[: len(row), c], w_out[: len(row), c] = row, total
    return row_out, w_out

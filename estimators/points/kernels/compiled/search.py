"""Compiled twin of :mod:`..search`, and moves on sets of trajectories by Metropolis and Hastings.

A move picks one trajectory or two that are near each other, and a span of looks. It frees what they
take there, and draws anew, look by look, from what the filter would give each detection and the
miss; two may go on as each other after the span. Trajectories so begin, end, grow, shrink, split,
merge and change their tails. S. Oh, S. Russell and S. Sastry, "Markov chain Monte Carlo data
association for multi-target tracking", IEEE Trans. Autom. Control 54 (2009) 481-497, has these
moves one by one, with proposals that know no densities.
"""

from __future__ import annotations

from math import atan2, exp, hypot, inf, log, pi
from typing import NamedTuple

import numpy as np
from numba import njit

from .....models.records import Array
from ..search import OFF, TINY, Batch, Way

LEAST = 1e-4
"""Existence below which nothing more is drawn for a trajectory."""
GATE = 25.0
"""Squared distance beyond which no detection is drawn."""
PAIRS, TO_END = 0.6, 0.2
"""Share of moves with two trajectories, and of those whose span goes on to the end."""
FIRST = 8
"""Numbers of a move beside those of its span."""
LITTLE = 1e-9
REACH = 16.0
"""Squared distance, in units of the spread of both, up to which trajectories are near."""


class Ways(NamedTuple):
    """Trajectories as a :class:`..search.Way` each, in T places, free where nothing is taken.

    ``size`` (T,) is the number of detections of each; ``owner`` (N,) the place of the trajectory
    that takes a detection, or -1.
    """

    taken: Array
    gain: Array
    r: Array
    v: Array
    m: Array
    P: Array
    size: Array
    owner: Array


@njit(cache=True)
def _seen(pose: Array, sector: Array, s: int, m: Array) -> bool:
    dx, dy = m[0] - pose[s, 0], m[1] - pose[s, 1]
    distance = hypot(dx, dy)
    if distance < sector[s, 2] or distance > sector[s, 3]:
        return False
    if sector[s, 1] >= 2 * pi:
        return True
    c, q = pose[s, 2], pose[s, 3]
    turn = (atan2(c * dy - q * dx, c * dx + q * dy) - sector[s, 0]) % (2 * pi)
    return bool(turn <= sector[s, 1])


@njit(cache=True)
def _move(F: Array, Q: Array, s: int, m: Array, P: Array, work: Array) -> None:
    """Move a mean (dx,) and a covariance to a look."""
    d = len(m)
    for i in range(d):
        t = 0.0
        for k in range(d):
            t += F[s, i, k] * m[k]
        work[0, i] = t
    for i in range(d):
        m[i] = work[0, i]
    for i in range(d):
        for j in range(d):
            t = 0.0
            for k in range(d):
                t += F[s, i, k] * P[k, j]
            work[i, j] = t
    for i in range(d):
        for j in range(i + 1):
            t = Q[s, i, j]
            for k in range(d):
                t += work[i, k] * F[s, j, k]
            P[i, j] = P[j, i] = t


@njit(cache=True)
def _age(survive: float, keep: float, settled: float, scene: Array, a: Array, m: Array) -> None:
    """Existence and visibility a (2,) of who is at a mean before it moves."""
    out = m[0] < scene[0] or m[0] > scene[1] or m[1] < scene[2] or m[1] > scene[3]
    a[0] *= 0.0 if out else survive
    a[1] = settled + (a[1] - settled) * keep


@njit(cache=True)
def _log_l(z: Array, R: Array, i: int, m: Array, P: Array, gate: float) -> float:
    """Log density of a detection, -inf outside the gate."""
    a, b, c = P[0, 0] + R[i, 0, 0], P[0, 1] + R[i, 0, 1], P[1, 1] + R[i, 1, 1]
    x, y = z[i, 0] - m[0], z[i, 1] - m[1]
    # The ellipse lies in a box.
    if x * x > gate * a or y * y > gate * c:
        return -inf
    det = a * c - b * b
    d2 = (c * x * x - 2 * b * x * y + a * y * y) / det
    return float(-inf if d2 > gate else -0.5 * (d2 + log(det)) - log(2 * pi))


@njit(cache=True)
def _hit(z: Array, R: Array, i: int, a: Array, m: Array, P: Array, work: Array) -> None:
    """Update by a detection."""
    d = len(m)
    p, q, r = P[0, 0] + R[i, 0, 0], P[0, 1] + R[i, 0, 1], P[1, 1] + R[i, 1, 1]
    det = p * r - q * q
    x, y = z[i, 0] - m[0], z[i, 1] - m[1]
    for j in range(d):
        work[0, j], work[1, j] = P[0, j], P[1, j]
    for j in range(d):
        k0 = (work[0, j] * r - work[1, j] * q) / det
        k1 = (work[1, j] * p - work[0, j] * q) / det
        m[j] += k0 * x + k1 * y
        for k in range(j + 1):
            P[j, k] -= k0 * work[0, k] + k1 * work[1, k]
            P[k, j] = P[j, k]
    a[0] = a[1] = 1.0


@njit(cache=True)
def _begin(mean: Array, spread: Array, i: int, a: Array, m: Array, P: Array) -> None:
    """A trajectory after its first detection."""
    a[0] = a[1] = 1.0
    for j in range(len(m)):
        m[j] = mean[i, j]
        for k in range(len(m)):
            P[j, k] = spread[i, j, k]


@njit(cache=True)
def _miss(p: float, a: Array) -> float:
    """Update by a miss, and its weight."""
    none = float(max(1 - a[0] * a[1] * p, TINY))
    a[0] *= (1 - a[1] * p) / none
    a[1] *= (1 - p) / max(1 - a[1] * p, TINY)
    return none


@njit(cache=True)
def _before(way: Way, s: int, a: Array, m: Array, P: Array) -> None:
    """What is known before a look."""
    a[0] = OFF
    if s > 0 and way.r[s - 1] != OFF:
        a[0], a[1] = way.r[s - 1], way.v[s - 1]
        m[:] = way.m[s - 1]
        P[:] = way.P[s - 1]


@njit(cache=True)
def _kept(m_all: Array, P_all: Array, s: int, m: Array, P: Array) -> None:
    for j in range(len(m)):
        m_all[s, j] = m[j]
        for k in range(len(m)):
            P_all[s, j, k] = P[j, k]


@njit(cache=True)
def follow(batch: Batch, taken: Array, start: int, way: Way) -> float:
    """The ``way`` from a look on by what it has ``taken`` (S,); the sum of what it gains."""
    F, Q, z, R, scene, settled = batch.F, batch.Q, batch.z, batch.R, batch.scene, batch.settled
    survive, keep, p_detect = batch.survive, batch.keep, batch.p_detect
    pose, sector, clutter, new = batch.pose, batch.sector, batch.log_clutter, batch.log_new
    mean, spread = batch.m, batch.P
    own, gains, r, v, m_all, P_all = way
    d = F.shape[1]
    a, m, P, work = np.empty(2), np.zeros(d), np.zeros((d, d)), np.empty((d, d))
    _before(way, start, a, m, P)
    total = 0.0
    for s in range(start, len(taken)):
        i, gain = taken[s], 0.0
        if a[0] == OFF:
            if i >= 0:
                gain = new[i] - clutter[i]
                _begin(mean, spread, i, a, m, P)
        else:
            _age(survive[s], keep[s], settled, scene, a, m)
            _move(F, Q, s, m, P, work)
            p = p_detect[s] if _seen(pose, sector, s, m) else 0.0
            if i < 0:
                gain = log(_miss(p, a))
            else:
                odds = a[0] * a[1] * p
                gain = -inf
                if odds > 0:
                    gain = log(odds) + _log_l(z, R, i, m, P, inf) - clutter[i]
                _hit(z, R, i, a, m, P, work)
        total += gain
        own[s], gains[s], r[s], v[s] = i, gain, a[0], a[1]
        _kept(m_all, P_all, s, m, P)
    return total


@njit(cache=True)
def weigh(batch: Batch, taken: Array) -> Way:
    """The trajectory that made the detections ``taken`` (S,); see the definition."""
    S, d = len(taken), batch.F.shape[1]
    way = Way(np.full(S, -1), np.zeros(S), np.full(S, OFF), np.ones(S), np.zeros((S, d)),
              np.zeros((S, d, d)))  # fmt: skip
    follow(batch, taken, 0, way)
    return way


@njit(cache=True)
def _drawn(
    batch: Batch, owner: Array, taken: Array, start: int, stop: int, way: Way, U: Array, at: int,
    draws: bool,
) -> float:  # fmt: skip
    """Log probability of what is drawn for a way from look to look, or would be of ``taken``.

    Of the detections that are nobody's, which it takes. Uniform numbers are U[at:].
    """
    F, Q, z, R, scene, settled = batch.F, batch.Q, batch.z, batch.R, batch.scene, batch.settled
    survive, keep, p_detect, offset = batch.survive, batch.keep, batch.p_detect, batch.offset
    pose, sector, clutter, new = batch.pose, batch.sector, batch.log_clutter, batch.log_new
    mean, spread = batch.m, batch.P
    own, gains, r, v, m_all, P_all = way
    d = F.shape[1]
    a, m, P, work = np.empty(2), np.zeros(d), np.zeros((d, d)), np.empty((d, d))
    _before(way, start, a, m, P)
    log_q = 0.0
    most = 0
    for s in range(start, stop):
        most = max(most, offset[s + 1] - offset[s])
    w = np.empty(most)
    for s in range(start, stop):
        first, n = offset[s], offset[s + 1] - offset[s]
        off = a[0] == OFF
        p = 0.0
        if not off:
            _age(survive[s], keep[s], settled, scene, a, m)
            _move(F, Q, s, m, P, work)
            p = p_detect[s] if _seen(pose, sector, s, m) else 0.0
        odds = a[0] * a[1] * p
        none = 1.0 if off else max(1 - odds, TINY)
        total = none
        idle = not off and (a[0] < LEAST or p == 0)
        for k in range(n):
            i, w[k] = first + k, 0.0
            if owner[i] >= 0 or idle:
                continue
            log_w = new[i] if off else _log_l(z, R, i, m, P, GATE)
            if log_w > -inf:
                w[k] = (1.0 if off else odds) * exp(log_w - clutter[i])
                total += w[k]
        i = taken[s]
        if draws:
            i, u = -1, U[at + s - start] * total - none
            for k in range(n):
                if u < 0:
                    break
                if w[k] > 0:
                    i = first + k
                    u -= w[k]
        share = (none if i < 0 else w[i - first]) / total
        if share <= 0:
            return -inf
        log_q += log(share)
        gain = 0.0
        if i < 0:
            if not off:
                gain = log(_miss(p, a))
        else:
            gain = log(w[i - first])
            if off:
                _begin(mean, spread, i, a, m, P)
            else:
                _hit(z, R, i, a, m, P, work)
            owner[i] = 0
        if draws:
            own[s], gains[s], r[s], v[s] = i, gain, a[0], a[1]
            _kept(m_all, P_all, s, m, P)
    return log_q


@njit(cache=True)
def _way(ways: Ways, t: int) -> Way:
    return Way(ways.taken[t], ways.gain[t], ways.r[t], ways.v[t], ways.m[t], ways.P[t])


@njit(cache=True)
def _copied(into: Way, way: Way, start: int) -> None:
    into.taken[start:] = way.taken[start:]
    into.gain[start:] = way.gain[start:]
    into.r[start:] = way.r[start:]
    into.v[start:] = way.v[start:]
    into.m[start:] = way.m[start:]
    into.P[start:] = way.P[start:]


@njit(cache=True)
def _near(batch: Batch, a: Way, b: Way, start: int, stop: int) -> bool:
    """Whether two may have made the same detections of a span, as far as is known before it.

    Or where ``b`` begins in the span, what it began with.
    """
    if start == 0 or a.r[start - 1] == OFF:
        return False
    s = start - 1
    x, y, spread = a.m[s, 0], a.m[s, 1], a.P[s, 0, 0] + a.P[s, 1, 1]
    if b.r[s] == OFF:
        while s < stop and b.r[s] == OFF:
            s += 1
        if s == stop:
            return False
        for k in range(start, s + 1):
            x += batch.F[k, 0, 2] * a.m[start - 1, 2]
            y += batch.F[k, 1, 3] * a.m[start - 1, 3]
            spread += batch.F[k, 0, 2] ** 2 * (a.P[start - 1, 2, 2] + a.P[start - 1, 3, 3])
    spread += b.P[s, 0, 0] + b.P[s, 1, 1]
    return bool((b.m[s, 0] - x) ** 2 + (b.m[s, 1] - y) ** 2 < REACH * spread)


@njit(cache=True)
def _partners(batch: Batch, ways: Ways, t: int, start: int, stop: int, but: int, out: Array) -> int:
    """How many others than ``but`` are near, which are put into ``out``."""
    n = 0
    for other in range(len(ways.size)):
        if other in (t, but) or ways.size[other] == 0:
            continue
        if _near(batch, _way(ways, t), _way(ways, other), start, stop):
            out[n] = other
            n += 1
    return n


@njit(cache=True)
def _owned(owner: Array, taken: Array, start: int, stop: int, by: int) -> None:
    """Make what is taken in a span somebody's, or for -1 nobody's."""
    for s in range(start, stop):
        if taken[s] >= 0:
            owner[taken[s]] = by


@njit(cache=True)
def _redrawn(
    batch: Batch, owner: Array, way: Way, new: Way, start: int, stop: int, U: Array, at: int
) -> float:
    """Log probability of what is drawn for a way in a span, into ``new``."""
    if start > 0:
        k = start - 1
        new.r[k], new.v[k], new.m[k], new.P[k] = way.r[k], way.v[k], way.m[k], way.P[k]
    return _drawn(batch, owner, way.taken, start, stop, new, U, at, True)


@njit(cache=True)
def _tried(
    batch: Batch, ways: Ways, spare: Ways, t: int, other: int, swap: bool, start: int, stop: int,
    U: Array, at: int,
) -> tuple[float, float]:  # fmt: skip
    """Draw a span of one trajectory or two anew (``other`` -1: of one), into ``spare``.

    Returned are by how much that changes the log weight, and the log ratio of the probabilities of
    the way back and of this one. Nobody has the detections of either in the span afterwards.
    """
    owner, a, one = ways.owner, _way(ways, t), _way(spare, 0)
    pair = other >= 0
    b, two = _way(ways, max(other, 0)), _way(spare, 1)
    _owned(owner, a.taken, start, stop, -1)
    if pair:
        _owned(owner, b.taken, start, stop, -1)
    ratio = _drawn(batch, owner, a.taken, start, stop, a, U, at, False)
    if pair:
        ratio += _drawn(batch, owner, b.taken, start, stop, b, U, at, False)
        _owned(owner, b.taken, start, stop, -1)
    _owned(owner, a.taken, start, stop, -1)
    if ratio == -inf:
        return -inf, ratio
    ratio -= _redrawn(batch, owner, a, one, start, stop, U, at)
    if pair:
        ratio -= _redrawn(batch, owner, b, two, start, stop, U, at + stop - start)
        _owned(owner, two.taken, start, stop, -1)
    _owned(owner, one.taken, start, stop, -1)
    change = follow(batch, b.taken if swap else a.taken, stop, one)
    change += one.gain[start:stop].sum() - a.gain[start:].sum()
    if pair:
        change += follow(batch, a.taken if swap else b.taken, stop, two)
        change += two.gain[start:stop].sum() - b.gain[start:].sum()
    return change, ratio


@njit(cache=True)
def _count(way: Way, new: Way, start: int) -> int:
    """Detections of a way that goes on as a new one."""
    return int((way.taken[:start] >= 0).sum() + (new.taken[start:] >= 0).sum())


@njit(cache=True)
def _free(ways: Ways, out: Array) -> tuple[int, int]:
    """How many trajectories there are, which are put into ``out``, and a free place, or -1."""
    n, slot = 0, -1
    for t in range(len(ways.size)):
        if ways.size[t] > 0:
            out[n] = t
            n += 1
        elif slot < 0:
            slot = t
    return n, slot


@njit(cache=True)
def _step(
    batch: Batch, ways: Ways, spare: Ways, slot: int, used: Array, n: int, near: Array,
    beta: float, U: Array, at: int,
) -> tuple[float, int]:  # fmt: skip
    """A move, by U[at:]: the change of the log weight, and how many numbers it took."""
    S = ways.taken.shape[1]
    pick = min(int(U[at] * (n + 1)), n)
    t = slot if pick == n else used[pick]
    if t < 0:
        return 0.0, FIRST
    start = min(int(U[at + 1] * S), S - 1)
    stop = S if U[at + 3] < TO_END else min(start + int(S ** U[at + 2]), S)
    begins, other, k = pick == n, -1, 0
    if not begins and U[at + 4] < PAIRS:
        k = _partners(batch, ways, t, start, stop, -1, near)
        pick = min(int(U[at + 5] * (k + 1)), k)
        other = slot if pick == k else near[pick]
        if other < 0:
            return 0.0, FIRST
    swap = other >= 0 and U[at + 6] < 0.5
    dice, at = U[at + 7], at + FIRST
    change, ratio = _tried(batch, ways, spare, t, other, swap, start, stop, U, at)
    a, one, two = _way(ways, t), _way(spare, 0), _way(spare, 1)
    b = _way(ways, max(other, 0))
    used_up = FIRST + (stop - start) * (1 if other < 0 else 2)
    accepted = change > -inf
    first = second = 0
    if accepted:
        first = _count(a, one, start)
        then = n - (not begins) + (first > 0)
        if other >= 0:
            second = _count(b, two, start)
            then += (second > 0) - (ways.size[other] > 0)
            others = _partners(batch, ways, t, start, stop, other, near)
            reached = second > 0 and _near(batch, a, two, start, stop)
            # Back, it has to be the first, and the second near it.
            accepted = first > 0 and (second == 0 or reached)
            ratio += log((k + 1) / (others + reached + 1))
        elif begins != (first == 0):
            ratio += log(1 - PAIRS) if begins else -log(1 - PAIRS)
        ratio += log((n + 1) / (then + 1))
        accepted = accepted and log(max(dice, TINY)) < beta * change + ratio
    if not accepted:
        change = 0.0
    else:
        if swap:
            _owned(ways.owner, a.taken, stop, S, other)
            _owned(ways.owner, b.taken, stop, S, t)
        _copied(a, one, start)
        ways.size[t] = first
        if other >= 0:
            _copied(b, two, start)
            ways.size[other] = second
    _owned(ways.owner, a.taken, start, stop, t)
    if other >= 0:
        _owned(ways.owner, b.taken, start, stop, other)
    return change, used_up


@njit(cache=True)
def moves(
    batch: Batch, ways: Ways, spare: Ways, best: Array, temperature: Array, U: Array
) -> tuple[float, int]:
    """Moves in place at the ``temperature`` (n,) of each, until these or U are used up.

    ``best`` (T, S) is to be what is taken by the likeliest set of all since the start; ``spare``
    has two places. Returned are its log weight beyond that at the start, and how many were made.
    """
    T, S = ways.taken.shape
    used, near = np.empty(T, np.int64), np.empty(T, np.int64)
    now = top = 0.0
    at = done = 0
    best[:] = ways.taken
    n, slot = _free(ways, used)
    while done < len(temperature) and at + FIRST + 2 * S <= len(U):
        change, numbers = _step(
            batch, ways, spare, slot, used, n, near, 1 / temperature[done], U, at
        )
        at, done = at + numbers, done + 1
        if change != 0:
            now += change
            n, slot = _free(ways, used)
            if now > top + LITTLE:
                top = now
                best[:] = ways.taken
    return top, done

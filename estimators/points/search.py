"""The likeliest set of trajectories, sought from what the filter kept: ``smooth: search``.

A filter that prunes and merges loses the best answer where targets meet or are missed for long. The
search begins with its trajectories and moves about by :mod:`.kernels.search` on the posterior of
all detections, ever colder, and keeps the likeliest set; its trajectories are filtered and smoothed
as if it were known who made which detection. Positions of polar detections are in the map for the
search, Doppler is left to the smoother, and views have a sharp border.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from ...models.errors import InputError
from ...models.records import Array
from ..kernels.passes import AROUND, Stack
from .kernels import paths
from .kernels.bernoulli import missed, newborn
from .kernels.compiled.search import Ways, moves, weigh
from .kernels.search import Batch
from .kernels.smoothing import Epoch
from .mbm_filter import Params
from .model.edge import unseen
from .model.measurement import innovations, log_likelihood, positions, updated
from .model.sensing import Look, SensorParams
from .model.targets import Interval, elapse
from .trails import Trail

EACH, LEAST = 200, 20_000
"""Moves of the search for each look and trajectory, and of all at least."""
HOT, COLD = 1.5, 0.5
"""Temperature of the first and the last move."""
ANYWHERE = 1e9
"""Variance of the state of who has not been detected yet."""
FAINT = -600.0
"""Log density of clutter where there is none."""
NUMBERS = 1 << 18
"""Uniform numbers that are drawn together."""
ROOM = 8
"""Places for trajectories beside those of the filter."""
LIKELY = 0.5
"""Least existence of these."""
GATE = 20.0
"""Squared distance of detections from the filter's trajectories that begin the search."""


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """A look, with the parameters of its sensor, and what its n detections are as first ones.

    ``density`` (n,), in their own measure, and moments m (n, dx), P (n, dx, dx).
    """

    look: Look
    own: SensorParams
    density: Array
    m: Array
    P: Array


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """The ``sights`` of a time, and the interval since the last."""

    time_ns: int
    gone: Interval
    sights: tuple[Sighting, ...]


def batch(moments: Sequence[Moment], params: Params) -> Batch:
    """All looks, those of one time one after the other.

    Raises
    ------
    InputError : detections have times of their own
    """
    rows, dx = [], params.width
    change = params.hide_rate + params.show_rate
    still = np.eye(dx), np.zeros((dx, dx)), 1.0, 1.0
    for x in moments:
        gone = x.gone
        since = gone.F, gone.Q, params.p_survive**gone.steps, float(np.exp(-change * gone.dt))
        for number, seen in enumerate(x.sights):
            rows.append((since if number == 0 else still, seen))
    looks = [seen.look for _, seen in rows]
    if any(look.parts for look in looks):
        raise InputError("smooth: search knows no time_offset of detections; use whole")
    where = [positions(look) for look in looks]
    # Of a polar density that in the map has the range less.
    area = [
        np.log(np.hypot(*(z - look.position).T)) if look.polar else np.zeros(len(z))
        for look, (z, _) in zip(looks, where, strict=True)
    ]
    with np.errstate(divide="ignore"):
        clutter = [np.log(look.clutter) - a for look, a in zip(looks, area, strict=True)]
        new = [np.log(seen.density) - a for (_, seen), a in zip(rows, area, strict=True)]
    v = [look.view for look in looks]
    F, Q, survive, keep = zip(*(since for since, _ in rows), strict=True)
    return Batch(
        np.array(F, float),
        np.array(Q, float),
        np.array(survive, float),
        np.array(keep, float),
        params.show_rate / change if change else 1.0,
        np.array(params.scene or (-np.inf, np.inf, -np.inf, np.inf), float),
        np.array([look.p_detect for look in looks], float),
        np.array([(*look.position, look.rotation[0, 0], look.rotation[1, 0]) for look in looks]),
        np.array([(o.azimuth_min, o.width, o.range_min, o.range_max) for o in v], float),
        np.cumsum([0, *(len(z) for z, _ in where)]),
        _together([z for z, _ in where]),
        _together([R for _, R in where]),
        np.maximum(_together(clutter), FAINT),
        _together(new),
        _together([seen.m for _, seen in rows]),
        _together([seen.P for _, seen in rows]),
    )


def _together(rows: Sequence[Array]) -> Array:
    """Arrays one after the other, in one layout, so that one compiled twin does."""
    return np.ascontiguousarray(np.concatenate(rows), float)


def begun(
    own: Sequence[tuple[Array, Array, Array]], moments: Sequence[Moment]
) -> tuple[Array, Array]:
    """Labels (T,) of trajectories and what each takes (T, S), ``own``: label, m, P at each time.

    Each look gives to those the detections that are nearest.
    """
    found: dict[int, dict[int, int]] = {}
    s = first = 0
    for (label, m, P), x in zip(own, moments, strict=True):
        for seen in x.sights:
            n = len(seen.look.z)
            if len(label) and n:
                z_hat, _, S = innovations(seen.look, m, P, seen.own.unscented)
                log_l = log_likelihood(seen.look, z_hat, S, GATE)
                while log_l.max() > -np.inf:
                    t, i = np.unravel_index(log_l.argmax(), log_l.shape)
                    found.setdefault(int(label[t]), {})[s] = first + int(i)
                    log_l[t] = log_l[:, i] = -np.inf
            s, first = s + 1, first + n
    taken = np.full((len(found), s), -1)
    for row, one in zip(taken, found.values(), strict=True):
        row[list(one)] = list(one.values())
    return np.array(list(found), np.int64), taken


def named(taken: Array, label: Array, before: Array) -> Array:
    """Labels (T,) of what is ``taken`` (T, S): of those that took most of it ``before``, or new."""
    shared = ((taken[:, None] == before) & (before >= 0)).sum(2)
    name = label.max(initial=-1) + 1 + np.arange(len(taken))
    t, of = linear_sum_assignment(-shared)
    some = shared[t, of] > 0
    name[t[some]] = label[of[some]]
    return np.asarray(name)


def possible(data: Batch, taken: Array) -> Array:
    """What a trajectory takes (S,), without what it can not have made."""
    taken = taken.copy()
    while (wrong := weigh(data, taken).gain == -np.inf).any():
        taken[wrong.argmax()] = -1
    return taken


def search(data: Batch, start: Array, rng: np.random.Generator) -> Array:
    """The likeliest of the sets of trajectories (T, S) that are come by from ``start``."""
    S, N, dx = start.shape[1], len(data.z), data.F.shape[1]
    start = np.array([possible(data, taken) for taken in start], np.int64).reshape(-1, S)
    start = start[[weigh(data, taken).gain.sum() > 0 for taken in start]]
    T = len(start) + ROOM + len(start) // 2
    ways, spare = places(T, S, N, dx), places(2, S, 0, dx)
    for t, taken in enumerate(start):
        way = weigh(data, taken)
        for into, value in zip(ways, way, strict=False):
            into[t] = value
        ways.size[t] = (taken >= 0).sum()
        ways.owner[taken[taken >= 0]] = t
    n = max(EACH * S * (len(start) + 1), LEAST)
    temperature = HOT * (COLD / HOT) ** (np.arange(n) / max(n - 1, 1))
    found, best, top, done = ways.taken.copy(), ways.taken.copy(), 0.0, 0
    base = ways.gain.sum()
    size = max(NUMBERS, 8 * (2 * S + 16))
    while done < n:
        before = ways.gain.sum() - base
        gained, made = moves(data, ways, spare, best, temperature[done:], rng.random(size))
        done += made
        if before + gained > top + 1e-9:
            top = before + gained
            found[:] = best
    found = found[(found >= 0).any(1)]
    return found[np.argsort((found >= 0).argmax(1), kind="stable")]


def places(T: int, S: int, N: int, dx: int) -> Ways:
    """Free places for T trajectories over S looks at N detections."""
    m, P = np.zeros((T, S, dx)), np.zeros((T, S, dx, dx))
    none, off = np.full((T, S), -1), np.full((T, S), -1.0)
    return Ways(none, np.zeros((T, S)), off, np.ones((T, S)), m, P, np.zeros(T, np.int64),
                np.full(N, -1))  # fmt: skip


def trails(
    moments: Sequence[Moment], taken: Array, name: Array, params: Params
) -> Iterator[tuple[Trail, Array]]:
    """The trajectories ``name`` (T,) that have ``taken`` (T, S) detections, filtered.

    Those that begin at most ``retrodict`` [s] later may be anywhere; beside come the names of those
    that are detected then.
    """
    dx = params.width
    label = np.zeros(0, np.int64)
    a = newborn(np.zeros(0), np.zeros((0, dx)), np.zeros((0, dx, dx)))
    change = params.hide_rate + params.show_rate
    settled = params.show_rate / change if change else 1.0
    last = taken.shape[1] - 1 - (taken[:, ::-1] >= 0).argmax(1)
    times = np.repeat([x.time_ns for x in moments], [len(x.sights) for x in moments])
    begin = times[(taken >= 0).argmax(1)] if len(taken) else np.zeros(0, np.int64)
    s = first = 0
    for x in moments:
        m, P, _ = x.gone.predict(a.m, a.P)
        a = replace(
            a,
            r=a.r * x.gone.survival(params, a.m),
            m=m,
            P=P,
            visible=settled + (a.visible - settled) * np.exp(-change * x.gone.dt),
            unseen=a.unseen + 1.0,
        )
        for seen in x.sights:
            at = taken[:, s] - first
            p, m, P = unseen(seen.look, a.m, a.P, a.visible, seen.own.fov_mass)
            after = missed(replace(a, m=m, P=P), p)
            i = at[label]
            hit = np.flatnonzero(i >= 0)
            if len(hit):
                z_hat, C, S = innovations(seen.look, a.m, a.P, seen.own.unscented)
                after.m[hit], after.P[hit] = updated(seen.look, a.m, a.P, z_hat, C, S, hit, i[hit])
                after.r[hit] = after.visible[hit] = 1.0
                after.unseen[hit] = 0.0
            new = np.setdiff1d(np.flatnonzero(at >= 0), label)
            begins = newborn(np.ones(len(new)), seen.m[at[new]], seen.P[at[new]])
            a, label = after.join(begins), np.concatenate((label, new))
            s, first = s + 1, first + len(seen.look.z)
        kept = np.flatnonzero((a.r >= params.min_existence) | (last[label] >= s))
        a, label = a.take(kept), label[kept]
        soon = np.flatnonzero((begin > x.time_ns) & (begin - x.time_ns <= 1e9 * params.retrodict))
        n = len(soon)
        b = a.join(
            newborn(np.ones(n), np.zeros((n, dx)), np.tile(ANYWHERE * np.eye(dx), (n, 1, 1)))
        )
        order = np.argsort(name[np.concatenate((label, soon))])
        own, b = name[np.concatenate((label, soon))][order], b.take(order)
        gone, survive = x.gone, params.p_survive**x.gone.steps
        trail = Trail(x.time_ns, own, b.r, b.m, b.P, gone.F, gone.Q, survive)
        yield trail, name[label[a.unseen == 0]]


def searched(
    params: Params,
    forward: Iterator[tuple[Mapping[str, Array], Epoch, tuple[Sighting, ...]]],
    rng: np.random.Generator,
) -> Iterator[tuple[Mapping[str, Array], tuple[Trail, Array]]]:
    """The trajectories found, filtered, after a pass of the filter ``forward`` and its way back.

    That yields what is stated per step, the epoch and what was seen.

    Raises
    ------
    InputError : detections have times of their own
    """
    said: list[Mapping[str, Array]] = []
    moments: list[Moment] = []
    own: list[tuple[Array, Array, Array]] = []
    last = None
    with Stack() as past:
        for numbers, epoch, sights in forward:
            said.append(numbers)
            moments.append(Moment(epoch.time_ns, elapse(params, last, epoch.time_ns), sights))
            last = epoch.time_ns
            past.push(epoch)
        later = None
        for epoch in AROUND.get().watch(past, len(past)):
            later = paths.back(later, epoch, 0.0)
            there = np.flatnonzero((later.r >= LIKELY) & (later.age >= 0))
            own.append((later.label[there], later.m[there], later.P[there]))
    label, before = begun(own[::-1], moments)
    taken = search(batch(moments, params), before, rng)
    found = trails(moments, taken, named(taken, label, before), params)
    yield from zip(said, found, strict=True)

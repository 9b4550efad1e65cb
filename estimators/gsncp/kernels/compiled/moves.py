"""Compiled twin of :mod:`echoset.estimators.gsncp.kernels.moves`.

Every move replaces one column of eta: a birth one of zeros, a death by zeros. Ratios of proposal
densities are those of the definition.
"""

from __future__ import annotations

from math import exp, inf, log, log1p, pi, sqrt
from typing import NamedTuple

import numpy as np
from numba import njit

from .....models.records import Array
from ..posterior import (
    ACCEPT,
    ANYWHERE,
    BALL,
    BIRTH,
    DEATH,
    DEPTH,
    EXTENT,
    EXTENTS,
    FLOOR,
    JUMP,
    KIND,
    PLACE,
    POSITION,
    RELOCATE,
    SEED,
    TARGET,
    Births,
    Scene,
    State,
)
from .posterior import bisect, column, log_change, log_posterior, put, refresh, span

_NONE = -1


class Proposal(NamedTuple):
    """Another target in the place of one: centre c (3,), extent e (6,), its ``step`` (3,) from
    there, its precision A (3, 3), and its column ``fresh`` (M,) of eta, non-zero from ``first``
    to ``last`` (K,)."""

    c: Array
    e: Array
    step: Array
    A: Array
    first: Array
    last: Array
    fresh: Array


class Rates(NamedTuple):
    """For a jump: Z (M,), and log death rates (room,) before (``few``) and after it (``many``)."""

    Z: Array
    few: Array
    many: Array


@njit(cache=True, error_model="numpy")
def volume(lower: Array, upper: Array) -> float:
    """Volume of a box over the axes along which it extends."""
    V = 1.0
    for a in range(len(lower)):
        if upper[a] > lower[a]:
            V *= upper[a] - lower[a]
    return V


@njit(cache=True, error_model="numpy")
def dimension(scene: Scene) -> int:
    """Axes along which the region extends."""
    d = 0
    for a in range(3):
        d += scene.upper[a] > scene.lower[a]
    return d


@njit(cache=True, error_model="numpy")
def feasible(scene: Scene, state: State, l: int, c: Array, e: Array) -> bool:
    """Whether target l may be (c, e) beside the others."""
    for a in range(3):
        if c[a] < scene.lower[a] or c[a] > scene.upper[a]:
            return False
    for a in range(6):
        if e[a] < scene.e_lower[a] or e[a] > scene.e_upper[a]:
            return False
    for j in range(state.size[0]):
        if j != l:
            d2 = 0.0
            for a in range(3):
                d2 += (c[a] - state.c[j, a]) ** 2
            if sqrt(d2) < scene.radius:
                return False
    return True


@njit(cache=True, error_model="numpy")
def half_log_det(A: Array) -> float:
    """Half the logarithm of the determinant of A (3, 3)."""
    det = (
        A[0, 0] * (A[1, 1] * A[2, 2] - A[1, 2] * A[2, 1])
        - A[0, 1] * (A[1, 0] * A[2, 2] - A[1, 2] * A[2, 0])
        + A[0, 2] * (A[1, 0] * A[2, 1] - A[1, 1] * A[2, 0])
    )
    return 0.5 * log(det)


@njit(cache=True, error_model="numpy")
def position_step(scene: Scene, A: Array, scale: float, g: Array, step: Array) -> None:
    """Step of covariance scale^2 A^-1 from the normals g."""
    l00 = sqrt(A[0, 0])
    l10, l20 = A[1, 0] / l00, A[2, 0] / l00
    l11 = sqrt(A[1, 1] - l10 * l10)
    l21 = (A[2, 1] - l20 * l10) / l11
    l22 = sqrt(A[2, 2] - l20 * l20 - l21 * l21)
    n = np.zeros(3)
    for a in range(3):
        if scene.upper[a] > scene.lower[a]:
            n[a] = g[a]
    step[2] = n[2] / l22
    step[1] = (n[1] - l21 * step[2]) / l11
    step[0] = (n[0] - l10 * step[1] - l20 * step[2]) / l00
    for a in range(3):
        step[a] *= scale


@njit(cache=True, error_model="numpy")
def extent_step(scene: Scene, e: float, rho: float, scale: float) -> float:
    """Standard deviation of the step of one element."""
    if scene.informed:
        return scale / sqrt(1 + rho)
    return scale * max(abs(e), FLOOR)


@njit(cache=True, error_model="numpy")
def seed_weight(scene: Scene, state: State, l: int, m: int, clutter: float) -> float:
    """Weight of detection m as a seed of births if target l is not there."""
    return float(scene.weight[m] / (clutter + max(state.shot[m] - state.eta[l, m], 0.0)))


@njit(cache=True, error_model="numpy", fastmath={"reassoc"})
def total_weight(scene: Scene, state: State, l: int, clutter: float) -> float:
    """Sum of the weights of all detections."""
    total, eta, shot = 0.0, state.eta[l], state.shot
    for m in range(len(shot)):
        total += scene.weight[m] / (clutter + max(shot[m] - eta[m], 0.0))
    return total


@njit(cache=True, error_model="numpy")
def draw(
    scene: Scene, state: State, l: int, clutter: float, total: float, u: Array, g: Array, c: Array
) -> None:
    """A centre near a detection that the targets other than l leave unexplained, or anywhere."""
    M = len(state.shot)
    if u[ANYWHERE] < scene.uniform or M == 0:
        for a in range(3):
            c[a] = scene.lower[a] + u[PLACE + a] * (scene.upper[a] - scene.lower[a])
        return
    rest, seed = u[SEED] * total, 0
    while seed < M - 1:
        rest -= seed_weight(scene, state, l, seed, clutter)
        if rest < 0:
            break
        seed += 1
    for a in range(3):
        open_ = scene.upper[a] > scene.lower[a]
        c[a] = scene.z[a, seed] + scene.spread * g[a] if open_ else scene.lower[a]


@njit(cache=True, error_model="numpy")
def log_density(
    scene: Scene, state: State, l: int, clutter: float, total: float, c: Array
) -> float:
    """Logarithm of the density of a newborn (c, E) given the targets other than l."""
    D, E = volume(scene.lower, scene.upper), volume(scene.e_lower, scene.e_upper)
    if len(state.shot) == 0:
        return -log(D * E)
    near, reach, X = 0.0, scene.spread * sqrt(scene.gate), scene.z[0]
    for k in range(len(scene.offset) - 1):
        m = bisect(X, scene.offset[k], scene.offset[k + 1], c[0] - reach)
        while m < scene.offset[k + 1] and X[m] <= c[0] + reach:
            d2 = 0.0
            for a in range(3):
                if scene.upper[a] > scene.lower[a]:
                    d2 += ((scene.z[a, m] - c[a]) / scene.spread) ** 2
            if d2 <= scene.gate:
                near += seed_weight(scene, state, l, m, clutter) * exp(-d2 / 2)
            m += 1
    kernel = (2 * pi * scene.spread**2) ** (dimension(scene) / 2)
    return log(((1 - scene.uniform) * near / total / kernel + scene.uniform / D) / E)


@njit(cache=True, error_model="numpy")
def remove(state: State, l: int, first: Array, last: Array, fresh: Array) -> None:
    """Take target l, whose new column is zeros, away; the last one takes its place."""
    put(state, l, first, last, fresh)
    end = state.size[0] - 1
    state.size[0] = end
    if l < end:
        state.c[l], state.e[l] = state.c[end], state.e[end]
        state.rho[l], state.A[l] = state.rho[end], state.A[end]
        for k in range(len(first)):
            for m in range(state.first[end, k], state.last[end, k]):
                state.eta[l, m], state.eta[end, m] = state.eta[end, m], 0.0
            state.first[l, k], state.last[l, k] = state.first[end, k], state.last[end, k]
    state.first[end], state.last[end] = 0, 0


@njit(cache=True, error_model="numpy")
def log_death(
    scene: Scene, rho: float, first: Array, last: Array, eta: Array, Z: Array, clutter: float
) -> float:
    """Logarithm of the rate at which a target of column ``eta`` dies, given ``Z`` (M,)."""
    total, product, shot = rho + log(volume(scene.e_lower, scene.e_upper)), 1.0, 0.0
    for k in range(len(first)):
        for m in range(first[k], last[k]):
            shot += eta[m]
            product *= max(1 - eta[m] / Z[m], 1e-15)
            if product < 1e-200:
                total += log(product)
                product = 1.0
    return total + log(product) + log1p(shot / clutter)


@njit(cache=True, error_model="numpy")
def log_deaths(
    scene: Scene, state: State, Z: Array, clutter: float, skip: int, deaths: Array
) -> float:
    """Logarithms of the death rates of all targets but ``skip`` into ``deaths``; and of the sum."""
    best, rate = -inf, 0.0
    for l in range(state.size[0]):
        deaths[l] = -inf
        if l != skip:
            ranges = state.first[l], state.last[l]
            deaths[l] = log_death(scene, state.rho[l], *ranges, state.eta[l], Z, clutter)
        best = max(best, deaths[l])
    for l in range(state.size[0]):
        rate += exp(deaths[l] - best)
    return best + log(rate) if best > -inf else -inf


@njit(cache=True, error_model="numpy")
def log_add(a: float, b: float) -> float:
    """log(exp(a) + exp(b))."""
    high, low = max(a, b), min(a, b)
    return high + log1p(exp(low - high)) if high > -inf else -inf


@njit(cache=True, error_model="numpy")
def log_table(scene: Scene, births: Births, c: Array) -> float:
    """Logarithm of the density of a newborn (c, E) in the paper's table."""
    D, E = volume(scene.lower, scene.upper), volume(scene.e_lower, scene.e_upper)
    if len(births.points) == 0:
        return -log(D * E)
    near = 0.0
    for j in range(len(births.points)):
        d2 = 0.0
        for a in range(3):
            d2 += (births.points[j, a] - c[a]) ** 2
        if d2 <= births.radius**2:
            near += births.weight[j]
    r, flat = births.radius, dimension(scene) == 2
    ball = pi * r**2 if flat else 4 / 3 * pi * r**3
    return log(((1 - scene.uniform) * near / ball + scene.uniform / D) / E)


@njit(cache=True, error_model="numpy")
def table_draw(scene: Scene, births: Births, u: Array, g: Array, c: Array) -> None:
    """A centre in one of the table's balls, or anywhere."""
    J = len(births.points)
    if u[ANYWHERE] < scene.uniform or J == 0:
        for a in range(3):
            c[a] = scene.lower[a] + u[PLACE + a] * (scene.upper[a] - scene.lower[a])
        return
    total = 0.0
    for j in range(J):
        total += births.weight[j]
    rest, j = u[BALL] * total, 0
    while j < J - 1:
        rest -= births.weight[j]
        if rest < 0:
            break
        j += 1
    norm = 0.0
    for a in range(3):
        if scene.upper[a] > scene.lower[a]:
            norm += g[a] * g[a]
    length = births.radius * u[DEPTH] ** (1 / dimension(scene)) / sqrt(norm)
    for a in range(3):
        c[a] = births.points[j, a]
        if scene.upper[a] > scene.lower[a]:
            c[a] += length * g[a]


@njit(cache=True, error_model="numpy")
def kind_of(moves: Array, u: Array) -> int:
    """The kind of the move."""
    kind = 0
    while kind < JUMP and u[KIND] >= moves[kind]:
        kind += 1
    return kind


@njit(cache=True, error_model="numpy")
def dying(L: int, rates: Rates, total: float, u: Array) -> int:
    """The target that dies, by the rates whose sum has the logarithm ``total``."""
    rest, l = u[SEED], 0
    while l < L - 1:
        rest -= exp(rates.few[l] - total)
        if rest < 0:
            break
        l += 1
    return l


@njit(cache=True, error_model="numpy")
def jumper(
    scene: Scene, state: State, births: Births, clutter: float, u: Array, rates: Rates
) -> tuple[int, float]:
    """The target that a jump takes away, or the place after the last where one is born.

    And the logarithm of the death rates' sum, which with that of the births decides it.
    """
    rates.Z[:] = clutter + state.shot
    deaths = log_deaths(scene, state, rates.Z, clutter, _NONE, rates.few)
    if log(u[TARGET]) < births.log_total - log_add(births.log_total, deaths):
        return state.size[0], deaths
    return dying(state.size[0], rates, deaths, u), deaths


@njit(cache=True, error_model="numpy")
def newborn(
    scene: Scene, state: State, births: Births, kind: int, l: int, clutter: float, total: float,
    u: Array, g: Array, new: Proposal,
) -> None:  # fmt: skip
    """A centre and an extent anew, for a birth, a relocation or a jump."""
    if kind == JUMP:
        table_draw(scene, births, u, g, new.c)
    else:
        draw(scene, state, l, clutter, total, u, g, new.c)
    for a in range(6):
        new.e[a] = scene.e_lower[a] + u[EXTENTS + a] * (scene.e_upper[a] - scene.e_lower[a])


@njit(cache=True, error_model="numpy")
def stepped(
    scene: Scene, state: State, kind: int, l: int, scale: Array, g: Array, new: Proposal
) -> None:
    """A step of the position or of the extent of target l."""
    new.c[:], new.e[:] = state.c[l], state.e[l]
    if kind == POSITION:
        position_step(scene, state.A[l], scale[0], g, new.step)
        for a in range(3):
            new.c[a] += new.step[a]
    else:
        for a in range(6):
            if scene.e_upper[a] > scene.e_lower[a]:
                new.e[a] += extent_step(scene, new.e[a], state.rho[l], scale[1]) * g[a]


@njit(cache=True, error_model="numpy")
def position_ratio(state: State, l: int, scale: float, new: Proposal) -> float:
    """Logarithm of the ratio of the densities of a step back and forth."""
    drift, step = 0.0, new.step
    for a in range(3):
        for b in range(3):
            drift += step[a] * (new.A[a, b] - state.A[l, a, b]) * step[b]
    return half_log_det(new.A) - half_log_det(state.A[l]) - drift / (2 * scale**2)


@njit(cache=True, error_model="numpy")
def extent_ratio(
    scene: Scene, state: State, l: int, scale: float, rho: float, new: Proposal
) -> float:
    """The same for a step of the extent, to a target that expects ``rho`` detections."""
    ratio = 0.0
    for a in range(6):
        if scene.e_upper[a] > scene.e_lower[a]:
            forth = extent_step(scene, state.e[l, a], state.rho[l], scale)
            back = extent_step(scene, new.e[a], rho, scale)
            moved = new.e[a] - state.e[l, a]
            ratio += log(forth / back) - moved**2 / 2 * (back**-2 - forth**-2)
    return ratio


@njit(cache=True, error_model="numpy")
def jump_ratio(
    scene: Scene, state: State, births: Births, l: int, born: bool, clutter: float, rho: float,
    total: float, new: Proposal, rates: Rates,
) -> float:  # fmt: skip
    """The same for a birth or death by total rates, the deaths' before being ``total``."""
    Z, first, last = rates.Z, new.first, new.last
    for k in range(len(first)):
        for m in range(first[k], last[k]):
            Z[m] = max(Z[m] + new.fresh[m] - state.eta[l, m], clutter)
    other = log_deaths(scene, state, Z, clutter, l, rates.many)
    if born:
        chosen = log_death(scene, rho, first, last, new.fresh, Z, clutter)
        ratio = chosen + log_add(births.log_total, total) - births.log_total
        ratio -= log_add(births.log_total, log_add(other, chosen))
        return float(ratio - log_table(scene, births, new.c))
    ratio = births.log_total + log_add(births.log_total, total) - rates.few[l]
    ratio += log_table(scene, births, state.c[l])
    return float(ratio - log_add(births.log_total, other))


@njit(cache=True, error_model="numpy")
def take(state: State, l: int, rho: float, new: Proposal) -> None:
    """Let the proposal be target l."""
    put(state, l, new.first, new.last, new.fresh)
    state.c[l], state.e[l], state.rho[l], state.A[l] = new.c, new.e, rho, new.A


@njit(cache=True, error_model="numpy")
def chain(
    scene: Scene, state: State, intensity: Array, births: Births, moves: Array, scale: Array,
    U: Array, G: Array, trace: Array, count: Array, tried: Array, accepted: Array,
) -> None:  # fmt: skip
    """Run one move for every row of random numbers; see the definition."""
    K, M, room = len(scene.offset) - 1, len(state.shot), len(state.c)
    prior, clutter = log(intensity[0]) - log(volume(scene.e_lower, scene.e_upper)), intensity[1]
    new = Proposal(
        np.zeros(3), np.zeros(6), np.zeros(3), np.zeros((3, 3)), np.zeros(K, np.int64),
        np.zeros(K, np.int64), np.zeros(M),
    )  # fmt: skip
    rates = Rates(np.zeros(M), np.zeros(room), np.zeros(room))
    refresh(scene, state)
    posterior = log_posterior(scene, state, intensity)
    for n in range(len(U)):
        u, g, L = U[n], G[n], state.size[0]
        kind = kind_of(moves, u)
        tried[kind] += 1
        trace[n], count[n] = posterior, L

        # what is replaced: target l, or for a birth the empty place after the last
        l, born, dies, deaths = min(int(u[TARGET] * L), L - 1), kind == BIRTH, kind == DEATH, 0.0
        if kind == JUMP:
            l, deaths = jumper(scene, state, births, clutter, u, rates)
            born, dies = l == L, l < L
        if born:
            l = L
        if (born and room == L) or (not born and L == 0):
            continue

        # what is proposed
        rho, total = 0.0, 0.0
        if kind in (BIRTH, DEATH, RELOCATE):
            total = total_weight(scene, state, l, clutter)
        if dies:
            new.first[:], new.last[:] = 0, 0
        else:
            if kind in (POSITION, EXTENT):
                stepped(scene, state, kind, l, scale, g, new)
            else:
                newborn(scene, state, births, kind, l, clutter, total, u, g, new)
            if not feasible(scene, state, l, new.c, new.e):
                continue
            rho = column(scene, new.c, new.e, new.first, new.last, new.fresh, new.A)
        span(scene, state, l, new.first, new.last, new.fresh)
        change = log_change(state, l, new.first, new.last, new.fresh, clutter) - rho
        if not born:
            change += state.rho[l]
        change += prior * (born - 1.0 * dies)

        # the ratio of proposal densities
        log_ratio = 0.0
        if kind == POSITION:
            log_ratio = position_ratio(state, l, scale[0], new)
        elif kind == EXTENT:
            log_ratio = extent_ratio(scene, state, l, scale[1], rho, new)
        elif kind == BIRTH:
            log_ratio = -log(L + 1.0) - log_density(scene, state, l, clutter, total, new.c)
        elif kind == DEATH:
            log_ratio = log(L) + log_density(scene, state, l, clutter, total, state.c[l])
        elif kind == RELOCATE:
            log_ratio = log_density(scene, state, l, clutter, total, state.c[l])
            log_ratio -= log_density(scene, state, l, clutter, total, new.c)
        else:
            log_ratio = jump_ratio(scene, state, births, l, born, clutter, rho, deaths, new, rates)

        # accept or not
        if log(u[ACCEPT]) < change + log_ratio:
            posterior += change
            accepted[kind] += 1
            if dies:
                remove(state, l, new.first, new.last, new.fresh)
            else:
                take(state, l, rho, new)
                state.size[0] = L + born
        trace[n], count[n] = posterior, state.size[0]

"""Compiled twin of :mod:`echoset.estimators.gsncp.kernels.moves`.

Every move replaces one column of eta: a birth one of zeros, a death by zeros. Ratios of proposal
densities are those of the definition.
"""

from __future__ import annotations

from math import exp, inf, log, log1p, pi, sqrt

import numpy as np
from numba import njit

from .....models.records import Array
from ..posterior import BIRTH, DEATH, EXTENT, FLOOR, JUMP, POSITION, RELOCATE, Births, Scene, State
from .posterior import bisect, column, log_change, log_posterior, put, refresh, span

_NONE = -1


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
    if u[4] < scene.uniform or M == 0:
        for a in range(3):
            c[a] = scene.lower[a] + u[5 + a] * (scene.upper[a] - scene.lower[a])
        return
    rest, seed = u[3] * total, 0
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
    if u[4] < scene.uniform or J == 0:
        for a in range(3):
            c[a] = scene.lower[a] + u[5 + a] * (scene.upper[a] - scene.lower[a])
        return
    total = 0.0
    for j in range(J):
        total += births.weight[j]
    rest, j = u[5] * total, 0
    while j < J - 1:
        rest -= births.weight[j]
        if rest < 0:
            break
        j += 1
    norm = 0.0
    for a in range(3):
        if scene.upper[a] > scene.lower[a]:
            norm += g[a] * g[a]
    length = births.radius * u[6] ** (1 / dimension(scene)) / sqrt(norm)
    for a in range(3):
        c[a] = births.points[j, a]
        if scene.upper[a] > scene.lower[a]:
            c[a] += length * g[a]


@njit(cache=True, error_model="numpy")
def chain(
    scene: Scene, state: State, intensity: Array, births: Births, moves: Array, scale: Array,
    U: Array, G: Array, trace: Array, count: Array, tried: Array, accepted: Array,
) -> None:  # fmt: skip
    """Run one move for every row of random numbers; see the definition."""
    K, room = len(scene.offset) - 1, len(state.c)
    prior, clutter = log(intensity[0]) - log(volume(scene.e_lower, scene.e_upper)), intensity[1]
    first, last, fresh = np.zeros(K, np.int64), np.zeros(K, np.int64), np.zeros(len(state.shot))
    c, e, step, A = np.zeros(3), np.zeros(6), np.zeros(3), np.zeros((3, 3))
    few, many, Z = np.zeros(room), np.zeros(room), np.zeros(len(state.shot))
    refresh(scene, state)
    posterior = log_posterior(scene, state, intensity)
    for n in range(len(U)):
        u, g, L = U[n], G[n], state.size[0]
        kind = 0
        while kind < JUMP and u[0] >= moves[kind]:
            kind += 1
        tried[kind] += 1
        trace[n], count[n] = posterior, L

        # what is replaced: target l, or for a birth the empty place after the last
        l, born, dies = min(int(u[1] * L), L - 1), kind == BIRTH, kind == DEATH
        rate = 0.0
        if kind == JUMP:
            for m in range(len(Z)):
                Z[m] = clutter + state.shot[m]
            rate = log_deaths(scene, state, Z, clutter, _NONE, few)
            born = log(u[1]) < births.log_total - log_add(births.log_total, rate)
            dies = not born
            if dies:
                rest, l = u[3], 0
                while l < L - 1:
                    rest -= exp(few[l] - rate)
                    if rest < 0:
                        break
                    l += 1
        if born:
            l = L
        if (born and room == L) or (not born and L == 0):
            continue

        # what is proposed
        log_ratio, total = 0.0, 0.0
        if kind in (BIRTH, DEATH, RELOCATE):
            total = total_weight(scene, state, l, clutter)
        if not dies:
            c[:], e[:] = state.c[l], state.e[l]
            if kind == POSITION:
                position_step(scene, state.A[l], scale[0], g, step)
                for a in range(3):
                    c[a] += step[a]
            elif kind == EXTENT:
                for a in range(6):
                    if scene.e_upper[a] > scene.e_lower[a]:
                        e[a] += extent_step(scene, e[a], state.rho[l], scale[1]) * g[a]
            else:
                if kind == JUMP:
                    table_draw(scene, births, u, g, c)
                else:
                    draw(scene, state, l, clutter, total, u, g, c)
                for a in range(6):
                    e[a] = scene.e_lower[a] + u[8 + a] * (scene.e_upper[a] - scene.e_lower[a])
            if not feasible(scene, state, l, c, e):
                continue
            rho = column(scene, c, e, first, last, fresh, A)
        else:
            rho = 0.0
            first[:], last[:] = 0, 0
        span(scene, state, l, first, last, fresh)
        change = log_change(state, l, first, last, fresh, clutter) - rho
        if not born:
            change += state.rho[l]
        change += prior * (born - 1.0 * dies)

        # the ratio of proposal densities
        if kind == POSITION:
            drift = 0.0
            for a in range(3):
                for b in range(3):
                    drift += step[a] * (A[a, b] - state.A[l, a, b]) * step[b]
            log_ratio = half_log_det(A) - half_log_det(state.A[l]) - drift / (2 * scale[0] ** 2)
        elif kind == EXTENT:
            for a in range(6):
                if scene.e_upper[a] > scene.e_lower[a]:
                    forth = extent_step(scene, state.e[l, a], state.rho[l], scale[1])
                    back = extent_step(scene, e[a], rho, scale[1])
                    moved = e[a] - state.e[l, a]
                    log_ratio += log(forth / back) - moved**2 / 2 * (back**-2 - forth**-2)
        elif kind == BIRTH:
            log_ratio = -log(L + 1.0) - log_density(scene, state, l, clutter, total, c)
        elif kind == DEATH:
            log_ratio = log(L) + log_density(scene, state, l, clutter, total, state.c[l])
        elif kind == RELOCATE:
            log_ratio = log_density(scene, state, l, clutter, total, state.c[l])
            log_ratio -= log_density(scene, state, l, clutter, total, c)
        else:
            for k in range(K):
                for m in range(first[k], last[k]):
                    Z[m] = max(Z[m] + fresh[m] - state.eta[l, m], clutter)
            other = log_deaths(scene, state, Z, clutter, l, many)
            if born:
                chosen = log_death(scene, rho, first, last, fresh, Z, clutter)
                log_ratio = chosen + log_add(births.log_total, rate) - births.log_total
                log_ratio -= log_add(births.log_total, log_add(other, chosen))
                log_ratio -= log_table(scene, births, c)
            else:
                log_ratio = births.log_total + log_add(births.log_total, rate) - few[l]
                log_ratio += log_table(scene, births, state.c[l])
                log_ratio -= log_add(births.log_total, other)

        # accept or not
        if log(u[2]) < change + log_ratio:
            posterior += change
            accepted[kind] += 1
            if dies:
                remove(state, l, first, last, fresh)
            else:
                put(state, l, first, last, fresh)
                state.c[l], state.e[l], state.rho[l], state.A[l] = c, e, rho, A
                state.size[0] = L + born
        trace[n], count[n] = posterior, state.size[0]

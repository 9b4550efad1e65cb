"""Moves of the jump chain: what they propose, and with which ratio of proposal densities.

A chain is a cycle of Metropolis-Hastings steps. Each proposes another configuration and knows
log q(theta' -> theta) - log q(theta -> theta'), densities with respect to Lebesgue measure on
unordered configurations. Births draw their centre near detections that the other targets do not
explain, or (the paper's) in balls around a thinning of the detections; their extent is uniform.
"""

from __future__ import annotations

import numpy as np

from ....models.point_process import ball
from ....models.records import Array
from .posterior import (
    ACCEPT,
    ANYWHERE,
    BALL,
    BIRTH,
    DEATH,
    DEPTH,
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
    columns,
    free,
    log_posterior,
    refresh,
)

Targets = tuple[Array, Array]
"""Centres (L, 3) and extents (L, 6)."""
Proposal = tuple[Targets, float]
"""Another configuration, and the logarithm of the ratio of proposal densities."""


def chain(
    scene: Scene,
    state: State,
    intensity: Array,
    births: Births,
    moves: Array,
    scale: Array,
    U: Array,
    G: Array,
    trace: Array,
    count: Array,
    tried: Array,
    accepted: Array,
) -> None:
    """Run one move for every row of the random numbers U (n, 14), uniform, and G (n, 6), normal.

    ``moves`` (6,) are the cumulated probabilities of the kinds of moves, ``scale`` (2,) the steps
    of position and extent. Log posterior and cardinality after each move go to ``trace`` and
    ``count`` (n,), attempts and acceptances by kind are added to ``tried`` and ``accepted`` (6,).
    """
    for n, (u, g) in enumerate(zip(U, G, strict=True)):
        L = int(state.size[0])
        now = state.c[:L].copy(), state.e[:L].copy()
        kind = int(np.searchsorted(moves, u[KIND], side="right"))
        proposal = propose(scene, now, intensity, births, kind, scale, u, g, len(state.c))
        before = log_posterior(scene, *now, intensity)
        tried[kind] += 1
        if proposal is not None:
            (c, e), log_ratio = proposal
            after = log_posterior(scene, c, e, intensity)
            if np.log(u[ACCEPT]) < after - before + log_ratio:
                state.size[0], before = len(c), after
                state.c[: len(c)], state.e[: len(c)] = c, e
                accepted[kind] += 1
        trace[n], count[n] = before, state.size[0]
    refresh(scene, state)


def propose(
    scene: Scene,
    now: Targets,
    intensity: Array,
    births: Births,
    kind: int,
    scale: Array,
    u: Array,
    g: Array,
    room: int,
) -> Proposal | None:
    """What the move proposes; None where it can do nothing or leaves the prior's support."""
    L = len(now[0])
    if kind == JUMP:
        return jump(scene, now, intensity, births, u, g, room)
    if kind == BIRTH:
        return birth(scene, now, intensity, u, g) if room > L else None
    if L == 0:
        return None
    l = min(int(u[TARGET] * L), L - 1)
    if kind == DEATH:
        return death(scene, now, intensity, l)
    if kind == RELOCATE:
        return relocate(scene, now, intensity, l, u, g)
    return (move_position if kind == POSITION else move_extent)(scene, now, l, scale, g)


def move_position(scene: Scene, now: Targets, l: int, scale: Array, g: Array) -> Proposal:
    """A step of covariance ``scale[0]^2 A^-1``, with A at the target's place."""
    c, e = now
    A = columns(scene, c[l : l + 1], e[l : l + 1])[2][0]
    n = np.where(free(scene.lower, scene.upper)[0], g[:3], 0.0)
    step = scale[0] * np.linalg.solve(np.linalg.cholesky(A).T, n)
    there = replaced(now, l, c[l] + step, e[l])
    B = columns(scene, there[0][l : l + 1], e[l : l + 1])[2][0]
    drift = step @ (B - A) @ step / (2 * scale[0] ** 2)
    return there, float((np.linalg.slogdet(B)[1] - np.linalg.slogdet(A)[1]) / 2 - drift)


def move_extent(scene: Scene, now: Targets, l: int, scale: Array, g: Array) -> Proposal:
    """A step of all elements, with standard deviations that depend on the target."""
    c, e = now
    open_ = scene.e_upper > scene.e_lower
    std = extent_step(scene, c[l], e[l], scale)
    step = np.where(open_, std * g, 0.0)
    there = replaced(now, l, c[l], e[l] + step)
    if np.any((there[1][l] < scene.e_lower) | (there[1][l] > scene.e_upper)):
        return there, -np.inf
    back = extent_step(scene, c[l], there[1][l], scale)
    ratio = np.log(std / back) - step**2 / 2 * (back**-2 - std**-2)
    return there, float(ratio[open_].sum())


def extent_step(scene: Scene, c: Array, e: Array, scale: Array) -> Array:
    """Standard deviations (6,) [m] of an extent's step."""
    if scene.informed:
        return np.full(6, scale[1] / np.sqrt(1 + columns(scene, c[None], e[None])[0].sum()))
    return np.asarray(scale[1] * np.maximum(np.abs(e), FLOOR))


def birth(scene: Scene, now: Targets, intensity: Array, u: Array, g: Array) -> Proposal:
    """One target more; the way back is the death of one of L + 1."""
    c = draw(scene, now, intensity, u, g)
    e = scene.e_lower + u[EXTENTS : EXTENTS + 6] * (scene.e_upper - scene.e_lower)
    log_q = log_density(scene, now, intensity, c)
    there = np.vstack([now[0], c]), np.vstack([now[1], e])
    return there, -np.log(len(there[0])) - log_q


def death(scene: Scene, now: Targets, intensity: Array, l: int) -> Proposal:
    """One target less."""
    rest = without(now, l)
    return rest, np.log(len(now[0])) + log_density(scene, rest, intensity, now[0][l])


def relocate(scene: Scene, now: Targets, intensity: Array, l: int, u: Array, g: Array) -> Proposal:
    """The death of one target and the birth of another."""
    others = np.delete(now[0], l, 0), np.delete(now[1], l, 0)
    c = draw(scene, others, intensity, u, g)
    e = scene.e_lower + u[EXTENTS : EXTENTS + 6] * (scene.e_upper - scene.e_lower)
    back, forth = (log_density(scene, others, intensity, x) for x in (now[0][l], c))
    return replaced(now, l, c, e), back - forth


def replaced(now: Targets, l: int, c: Array, e: Array) -> Targets:
    """The configuration with another target l."""
    there = now[0].copy(), now[1].copy()
    there[0][l], there[1][l] = c, e
    return there


def without(now: Targets, l: int) -> Targets:
    """The configuration without target l, whose place the last one takes."""
    c, e = replaced(now, l, now[0][-1], now[1][-1])
    return c[:-1], e[:-1]


def unexplained(scene: Scene, targets: Targets, intensity: Array) -> Array:
    """Weights (M,) of detections as seeds of births: high where clutter would have to explain."""
    return np.asarray(scene.weight / (intensity[1] + columns(scene, *targets)[1].sum(0)))


def draw(scene: Scene, targets: Targets, intensity: Array, u: Array, g: Array) -> Array:
    """A centre (3,) near an unexplained detection, or anywhere."""
    if u[ANYWHERE] < scene.uniform or not len(scene.weight):
        return np.asarray(scene.lower + u[PLACE : PLACE + 3] * (scene.upper - scene.lower))
    w = np.cumsum(unexplained(scene, targets, intensity))
    m = min(int(np.searchsorted(w, u[SEED] * w[-1], side="right")), len(w) - 1)
    n = np.where(scene.upper > scene.lower, g[:3], 0.0)
    flat = np.where(scene.upper > scene.lower, scene.z[:, m], scene.lower)
    return np.asarray(flat + scene.spread * n)


def log_density(scene: Scene, targets: Targets, intensity: Array, c: Array) -> float:
    """Logarithm of the density of newborn targets (c, E), given the others."""
    open_, D = free(scene.lower, scene.upper)
    E = free(scene.e_lower, scene.e_upper)[1]
    if not len(scene.weight):
        return float(-np.log(D * E))
    w = unexplained(scene, targets, intensity)
    d2 = ((scene.z.T - c)[:, open_] ** 2).sum(1) / scene.spread**2
    kernel = np.exp(-d2 / 2) / (2 * np.pi * scene.spread**2) ** (open_.sum() / 2)
    kernel[d2 > scene.gate] = 0.0
    q = (1 - scene.uniform) * (w @ kernel) / w.sum() + scene.uniform / D
    return float(np.log(q / E))


def jump(
    scene: Scene, now: Targets, intensity: Array, births: Births, u: Array, g: Array, room: int
) -> Proposal | None:
    """The paper's birth or death, chosen by the total rates B and D of both.

    Birth rate b(C) = lambda (1 + sum eta(C) / lambda_c); deaths have the rates that balance it, so
    that in the ratio of a birth all but b(C) / (B q(C)) (B + D) / (B + D') cancels.
    """
    deaths = log_deaths(scene, now, intensity)
    total = np.logaddexp.reduce(deaths) if len(deaths) else -np.inf
    if np.log(u[TARGET]) < births.log_total - np.logaddexp(births.log_total, total):
        if len(now[0]) == room:
            return None
        c = table_draw(scene, births, u, g)
        e = scene.e_lower + u[EXTENTS : EXTENTS + 6] * (scene.e_upper - scene.e_lower)
        there = np.vstack([now[0], c]), np.vstack([now[1], e])
        return there, table_ratio(scene, now, there, len(now[0]), intensity, births)
    weight = np.cumsum(np.exp(deaths - deaths.max()))
    l = min(int(np.searchsorted(weight, u[SEED] * weight[-1], side="right")), len(deaths) - 1)
    there = without(now, l)
    return there, -table_ratio(scene, there, now, l, intensity, births)


def log_deaths(scene: Scene, now: Targets, intensity: Array) -> Array:
    """Logarithms (L,) of the death rates b(C_l) f(theta without l) / f(theta)."""
    rho, eta, _ = columns(scene, *now)
    Z = intensity[1] + eta.sum(0)
    E = free(scene.e_lower, scene.e_upper)[1]
    gain = rho.sum(1) + np.log1p(-np.minimum(eta / Z, 1 - 1e-15)).sum(1)
    return np.asarray(gain + np.log(E) + np.log1p(eta.sum(1) / intensity[1]))


def table_ratio(
    scene: Scene, few: Targets, many: Targets, l: int, intensity: Array, births: Births
) -> float:
    """Logarithm of q(death) / q(birth) for the target l of ``many`` that ``few`` lack."""
    open_, D = free(scene.lower, scene.upper)
    E = free(scene.e_lower, scene.e_upper)[1]
    q = scene.uniform / D
    if len(births.points):
        near = ((births.points - many[0][l]) ** 2).sum(1) <= births.radius**2
        q += (1 - scene.uniform) * births.weight[near].sum() / ball(births.radius, open_.sum())
    else:
        q = 1 / D
    rates = [np.logaddexp.reduce([births.log_total, *log_deaths(scene, x, intensity)])
             for x in (few, many)]  # fmt: skip
    chosen = log_deaths(scene, many, intensity)[l]
    return float(chosen + rates[0] - rates[1] - births.log_total - np.log(q / E))


def table_draw(scene: Scene, births: Births, u: Array, g: Array) -> Array:
    """A centre (3,) in one of the table's balls, or anywhere."""
    if u[ANYWHERE] < scene.uniform or not len(births.points):
        return np.asarray(scene.lower + u[PLACE : PLACE + 3] * (scene.upper - scene.lower))
    w = np.cumsum(births.weight)
    j = min(int(np.searchsorted(w, u[BALL] * w[-1], side="right")), len(w) - 1)
    open_ = scene.upper > scene.lower
    n = np.where(open_, g[:3], 0.0)
    length = births.radius * u[DEPTH] ** (1 / open_.sum())
    return np.asarray(births.points[j] + length * n / np.linalg.norm(n))

"""The jump chain of one epoch: burn-in with adaptation, exploration, and samples.

During burn-in the steps are adapted, the intensities follow the detections that a sampled
labelling calls clutter, and the chain goes on until the log posterior has not risen for some
moves. Then all is fixed. Exploration, with births and deaths, tells how many targets there are;
samples, with moves only, tell where.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...models.errors import EstimatorError
from ...models.point_process import ball
from ...models.records import Array
from .kernels import posterior as gsncp
from .kernels.compiled.moves import chain
from .kernels.compiled.posterior import mean_shot
from .kernels.posterior import NORMALS, UNIFORMS, Births, Scene, State
from .params import ChainParams

START = np.array([1.0, 0.5])
"""Scales of the steps of position and extent that adaptation starts from."""
LATE = 2000
"""Moves at the end of a burn-in by whose mean log posterior two of them are compared."""


@dataclass(frozen=True, slots=True, eq=False)
class Info:
    """What a run of moves did: log posterior and cardinality after each, counts by kind."""

    trace: Array
    count: Array
    tried: Array
    accepted: Array


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """Samples (n, L, 9) of centres and extents, the chain's end, and how it got there.

    ``intensity`` (2,) and ``scale`` (2,) are those the burn-in ended with; the runs ``explored``
    and ``sampled`` were made with them.
    """

    samples: Array
    intensity: Array
    scale: Array
    burn_in: Info
    explored: Info
    sampled: Info
    last: tuple[Array, Array]


def run(
    scene: Scene,
    state: State,
    intensity: Array,
    births: Births,
    moves: Array,
    scale: Array,
    n: int,
    rng: np.random.Generator,
) -> Info:
    """``n`` moves of the kinds whose weights are ``moves`` (6,), in place."""
    U, G = rng.random((n, UNIFORMS)), rng.normal(size=(n, NORMALS))
    info = Info(np.zeros(n), np.zeros(n, np.int64), *np.zeros((2, len(gsncp.KINDS)), np.int64))
    shares = np.cumsum(moves) / np.sum(moves)
    shares[np.flatnonzero(moves)[-1] :] = 1.0
    chain(scene, state, intensity, births, shares, scale, U, G, info.trace, info.count, info.tried,
          info.accepted)  # fmt: skip
    return info


def joined(runs: list[Info]) -> Info:
    """Runs one after the other as one."""
    none = np.zeros(len(gsncp.KINDS), np.int64)
    return Info(
        np.concatenate([np.zeros(0), *(r.trace for r in runs)]),
        np.concatenate([np.zeros(0, np.int64), *(r.count for r in runs)]),
        sum((r.tried for r in runs), none),
        sum((r.accepted for r in runs), none),
    )


def sample(
    scene: Scene,
    params: ChainParams,
    starts: list[tuple[Array, Array]],
    intensity: Array | None,
    rng: np.random.Generator,
) -> Result:
    """Run the chain from the best of ``starts``, each of centres (L, 3) and extents (L, 6).

    A burn-in is made from every one, and the one goes on whose log posterior ends higher.

    Raises
    ------
    EstimatorError : the log posterior is not finite
    """
    D = gsncp.free(scene.lower, scene.upper)[1]
    if intensity is None:
        half = max(len(scene.weight) / 2 / max(len(scene.offset) - 1, 1), 1e-3)
        intensity = np.array([max(len(starts[0][0]), 1) / D, half / D])
    burnt = []
    for start in starts:
        state = gsncp.empty(scene, max(params.places(len(scene.weight)), len(start[0])))
        put(state, *start)
        burnt.append((state, *burn_in(scene, params, state, known(params, intensity, D), rng)))
    state, _, intensity, scale = max(burnt, key=lambda b: float(b[1].trace[-LATE:].mean()))
    explored = explore(scene, params, state, intensity, scale, rng)
    samples, sampled = draw(scene, params, state, intensity, scale, rng)
    runs = joined([info for _, info, _, _ in burnt])
    return Result(samples, intensity, scale, runs, explored, sampled, targets(state))


def burn_in(
    scene: Scene, params: ChainParams, state: State, intensity: Array, rng: np.random.Generator
) -> tuple[Info, Array, Array]:
    """Adapt steps and intensities until the log posterior has not risen for some moves."""
    D, moves, scale = gsncp.free(scene.lower, scene.upper)[1], np.array(params.moves), START.copy()
    runs: list[Info] = []
    best, since, done = -np.inf, 0, 0
    while done < params.burn_in or (since < params.patience and done < params.max_burn_in):
        births = table(scene, params, intensity, moves, rng)
        info = run(scene, state, intensity, births, moves, scale, params.block, rng)
        runs.append(info)
        if not np.isfinite(info.trace).all():
            raise EstimatorError("the log posterior is not finite")
        adapt(scale, info, params.acceptance)
        gain = 1 / min(len(runs), params.smoothing)
        target = known(params, labelled(scene, params, state, intensity, rng), D)
        intensity = intensity + gain * (target - intensity)
        done, since = done + params.block, since + params.block
        if info.trace.max() > best:
            best, since = info.trace.max(), params.block - 1 - int(info.trace.argmax())
    return joined(runs), intensity, scale


def explore(
    scene: Scene,
    params: ChainParams,
    state: State,
    intensity: Array,
    scale: Array,
    rng: np.random.Generator,
) -> Info:
    """Let the number of targets vary; leave the best state that has the most frequent number.

    Of the numbers that a block of moves ended with, so that there is such a state even where the
    number is undecided. Ends once it has been the same for ``params.explore`` moves.
    """
    moves, runs, kept, done, same = np.array(params.moves), [], [], 0, 0
    while same < params.explore and done < params.max_explore:
        before = state.size[0]
        births = table(scene, params, intensity, moves, rng)
        info = run(scene, state, intensity, births, moves, scale, params.block, rng)
        runs.append(info)
        kept.append((info.trace[-1], targets(state)))
        steady = (info.count == before).all()
        done, same = done + params.block, same + params.block if steady else 0
    whole = joined(runs)
    if kept:
        usual = max({len(c) for _, (c, _) in kept}, key=lambda L: int((whole.count == L).sum()))
        put(state, *max((k for k in kept if len(k[1][0]) == usual), key=lambda k: k[0])[1])
    return whole


def draw(
    scene: Scene,
    params: ChainParams,
    state: State,
    intensity: Array,
    scale: Array,
    rng: np.random.Generator,
) -> tuple[Array, Info]:
    """Samples (n, L, 9) by moves that leave the number of targets as it is."""
    none = Births(np.zeros((0, 3)), np.zeros(0), 1.0, 0.0)
    steps = np.where(np.arange(len(gsncp.KINDS)) <= gsncp.EXTENT, params.moves, 0.0)
    samples, runs = [], []
    for _ in range(params.samples):
        runs.append(run(scene, state, intensity, none, steps, scale, params.thin, rng))
        samples.append(np.hstack(targets(state)))
    return np.array(samples), joined(runs)


def targets(state: State) -> tuple[Array, Array]:
    """Centres (L, 3) and extents (L, 6) of a state."""
    L = state.size[0]
    return state.c[:L].copy(), state.e[:L].copy()


def put(state: State, c: Array, e: Array) -> None:
    """Let the targets be c (L, 3), e (L, 6); the chain computes what follows from them."""
    state.eta[: state.size[0]] = 0.0
    state.size[0] = len(c)
    state.c[: len(c)], state.e[: len(c)] = c, e


def adapt(scale: Array, info: Info, acceptance: float) -> None:
    """Longer steps where more are accepted than wanted, shorter ones where fewer are."""
    for i in (gsncp.POSITION, gsncp.EXTENT):
        if info.tried[i]:
            excess = info.accepted[i] / info.tried[i] - acceptance
            scale[i] *= np.exp(excess * min(info.tried[i] / 50, 1.0))
    scale[:] = np.clip(scale, 1e-3, 10.0)


def labelled(
    scene: Scene, params: ChainParams, state: State, intensity: Array, rng: np.random.Generator
) -> Array:
    """Intensities (lambda, lambda_c) of a sampled labelling of the detections as clutter."""
    L = int(state.size[0])
    clutter = rng.random(len(state.shot)) * (intensity[1] + state.shot) < intensity[1]
    if params.room:
        volume = gsncp.room(scene, state.c[:L])
    else:
        volume = gsncp.free(scene.lower, scene.upper)[1]
    return gsncp.intensities(scene, L, state.rho[:L].sum(), clutter, volume)


def known(params: ChainParams, intensity: Array, D: float) -> Array:
    """The intensities, with what the parameters state in their place."""
    stated = params.intensity, None if params.clutter_rate is None else params.clutter_rate / D
    return np.array([x if s is None else s for x, s in zip(intensity, stated, strict=True)])


def table(
    scene: Scene, params: ChainParams, intensity: Array, moves: Array, rng: np.random.Generator
) -> Births:
    """The paper's birth rates around a thinning of the detections, for extents from their prior."""
    d = int((scene.upper > scene.lower).sum())
    D, E = (gsncp.free(*x)[1] for x in ((scene.lower, scene.upper), (scene.e_lower, scene.e_upper)))
    if not moves[gsncp.JUMP]:
        return Births(np.zeros((0, 3)), np.zeros(0), 1.0, 0.0)
    M = len(scene.weight)
    points = scene.z.T[rng.random(M) < params.table_points / max(M, 1)]
    points = points[gsncp.inside(points, scene.lower, scene.upper)]
    if not len(points):
        return Births(points, np.zeros(0), 1.0, float(np.log(intensity[0] * D * E)))
    e = rng.uniform(scene.e_lower, scene.e_upper, (params.table_extents, 6))
    rate = intensity[0] * (1 + mean_shot(scene, points, e) / intensity[1])
    rate *= ball(params.table_radius, d) * E
    return Births(points, rate / rate.sum(), params.table_radius, float(np.log(rate.sum())))

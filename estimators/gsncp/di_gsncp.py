"""DI-GSNCP: extended targets from the detections of many scans of many sensors, by a jump chain.

Every epoch (all scans of one time) processes the detections of the epochs so far and starts from
the estimate of the epoch before. The posterior stands in :mod:`.kernels.posterior`, its moves in
:mod:`.kernels.moves`, the chain in :mod:`.chain`. The preset ``paper`` has the paper's
moves: steps of position and extent, and births and deaths by their total rates; but a patience of
10,000 moves, since most of those births fall beside targets that are known already. The default has
births near unexplained detections, relocations, steps that follow from the detections expected, and
a second start, from clusters and later from nothing, since an estimate that straddles two targets
holds on to its place.

References
----------
Efficient sensing of multiple extended targets by a doubly inhomogeneous generalised shot noise Cox
process and jump Markov chain Monte Carlo sampling, sections 3 and 4.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from logging import getLogger
from typing import Any

import numpy as np

from ...models.errors import InputError
from ...models.parameters import parameter
from ...models.records import Array, Estimates, Recording, Scan
from ..presets import Presets
from . import dbscan
from .chain import Result, sample
from .kernels.chains import effective_sample_size
from .kernels.posterior import Scene, columns, feasible
from .output import Labels, objects
from .params import ChainParams, SceneParams
from .scene import epochs, grid, scene
from .sensors import STREAMS, SensorState, resolved

SUMMARY = "extended targets from multi-sensor multi-scan detections by jump MCMC (DI-GSNCP)"
PRESETS = Presets(__package__, "di-gsncp")
NOTHING = np.zeros((0, 3)), np.zeros((0, 6))
"""No targets."""
KEPT = 64
"""Targets whose samples are kept where no largest number is stated."""
TRACE = 100
"""Points of a trace that the diagnostics keep."""
_log = getLogger(__name__)
__all__ = ["PRESETS", "STREAMS", "SUMMARY", "Params", "estimate", "resolved", "scenes"]


@dataclass(frozen=True, slots=True)
class Params(ChainParams):
    """Prior and sensors, moves, and what is processed and kept."""

    TITLE = "what is processed and kept"

    epochs: int = parameter(
        0, "1", "epochs processed together, 0 for all so far", within="[0, inf)"
    )
    keep: bool = parameter(False, "1", "keep the samples, as values per step")


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """Yield the posterior means of the targets after each epoch.

    Raises
    ------
    InputError : region, noise or detection probability are not known or not possible, or the
        detections need more memory than there may be
    EstimatorError : the log posterior is not finite
    """
    start, intensity = NOTHING, None
    labels, cut = Labels(), False
    for time_ns, sight in scenes(setup, scans, params):
        starts = [start]
        if params.restart:
            starts.append(clusters(sight, params) if intensity is None else NOTHING)
        result = sample(sight, params, starts, intensity, rng)
        mean, P = spread(result.samples)
        start, intensity = (mean[:, :3], mean[:, 3:]), result.intensity
        label = labels.of(mean[:, :3], max(params.hard_core_radius, 1.0) / 2)
        steps = diagnostics(result) | {"cut": np.zeros(1)}
        places = params.places(len(sight.weight))
        if max(r.count.max(initial=0) for r in (result.burn_in, result.explored)) >= places:
            if not cut:
                _log.warning("all %d places were taken: there may be more, see max_targets", places)
            cut, lost = True, left_out(sight, result, params)
            steps["cut"] = np.array([lost])
            # Of those without a place no more is known than how many to expect.
            for name in ("cardinality_mean", "cardinality_variance"):
                steps[name] = steps[name] + lost
        if params.keep:
            n, L, _ = result.samples.shape
            if (places := params.max_targets or KEPT) < L:
                raise InputError(f"keep holds {places} targets, of {L}: raise max_targets")
            kept = np.zeros((1, n, places, 9))
            kept[0, :, :L] = result.samples[:, np.argsort(label)]
            steps["samples"] = kept
        yield Estimates(setup.meta, objects(time_ns, mean, label, params.dimension, P), steps)
        if not feasible(sight, *start):
            start = result.last


def clusters(sight: Scene, params: Params) -> tuple[Array, Array]:
    """Centres (L, 3) and extents (L, 6) of the best clusters, as far as the prior has them.

    The published radii are those for births a metre around detections, and scale with it.
    """
    shared = {name: getattr(params, name) for name in SceneParams.__match_args__}
    radii = tuple(params.spread * r for r in dbscan.Params().radii)
    x = dbscan.best(sight, dbscan.Params(**shared, radii=radii), 1)
    apart = np.zeros((0, 9))
    for target in np.hstack([np.clip(x[:, :3], *params.box), x[:, 3:]]):
        if (np.linalg.norm(apart[:, :3] - target[:3], axis=1) >= sight.radius).all():
            apart = np.vstack([apart, target])
    return apart[:, :3], apart[:, 3:]


def left_out(sight: Scene, result: Result, params: Params) -> float:
    """How many targets there were no places for: clusters of what none of the others explains."""
    targets = result.last[0]
    shot = columns(sight, *result.last)[1].sum(0)
    rest = among(sight, shot < result.intensity[1])
    found, _ = clusters(rest, replace(params, max_targets=0))
    gap = np.linalg.norm(found[:, None] - targets, axis=-1).min(1, initial=np.inf)
    return float((gap >= sight.radius).sum())


def among(sight: Scene, chosen: Array) -> Scene:
    """The scene with those of its detections that are ``chosen`` (M,)."""
    count = np.concatenate([[0], np.cumsum(chosen)])[sight.offset].astype(np.int64)
    z = np.ascontiguousarray(sight.z[:, chosen])
    beyond, weight = sight.beyond[chosen], sight.weight[chosen]
    return sight._replace(z=z, offset=count, beyond=beyond, weight=weight)


def scenes(setup: Recording, scans: Iterable[Scan], params: Params) -> Iterator[tuple[int, Scene]]:
    """After each epoch its time [ns] and the scene of the epochs so far."""
    nodes = grid(params, setup)
    births = {k: getattr(params, k) for k in ("spread", "uniform", "informed")}
    seen: list[list[SensorState]] = []
    for time_ns, states in epochs(params, setup, scans, nodes):
        seen = [*seen, states][-params.epochs :]
        yield time_ns, scene(params, (s for epoch in seen for s in epoch), nodes, **births)


def spread(x: Array) -> tuple[Array, Array]:
    """Mean (L, 9) and covariance (L, 9, 9) of samples x (n, L, 9)."""
    away = x - x.mean(0)
    return x.mean(0), np.einsum("nli,nlj->lij", away, away) / max(len(x) - 1, 1)


def effective(x: Array) -> float:
    """Least effective number among the coordinates of samples x (n, L, 9), which make the mean."""
    moving = np.flatnonzero(np.ptp(x, axis=0).any(0))
    sizes = [
        effective_sample_size(x[:, l, i]) if np.ptp(x[:, l, i]) else 1.0
        for l in range(x.shape[1])
        for i in moving
    ]
    return min(sizes, default=float(len(x)))


def diagnostics(result: Result) -> dict[str, Array]:
    """What the chain tells about itself, one value or array for the step."""
    runs = (result.burn_in, result.explored, result.sampled)
    trace = np.concatenate([r.trace for r in runs])
    count = np.concatenate([r.count for r in runs])
    at = np.linspace(0, len(trace) - 1, TRACE).round().astype(int)
    settled = result.explored if len(result.explored.count) else result.sampled
    acceptance = sum(r.accepted for r in runs) / np.maximum(sum(r.tried for r in runs), 1)
    values: dict[str, Any] = {
        "cardinality_mean": settled.count.mean(),
        "cardinality_variance": settled.count.var(),
        "iterations": float(len(trace)),
        "burn_in": float(len(result.burn_in.trace)),
        "log_posterior": result.sampled.trace.mean(),
        "log_posterior_explored": settled.trace.mean(),
        "effective_sample_size": effective(result.samples),
        "intensity": result.intensity[0],
        "clutter_intensity": result.intensity[1],
        "acceptance": acceptance,
        "log_posterior_trace": trace[at],
        "cardinality_trace": count[at].astype(float),
    }
    return {k: np.asarray(v, float)[None] for k, v in values.items()}

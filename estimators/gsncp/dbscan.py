"""Clusters of nearby detections as extended targets: the baseline of low complexity.

DBSCAN runs over a grid of neighbourhoods and least numbers of neighbours; of the configurations
the one with the best log posterior of :mod:`.kernels.posterior` wins. The position of a cluster is
the mean of its detections, weighted by the inverse of the sensor's covariance plus that of a mean
extent; its extent is their scatter less the sensor's covariance, in the box of the prior. Ester et
al., A density-based algorithm for discovering clusters, KDD 1996.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from ...models import extent
from ...models.parameters import parameter, require
from ...models.records import Array, Estimates, Recording, Scan
from ..kernels.clusters import clusters
from ..presets import Presets
from .kernels import posterior as gsncp
from .kernels.compiled import posterior as compiled
from .kernels.posterior import Scene, State
from .oracle import fit
from .output import Labels, objects
from .params import SceneParams
from .scene import epochs, grid, scene
from .sensors import STREAMS, noise

SUMMARY = "extended targets as DBSCAN clusters, the configuration of best posterior"
PRESETS = Presets(__package__, "dbscan")
__all__ = ["PRESETS", "STREAMS", "SUMMARY", "Params", "clusters", "estimate"]


@dataclass(frozen=True, slots=True)
class Params(SceneParams):
    """The configurations that are tried."""

    TITLE = "clusters"

    radii: tuple[float, ...] = parameter(
        (0.5, 1.0, 1.5, 2.0, 2.5, 3.0), "m", "neighbourhoods (eps)", within="(0, inf)"
    )
    neighbours: tuple[int, ...] = parameter(
        (1, 2, 3, 4, 5, 6, 7),
        "1",
        "least neighbours per epoch (min_samples), itself included",
        within="[1, inf)",
    )
    epochs: int = parameter(
        0, "1", "epochs processed together, 0 for all so far", within="[0, inf)"
    )

    def __post_init__(self) -> None:
        SceneParams.__post_init__(self)
        require(len(self.radii) > 0, "radii", "one at least", self.radii)
        require(len(self.neighbours) > 0, "neighbours", "one at least", self.neighbours)


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """Yield the best clusters after each epoch.

    Raises
    ------
    InputError : region, noise or detection probability are not known or not possible
    """
    nodes = grid(params, setup)
    births = {"spread": 1.0, "uniform": 1.0, "informed": True}
    labels = Labels()
    seen: list[Any] = []
    for time_ns, states in epochs(params, setup, scans, nodes):
        seen = [*seen, states][-params.epochs :]
        flat = [s for epoch in seen for s in epoch]
        sight = scene(params, flat, nodes, **births)
        z = sight.z.T
        S = noise(flat, nodes, [s.z for s in flat])
        best, x = -np.inf, np.zeros((0, 9))
        state = gsncp.empty(sight, params.max_targets)
        for label in configurations(z[:, : params.dimension], params, len(seen)):
            if label.max(initial=-1) < params.max_targets:
                found = targets(z, S, label, params)
                score = log_posterior(sight, state, found, label)
                if score > best:
                    best, x = score, found
        count = {"cardinality_mean": np.array([len(x)], float), "cardinality_variance": np.zeros(1)}
        names = labels.of(x[:, :3], max(params.hard_core_radius, 1.0) / 2)
        yield Estimates(setup.meta, objects(time_ns, x, names, params.dimension), count)


def configurations(z: Array, params: Params, scale: int) -> Iterator[Array]:
    """Labels (M,) of every configuration; ``scale`` epochs multiply the numbers of neighbours."""
    tree = cKDTree(z)
    for radius in params.radii:
        pairs = tree.query_pairs(radius, output_type="ndarray").reshape(-1, 2)
        for least in params.neighbours:
            yield clusters(pairs, len(z), least * scale)


def targets(z: Array, S: Array, label: Array, params: Params) -> Array:
    """Centres and extents (L, 9) of the clusters of z (M, 3) with noise S (M, 3, 3)."""
    lower, upper = params.extent_box
    E = extent.covariance((lower + upper) / 2)
    x = np.zeros((label.max(initial=-1) + 1, 9))
    for l in range(len(x)):
        mine = label == l
        x[l] = fit(z[mine], S[mine], None, E, (lower, upper), params.dimension)
    return np.asarray(np.clip(x, [*params.box[0], *lower], [*params.box[1], *upper]))


def log_posterior(sight: Scene, state: State, x: Array, label: Array) -> float:
    """The log posterior of targets x (L, 9), with the intensities that their labels amount to.

    Clusters within the hard core are held against a configuration, but do not rule it out, so
    that one always wins: by more than any likelihood could make good.
    """
    L, M, K = len(x), len(label), len(sight.offset) - 1
    state.size[0], state.c[:L], state.e[:L] = L, x[:, :3], x[:, 3:]
    compiled.refresh(sight, state)
    D = gsncp.free(sight.lower, sight.upper)[1]
    clutter = float((label < 0).sum())
    rho = state.rho[:L].sum()
    intensity = np.maximum(1e-5, [L * (M - clutter) / (D * rho) if L else 0.0, clutter / (K * D)])
    close = 0 if gsncp.feasible(sight, x[:, :3], x[:, 3:]) else 1e9
    return compiled.log_posterior(sight, state, intensity) - close

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
from scipy.spatial.distance import pdist

from ...models.geometry import extent
from ...models.geometry.grids import Grid
from ...models.parameters import parameter, require
from ...models.records import Array, Estimates, Recording, Scan
from ..presets import Presets
from .chain import put
from .kernels import posterior as gsncp
from .kernels.compiled import posterior as compiled
from .kernels.compiled.neighbours import cells, counts, labels
from .kernels.posterior import Scene, State
from .oracle import fit
from .output import Labels, objects
from .params import SceneParams
from .scene import epochs, grid, scene
from .sensors import STREAMS, noise, resolved

SUMMARY = "extended targets as DBSCAN clusters, the configuration of best posterior"
PRESETS = Presets(__package__, "dbscan")
__all__ = ["PRESETS", "STREAMS", "SUMMARY", "Params", "estimate", "resolved"]


@dataclass(frozen=True, slots=True)
class Params(SceneParams):
    """The configurations that are tried."""

    TITLE = "clusters"

    radii: tuple[float, ...] = parameter(
        (0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5, 3.0),
        "m",
        "neighbourhoods (eps)",
        within="(0, inf)",
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
    persistent = Labels()
    seen: list[Any] = []
    for time_ns, states in epochs(params, setup, scans, nodes):
        seen = [*seen, states][-params.epochs :]
        flat = [s for epoch in seen for s in epoch]
        x = best(scene(params, flat, nodes, **births), params, len(seen))
        count = {"cardinality_mean": np.array([len(x)], float), "cardinality_variance": np.zeros(1)}
        names = persistent.of(x[:, :3], max(params.hard_core_radius, 1.0) / 2)
        yield Estimates(setup.meta, objects(time_ns, x, names, params.dimension), count)


def best(sight: Scene, params: Params, scale: int) -> Array:
    """Centres and extents (L, 9) of the configuration of best posterior, of ``scale`` epochs."""
    z = sight.z.T
    nodes = Grid(sight.origin, sight.spacing, sight.table.shape[1:4])
    S = noise(sight.table, nodes, np.split(z, sight.offset[1:-1]))
    highest, x = -np.inf, np.zeros((0, 9))
    places = params.places(len(z))
    state = gsncp.empty(sight, places)
    for every in configurations(z[:, : params.dimension], params, scale):
        label = within(z, every, params)
        if label.max(initial=-1) < places:
            found = targets(z, S, label, params)
            score = log_posterior(sight, state, found, label)
            if score > highest:
                highest, x = score, found
    return x


def configurations(z: Array, params: Params, scale: int) -> Iterator[Array]:
    """Labels (M,) of every configuration; ``scale`` epochs multiply the numbers of neighbours."""
    most = max(params.neighbours) * scale
    for radius in params.radii:
        grid = cells(z, radius)
        count = counts(grid, most)
        for least in params.neighbours:
            yield labels(grid, count >= least * scale)


def targets(z: Array, S: Array, label: Array, params: Params) -> Array:
    """Centres and extents (L, 9) of the clusters of z (M, 3) with noise S (M, 3, 3)."""
    lower, upper = params.extent_box
    E = extent.covariance((lower + upper) / 2)
    x = np.zeros((label.max(initial=-1) + 1, 9))
    for l in range(len(x)):
        mine = label == l
        x[l] = fit(z[mine], S[mine], None, E, (lower, upper), params.dimension)
    return x


def within(z: Array, label: Array, params: Params) -> Array:
    """Labels (M,) of the clusters that have a detection in the region, numbered anew."""
    kept = np.unique(label[gsncp.inside(z, *params.box) & (label >= 0)])
    number = np.full(label.max(initial=-1) + 2, -1)
    number[kept] = np.arange(len(kept))
    return number[label]


def log_posterior(sight: Scene, state: State, x: Array, label: Array) -> float:
    """The log posterior of targets x (L, 9), with the intensities that their labels amount to.

    Clusters within the hard core are held against a configuration, but do not rule it out, so
    that one always wins: by more than any likelihood could make good. A mean beyond the border,
    of a cluster that straddles it, is not.
    """
    L = len(x)
    put(state, x[:, :3], x[:, 3:])
    compiled.refresh(sight, state)
    D = gsncp.free(sight.lower, sight.upper)[1]
    intensity = gsncp.intensities(sight, L, state.rho[:L].sum(), label < 0, D)
    close = 1e9 if (pdist(x[:, :3]) < sight.radius).any() else 0.0
    return compiled.log_posterior(sight, state, intensity) - close

"""Clusters by cells against those by pairs, and what they take."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from scipy.spatial import cKDTree

from echoset.estimators.gsncp.kernels.compiled.neighbours import cells, counts, labels
from echoset.estimators.kernels.clusters import clusters


def points(kind: str, d: int, rng: np.random.Generator) -> np.ndarray:
    """Points (n, d): uniform, in heaps, or on a lattice with many pairs just at the radius."""
    if kind == "uniform":
        return rng.uniform(0, 6, (300, d))
    if kind == "heaps":
        return np.vstack([rng.normal(rng.uniform(0, 8, d), 0.4, (60, d)) for _ in range(6)])
    return rng.integers(0, 6, (150, d)).astype(float)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("kind", ["uniform", "heaps", "lattice"])
def test_clusters_are_those_of_the_pairs(kind, d):
    rng = np.random.default_rng(d)
    for _ in range(20):
        z = points(kind, d, rng)
        radius = 1.0 if kind == "lattice" else rng.uniform(0.2, 1.5)
        pairs = cKDTree(z).query_pairs(radius, output_type="ndarray").reshape(-1, 2)
        grid = cells(z, radius)
        count = counts(grid, 12)
        exact = 1 + np.bincount(pairs.ravel(), minlength=len(z))
        np.testing.assert_array_equal(count, np.minimum(exact, 12)[grid.order])
        for least in (1, 2, 5, 12):
            found = labels(grid, count >= least)
            np.testing.assert_array_equal(found, clusters(pairs, len(z), least))


@pytest.mark.parametrize("n", [0, 1])
def test_hardly_a_point(n):
    grid = cells(np.zeros((n, 3)), 1.0)
    assert labels(grid, counts(grid, 3) >= 1).tolist() == [0] * n
    assert labels(grid, counts(grid, 3) >= 2).tolist() == [-1] * n


def test_memory_does_not_grow_with_the_pairs():
    z = np.random.default_rng(0).normal(size=(24_000, 3))
    tracemalloc.start()
    grid = cells(z, 3.0)
    label = labels(grid, counts(grid, 42) >= 42)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert label.max() == 0
    assert peak < 2e7  # the pairs would take 4 GB

"""DBSCAN in a grid of cells, in time and memory linear in the number of points.

Cells are so small that all points of one are neighbours: what is dense is found without looking at
pairs, and two cells are joined by the first pair of their core points that are neighbours. Gives
the labels of :func:`echoset.estimators.kernels.clusters.clusters`. A. Gunawan, A faster algorithm
for DBSCAN, 2013.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from .....models.records import Array


class Cells(NamedTuple):
    """Points z (n, d) in the order of their cells, ``order`` (n,) of the given ones.

    Those of cell i are ``start[i]:start[i + 1]``; neighbours of its points may be in the cells
    ``beside[first[i]:first[i + 1]]``. ``radius2`` is the squared radius of neighbourhoods.
    """

    z: Array
    order: Array
    start: Array
    first: Array
    beside: Array
    radius2: float


def cells(z: Array, radius: float) -> Cells:
    """Points z (n, d) in cells whose diagonal is ``radius``."""
    d = z.shape[1]
    side = radius / np.sqrt(d) * (1 - 1e-12)
    index = np.floor((z - z.min(0, initial=np.inf)) / side).astype(np.int64)
    order = np.lexsort(index.T)
    index = index[order]
    new = np.flatnonzero(np.append(True, (index[1:] != index[:-1]).any(1))[: len(z)])
    place = index[new]
    # Between cells two apart along every axis there is just the diagonal of one.
    pairs = cKDTree(place).query_pairs(2.5, p=np.inf, output_type="ndarray").reshape(-1, 2)
    both = np.vstack([pairs, pairs[:, ::-1]])
    both = both[np.lexsort(both.T[::-1])]
    first = np.searchsorted(both[:, 0], np.arange(len(new) + 1))
    start = np.append(new, len(z))
    return Cells(np.ascontiguousarray(z[order]), order, start, first, both[:, 1].copy(), radius**2)


@njit(cache=True, error_model="numpy")
def near(a: Array, b: Array, radius2: float) -> bool:
    """Whether two points are neighbours."""
    d2 = 0.0
    for i in range(len(a)):
        d2 += (a[i] - b[i]) ** 2
    return bool(d2 <= radius2)


@njit(cache=True, error_model="numpy")
def counts(cells: Cells, most: int) -> Array:
    """Number (n,) of neighbours of each point of the cells, itself included, up to ``most``."""
    n = np.zeros(len(cells.z), np.int64)
    for i in range(len(cells.start) - 1):
        own = cells.start[i + 1] - cells.start[i]
        for p in range(cells.start[i], cells.start[i + 1]):
            n[p] = own
            for j in cells.beside[cells.first[i] : cells.first[i + 1]]:
                if n[p] >= most:
                    break
                for q in range(cells.start[j], cells.start[j + 1]):
                    n[p] += near(cells.z[p], cells.z[q], cells.radius2)
                    if n[p] >= most:
                        break
            n[p] = min(n[p], most)
    return n


@njit(cache=True, error_model="numpy")
def root(parent: Array, i: int) -> int:
    """The cell that stands for the component of cell i."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@njit(cache=True, error_model="numpy")
def touches(cells: Cells, core: Array, p: int, j: int) -> bool:
    """Whether point p has a core point of cell j as neighbour."""
    for q in range(cells.start[j], cells.start[j + 1]):
        if core[q] and near(cells.z[p], cells.z[q], cells.radius2):
            return True
    return False


@njit(cache=True, error_model="numpy")
def labels(cells: Cells, core: Array) -> Array:
    """DBSCAN's label (n,) of the points as given; ``core`` (n,), by cells, tells the dense ones."""
    n, count = len(cells.z), len(cells.start) - 1
    parent = np.arange(count)
    cell, at = np.zeros(n, np.int64), np.zeros(n, np.int64)
    dense = np.zeros(count, np.bool_)
    for i in range(count):
        dense[i] = core[cells.start[i] : cells.start[i + 1]].any()
    for i in range(count):
        for j in cells.beside[cells.first[i] : cells.first[i + 1]]:
            if j < i and dense[i] and dense[j] and root(parent, i) != root(parent, j):
                for p in range(cells.start[i], cells.start[i + 1]):
                    if core[p] and touches(cells, core, p, j):
                        parent[root(parent, i)] = root(parent, j)
                        break
    # clusters are in the order of their first core point
    for i in range(count):
        cell[cells.start[i] : cells.start[i + 1]] = i
    at[cells.order] = np.arange(n)
    number, found = np.full(count, -1), 0
    for given in at:
        top = root(parent, cell[given])
        if core[given] and number[top] < 0:
            number[top] = found
            found += 1
    label = np.full(n, -1)
    for p in range(n):
        i = cell[p]
        best = number[root(parent, i)] if dense[i] else n
        if not core[p]:
            for j in cells.beside[cells.first[i] : cells.first[i + 1]]:
                if dense[j] and number[root(parent, j)] < best and touches(cells, core, p, j):
                    best = number[root(parent, j)]
        label[cells.order[p]] = best if best < n else -1
    return label

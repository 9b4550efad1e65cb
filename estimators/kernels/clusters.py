"""DBSCAN from pairs of neighbours.

M. Ester et al., "A density-based algorithm for discovering clusters in large spatial databases with
noise", KDD 1996.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from ...models.records import Array


def clusters(pairs: Array, n: int, least: int) -> Array:
    """DBSCAN's label of each of n points, -1 for noise, from the pairs (k, 2) of neighbours.

    Core points have ``least`` neighbours, themselves included; clusters are the components of the
    core points, in the order of their first; others belong to the first cluster they border on.
    """
    core = 1 + np.bincount(pairs.ravel(), minlength=n) >= least
    i, j = pairs.T
    both = core[i] & core[j]
    graph = coo_array((np.ones(both.sum(), bool), (i[both], j[both])), shape=(n, n))
    component = connected_components(graph, directed=False)[1]
    label = np.full(n, n)
    _, first, index = np.unique(component[core], return_index=True, return_inverse=True)
    label[core] = np.argsort(np.argsort(first))[index]
    for a, b in ((i, j), (j, i)):
        edge = core[a] & ~core[b]
        np.minimum.at(label, b[edge], label[a[edge]])
    return np.where(label == n, -1, label)

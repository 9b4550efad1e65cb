"""Clusters of the bright pixels of a map, and what they say of where targets are.

E. Favarelli et al., "Multi-base station cooperative sensing with AI-aided tracking", section III-B:
bright pixels go to the nearest known target within its gate, DBSCAN groups the rest, and the plain
centroid of a cluster is a detection with the sample covariance of eq. 15.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ....models.records import Array
from ...kernels.clusters import clusters


def nearest(point: Array, where: Array, gate: Array, room: Array) -> Array:
    """Index (n,) of the target in ``where`` (k, 2) nearest to each ``point`` (n, 2).

    Distances are to circles of radius ``room`` (k,) about the targets, negative inside, so that
    the large one of two neighbours gets what lies between their middles. -1 where the target's own
    middle is farther than its ``gate`` (k,); of equally near ones the first.
    """
    if not len(where):
        return np.full(len(point), -1)
    d = np.sqrt(((point[:, None] - where) ** 2).sum(2))
    index = (d - room).argmin(1)
    return np.where(d[np.arange(len(point)), index] <= gate[index], index, -1)


def dbscan(mask: Array, reach2: int, least: int) -> Array:
    """DBSCAN's label (n,) of each true pixel of ``mask`` (ny, nx), row by row; -1 for noise.

    Neighbours are at most the square root of ``reach2`` pixels apart; a core pixel has ``least``
    of them, itself included. Labels are those of scikit-learn for the pixels in this order.
    """
    point = np.argwhere(mask)
    tree = cKDTree(point)
    pairs = tree.query_pairs(np.sqrt(reach2 + 0.5), output_type="ndarray").reshape(-1, 2)
    return clusters(pairs, len(point), least)


def summary(point: Array, label: Array, count: int, cell: float) -> tuple[Array, Array, Array]:
    """Sizes (count,), centroids (count, 2) and covariances (count, 2, 2) of the clusters.

    ``point`` (n, 2) are the centres of pixels of side ``cell`` [m], ``label`` (n,) says which
    cluster each belongs to, -1 for none. The covariance is the sample covariance (eq. 15), which a
    single pixel does not have, and the variance cell^2 / 12 of a place within a pixel.
    """
    inside = label >= 0
    point, label = point[inside], label[inside]
    n = np.bincount(label, minlength=count)
    z = np.stack([np.bincount(label, p, count) for p in point.T], 1) / np.maximum(n, 1)[:, None]
    x, y = (point - z[label]).T
    xx, xy, yy = (np.bincount(label, v, count) for v in (x * x, x * y, y * y))
    S = np.stack((np.stack((xx, xy), -1), np.stack((xy, yy), -1)), -2)
    R = S / np.maximum(n - 1, 1)[:, None, None] + cell**2 / 12 * np.eye(2)
    return n, z, R

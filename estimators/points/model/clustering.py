"""Several detections of a target as one: clusters in front of filters of points.

Detections of a scan that are near each other, in place and Doppler, become their mean. M. Ester et
al., "A density-based algorithm for discovering clusters in large spatial databases with noise", KDD
1996; what that calls noise stays as it is, since a target may have one detection, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi

import numpy as np
from scipy.spatial import cKDTree

from ....models.parameters import parameter
from ....models.records import Array, Scan
from ...kernels.clusters import clusters

PRIOR = 3.0
"""Detections that what is assumed of the noise counts for, beside how far those of a cluster lie
apart."""


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class ClusterParams:
    """Whether detections that are near each other are one."""

    TITLE = "clusters"

    cluster: str = parameter(
        "none",
        "1",
        "none: each detection is of a target or of clutter; dbscan: those near each other are one",
        within=("none", "dbscan"),
    )
    cluster_radius: float = parameter(
        3.0, "m", "of dbscan: how near neighbours are", within="(0, inf)"
    )
    cluster_doppler: float = parameter(
        2.0, "m s-1", "of dbscan: how near in Doppler, where there is any", within="(0, inf)"
    )
    cluster_points: int = parameter(
        2, "1", "of dbscan: neighbours of a core point, itself included", within="[1, inf)"
    )


def clustered(params: ClusterParams, scan: Scan, polar_rows: bool, noise: Array) -> Scan:
    """The scan with one row for each cluster and each detection that is in none.

    ``noise`` (1 or n, 2, 2) is that of the detections, in their own coordinates. A mean of n has
    the covariance (sum e e^T + PRIOR noise) / (n - 1 + PRIOR) / n, which holds for bodies, too.
    """
    rows = scan.rows
    names = ("range", "azimuth") if polar_rows else ("x", "y")
    n = len(rows[names[0]])
    if n < 2:
        return scan
    label = _labels(params, rows, polar_rows)
    alone = np.flatnonzero(label < 0)
    label[alone] = label.max(initial=-1) + 1 + np.arange(len(alone))
    _, first, label, size = np.unique(
        label, return_index=True, return_inverse=True, return_counts=True
    )
    if len(size) == n:
        return scan

    def mean(values: Array) -> Array:
        return np.bincount(label, values) / size

    turned = rows[names[1]]
    if polar_rows:
        # Azimuths as turns from the first of their cluster, so that none is torn at half a turn.
        start = turned[first][label]
        turned = start + (turned - start + pi) % (2 * pi) - pi
    z = np.stack((rows[names[0]], turned), 1)
    new = {k: mean(v) for k, v in rows.items()}
    centre = np.stack([mean(v) for v in z.T], 1)
    e = z - centre[label]
    R = np.broadcast_to(noise, (n, 2, 2))
    spread = e[:, :, None] * e[:, None, :] + PRIOR * R / size[label][:, None, None]
    total = np.stack([np.bincount(label, v) for v in spread.reshape(n, 4).T], 1).reshape(-1, 2, 2)
    cov = total / ((size - 1 + PRIOR) * size)[:, None, None]
    new[names[0]], new[names[1]] = centre.T
    if polar_rows:
        new["azimuth"] = (new["azimuth"] + pi) % (2 * pi) - pi
        new |= {"std_range": np.sqrt(cov[:, 0, 0]), "std_azimuth": np.sqrt(cov[:, 1, 1])}
    else:
        new |= {"cov_xx": cov[:, 0, 0], "cov_xy": cov[:, 0, 1], "cov_yy": cov[:, 1, 1]}
    return replace(scan, rows=new)


def _labels(params: ClusterParams, rows: Mapping[str, Array], polar_rows: bool) -> Array:
    """Which cluster (n,) each detection is in, -1 for none."""
    if polar_rows:
        r, a = rows["range"], rows["azimuth"]
        columns = [r * np.cos(a), r * np.sin(a)]
    else:
        columns = [rows["x"], rows["y"]]
    scaled = [c / params.cluster_radius for c in columns]
    if "doppler" in rows:
        scaled.append(rows["doppler"] / params.cluster_doppler)
    pairs = cKDTree(np.stack(scaled, 1)).query_pairs(1.0, output_type="ndarray")
    return clusters(pairs, len(scaled[0]), params.cluster_points)

"""Distance between the extents of two objects."""

from __future__ import annotations

import numpy as np

from ...models.records import Array, Objects

PLANAR = ("circle", "ellipse")


def has_extent(objects: Objects) -> bool:
    """Whether ``objects`` have an extent that :func:`gaussian_wasserstein` measures."""
    return objects.extent_kind in PLANAR and objects.semi_axes is not None


def shape_matrix(objects: Objects) -> Array:
    """The matrices X of the ellipses {z : z^T X^-1 z <= 1}, (m, 2, 2) [m2]."""
    assert objects.semi_axes is not None
    axes = np.broadcast_to(objects.semi_axes[:, :2], (len(objects.semi_axes), 2))
    angle = np.zeros(len(axes)) if objects.rotation is None else objects.rotation
    c, s = np.cos(angle), np.sin(angle)
    R = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    return np.asarray(R * axes[:, None] ** 2 @ np.swapaxes(R, -1, -2))


def gaussian_wasserstein(A: Array, B: Array) -> Array:
    """Gaussian-Wasserstein distance (m,) [m] of shape matrices (m, 2, 2) at a common centre.

    ``d^2 = tr(A + B - 2 (A^1/2 B A^1/2)^1/2)``; the trace of the root of a 2 x 2 matrix M is
    ``(tr M + 2 (det M)^1/2)^1/2``. For equal axes directions it is the Euclidean distance between
    the vectors of semi-axes.

    References
    ----------
    Yang, Baum, Granstrom, Metrics for performance evaluation of elliptic extended object tracking
    methods, MFI 2016, eq. 14; Givens and Shortt, Michigan Math. J. 31, 1984.
    """
    det = np.linalg.det(A).clip(min=0) * np.linalg.det(B).clip(min=0)
    cross = np.sqrt(np.trace(A @ B, axis1=-2, axis2=-1).clip(min=0) + 2 * np.sqrt(det))
    square = np.trace(A + B, axis1=-2, axis2=-1) - 2 * cross
    return np.asarray(np.sqrt(square.clip(min=0)))

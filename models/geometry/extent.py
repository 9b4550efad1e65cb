"""Extents as covariances of reflection points, as triangular matrices E, and as semi-axes.

The points spread with covariance E E^T. In three dimensions
e = (E00, E10, E11, E20, E21, E22), in two e = (E00, E10, E11). The ellipsoid that records speak of
has the standard deviations as its semi-axes: factor one.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from ..records import Array

SIZE = {2: 3, 3: 6}
"""Parameters of an extent by dimension."""


def names(dimension: int) -> tuple[str, ...]:
    """Names of the parameters as state columns: e00, e10, e11, ..."""
    return tuple(f"e{i}{j}" for i, j in zip(*np.tril_indices(dimension), strict=True))


def triangular(e: Array) -> Array:
    """E (..., d, d) of the parameters e (..., 3 or 6)."""
    d = 2 if e.shape[-1] == SIZE[2] else 3
    E = np.zeros((*e.shape[:-1], d, d))
    E[(..., *np.tril_indices(d))] = e
    return E


def parameters(E: Array) -> Array:
    """Parameters e (..., 3 or 6) of the lower triangular E (..., d, d)."""
    return np.asarray(E[(..., *np.tril_indices(E.shape[-1]))])


def covariance(e: Array) -> Array:
    """Covariance E E^T (..., d, d) of the reflection points."""
    E = triangular(e)
    return np.asarray(E @ E.swapaxes(-1, -2))


def volume(e: Array) -> Array:
    """Determinant of E (...)."""
    return np.asarray(np.prod(np.diagonal(triangular(e), axis1=-2, axis2=-1), axis=-1))


def fit(S: Array, lower: Array, upper: Array) -> Array:
    """Parameters (..., 3 or 6) in the box [lower, upper] nearest to the Cholesky factor of S.

    S (..., d, d) [m2] need not be positive definite, as differences of covariances are not.
    """
    w, U = np.linalg.eigh(S)
    floor = (0.1 * np.min(lower[lower > 0], initial=1.0)) ** 2
    positive = U * np.maximum(w, floor)[..., None, :] @ U.swapaxes(-1, -2)
    return np.asarray(np.clip(parameters(np.linalg.cholesky(positive)), lower, upper))


def ellipsoid(S: Array) -> tuple[str, Array, Array]:
    """Kind, semi-axes (m, d) [m] and rotation of covariances S (m, d, d) [m2].

    The rotation is an angle (m,) of an ellipse, a unit quaternion (m, 4) of an ellipsoid.
    """
    w, U = np.linalg.eigh(S)
    U[..., 0] *= np.sign(np.linalg.det(U))[:, None]
    axes = np.sqrt(w)
    if S.shape[-1] == 2:
        return "ellipse", axes, np.arctan2(U[:, 1, 0], U[:, 0, 0])
    quaternion = Rotation.from_matrix(U).as_quat(canonical=True) if len(U) else np.zeros((0, 4))
    return "ellipsoid", axes, np.asarray(quaternion)


def from_axes(semi_axes: Array, rotation: Array) -> Array:
    """Covariances (m, d, d) [m2] whose standard deviations are the ``semi_axes`` (m, d) [m].

    The inverse of :func:`ellipsoid`.
    """
    if rotation.ndim == 2:
        R = Rotation.from_quat(rotation).as_matrix() if len(rotation) else np.zeros((0, 3, 3))
    else:
        R = in_plane(rotation)
    return np.asarray(R * semi_axes[:, None] ** 2 @ R.swapaxes(-1, -2))


def in_plane(angle: Array) -> Array:
    """Rotation matrices (..., 2, 2) by ``angle`` (...) [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)


def squared_wasserstein(A: Array, B: Array) -> Array:
    """Squared Gaussian-Wasserstein distance (m,) [m2] of covariances (m, d, d) at one centre.

    ``d^2 = tr(A + B - 2 (A^1/2 B A^1/2)^1/2)``; the trace of the root of a 2 x 2 matrix M is
    ``(tr M + 2 (det M)^1/2)^1/2``. For equal axes directions it is the Euclidean distance between
    the vectors of semi-axes.

    References
    ----------
    Yang, Baum, Granstrom, Metrics for performance evaluation of elliptic extended object tracking
    methods, MFI 2016, eq. 14; Givens and Shortt, Michigan Math. J. 31, 1984.
    """
    if A.shape[-1] == 2:
        det = np.linalg.det(A).clip(min=0) * np.linalg.det(B).clip(min=0)
        cross = np.sqrt(np.trace(A @ B, axis1=-2, axis2=-1).clip(min=0) + 2 * np.sqrt(det))
    else:
        w, U = np.linalg.eigh(A)
        root = U * np.sqrt(w.clip(min=0))[:, None] @ U.swapaxes(-1, -2)
        cross = np.sqrt(np.linalg.eigvalsh(root @ B @ root).clip(min=0)).sum(-1)
    return np.asarray((np.trace(A + B, axis1=-2, axis2=-1) - 2 * cross).clip(min=0))

"""Extents as lower triangular matrices E: reflection points spread with covariance E E^T.

In three dimensions e = (E00, E10, E11, E20, E21, E22), in two e = (E00, E10, E11). The ellipsoid
that records speak of has the standard deviations as its semi-axes: factor one.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from .records import Array

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

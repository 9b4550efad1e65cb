"""Compiled twin of :mod:`echoset.estimators.maps.kernels.fusion`."""

from __future__ import annotations

import numpy as np
from numba import njit

from .....models.records import Array


@njit(cache=True)
def add(soft: Array, power: Array, pixel: Array, corner: Array, u: Array, v: Array) -> None:
    """Add a map's ``power`` to the ``soft`` map, in place; see the definition."""
    out, flat, n = soft.reshape(-1), power.reshape(-1), power.shape[1]
    one = np.float32(1)
    for k in range(len(pixel)):
        c = corner[k]
        near = (one - v[k]) * flat[c] + v[k] * flat[c + 1]
        far = (one - v[k]) * flat[c + n] + v[k] * flat[c + n + 1]
        out[pixel[k]] += (one - u[k]) * near + u[k] * far

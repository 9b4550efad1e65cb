"""Twin of :func:`echoset.simulate.spectral.strongest_columns`."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ...models.records import Array


@njit(cache=True)
def strongest_columns(
    a: Array, D_r: Array, D_c: Array, noisy: bool, rng: np.random.Generator
) -> Array:
    """The map (R, A) of echoes a (A, L) with kernels D_r (L, R) and D_c (L, M)."""
    A, L = a.shape
    R, M = D_r.shape[1], D_c.shape[1]
    peak = np.zeros(L)
    for l in range(L):
        for r in range(R):
            peak[l] = max(peak[l], abs(D_r[l, r]))
    modulus = np.abs(D_c)
    map_ = np.zeros((R, A))
    bound, strongest = np.zeros(M), np.zeros(M)
    z, power = np.zeros(R, np.complex128), np.zeros(R)
    for d in range(A):
        bound[:] = 0.0
        for l in range(L):
            scale = abs(a[d, l]) * peak[l]
            for c in range(M):
                bound[c] += scale * modulus[l, c]
        if noisy:
            for c in range(M):
                strongest[c] = -math.log(-math.expm1(math.log(rng.random()) / R))
                bound[c] += math.sqrt(strongest[c])
        best = -1.0
        for c in np.argsort(-bound, kind="mergesort"):
            if bound[c] ** 2 <= best:
                break
            z[:] = 0.0
            for l in range(L):
                weight = a[d, l] * D_c[l, c]
                for r in range(R):
                    z[r] += weight * D_r[l, r]
            if noisy:
                index = int(rng.random() * R)
                below = math.expm1(-strongest[c])
                for r in range(R):
                    u, v = rng.random(), rng.random()
                    e = strongest[c] if r == index else -math.log1p(u * below)
                    z[r] += math.sqrt(e) * complex(
                        math.cos(2 * math.pi * v), math.sin(2 * math.pi * v)
                    )
            top = 0.0
            for r in range(R):
                power[r] = z[r].real ** 2 + z[r].imag ** 2
                top = max(top, power[r])
            if top > best:
                best = top
                map_[:, d] = power
    return map_

"""Linear algebra of a chain: matrices in which each time meets only the next.

A symmetric positive definite matrix is ``D`` (n, d, d) on its diagonal and ``U`` (n - 1, d, d)
above it. All costs are linear in n.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_solve_banded, cholesky_banded

from ....models.records import Array


class Chain(NamedTuple):
    """Diagonal blocks ``D`` (n, d, d) and the blocks ``U`` (n - 1, d, d) beside them."""

    D: Array
    U: Array


def factor(chain: Chain) -> Array:
    """Upper Cholesky factor in the band storage of LAPACK, (2 d, n d).

    Raises
    ------
    LinAlgError : the matrix is not positive definite
    """
    n, d, _ = chain.D.shape
    band = np.zeros((2 * d, n, d))
    for i in range(d):
        for j in range(i, d):
            band[2 * d - 1 - (j - i), :, j] = chain.D[:, i, j]
        for j in range(d):
            band[d - 1 - (j - i), 1:, j] = chain.U[:, i, j]
    return np.asarray(cholesky_banded(band.reshape(2 * d, n * d), check_finite=True))


def solve(band: Array, b: Array) -> Array:
    """The solution (n, d) for the right-hand side ``b`` (n, d), from the factor."""
    return np.asarray(cho_solve_banded((band, False), b.ravel()).reshape(b.shape))


def log_determinant(band: Array) -> float:
    """Of the matrix, from its factor."""
    return float(2 * np.log(band[-1]).sum())


def diagonal_of_inverse(chain: Chain) -> Array:
    """The blocks (n, d, d) on the diagonal of the inverse.

    Forward the information of the past is gathered, backward the covariance of the future added:
    ``L_k = D_k - U_k-1^T L_k-1^-1 U_k-1`` and ``P_k = L_k^-1 + G_k P_k+1 G_k^T`` with
    ``G_k = L_k^-1 U_k``.
    """
    n, d, _ = chain.D.shape
    P, G = np.empty_like(chain.D), np.empty_like(chain.U)
    I = np.eye(d)
    L = chain.D[0]
    for k in range(n):
        if k:
            L = chain.D[k] - chain.U[k - 1].T @ G[k - 1]
        both = np.linalg.solve(L, np.hstack((I, chain.U[k])) if k < n - 1 else I)
        P[k] = (both[:, :d] + both[:, :d].T) / 2
        if k < n - 1:
            G[k] = both[:, d:]
    for k in range(n - 2, -1, -1):
        P[k] += G[k] @ P[k + 1] @ G[k].T
    return np.asarray((P + P.swapaxes(1, 2)) / 2)

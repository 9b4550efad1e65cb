"""The bound on what is known in hindsight: from measurements of the past and of the future."""

from __future__ import annotations

import numpy as np

from ...models.records import Array
from .information import covariance_bounds


def smoothed_bounds(P0: Array, F: Array, Q: Array, J_z: Array) -> Array:
    """The bounds (n, d, d) on the covariance of estimates of each step from all measurements.

    They are the diagonal blocks of the inverse of the information of all states together, which is
    block-tridiagonal, found forwards by :func:`.information.covariance_bounds`, whose arguments
    these are, and then backwards: with ``S_n = Q_n + F_n P_{n-1} F_n^T`` and
    ``G_n = P_{n-1} F_n^T S_n^-1``,

        P^s_{n-1} = P_{n-1} + G_n (P^s_n - S_n) G_n^T.

    References
    ----------
    Simandl, Kralovec and Tichavsky, Filtering, predictive, and smoothing Cramer-Rao bounds for
    discrete-time nonlinear dynamic systems, Automatica 37, 2001, section 4.
    """
    P = covariance_bounds(P0, F, Q, J_z)
    for n in range(len(P) - 1, 0, -1):
        forward = F[n] @ P[n - 1]
        S = Q[n] + forward @ F[n].T
        G = np.linalg.solve(S, forward).T
        left = np.eye(len(P0)) - G @ F[n]
        # as a sum of squares, which rounding cannot make negative
        own = left @ P[n - 1] @ left.T + G @ (Q[n] + P[n]) @ G.T
        P[n - 1] = (own + own.T) / 2
    return P

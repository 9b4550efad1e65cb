"""Fisher information of a Poisson process of ranges, and the Cramér-Rao recursion on it.

The measurements of one link are a Poisson process with the intensity

    lambda(z) = background + sum_k weight_k N(z; length_k, std_k^2),

in which the lengths, and only they, depend on the state. Its information is
``int grad lambda grad lambda^T / lambda dz``; Snyder and Miller, Random Point Processes in Time and
Space, 1991, section 3.2.
"""

from __future__ import annotations

import numpy as np

from ...models.records import Array

_REACH = 8.0
_STEPS_PER_STD = 3.0


def intensity(z: Array, length: Array, std: Array, weight: Array, background: float) -> Array:
    """The intensity (n,) [1/m] at the ranges ``z`` (n,) for K paths, each array (K,)."""
    peaks, _ = _peaks(z, length, std, weight)
    return np.asarray(background + peaks.sum(1))


def _peaks(z: Array, length: Array, std: Array, weight: Array) -> tuple[Array, Array]:
    """The K Gaussian terms at ``z``, (n, K), and their standardised deviations."""
    x = (z[:, None] - length) / std
    return np.exp(-0.5 * x**2) * (weight / (np.sqrt(2 * np.pi) * std)), x


def information(
    length: Array, std: Array, weight: Array, gradient: Array, background: float
) -> Array:
    """Fisher information (d, d) of one link about a state of dimension d.

    ``length std weight`` (K,) as in the module's docstring [m, m, 1], ``gradient`` (K, d) of the
    lengths, ``background`` [1/m]. The trapezoidal rule over the ranges that the paths reach;
    Gaussians on a grid of a third of the smallest ``std`` are integrated to rounding.
    """
    low, high = (length - _REACH * std).min(), (length + _REACH * std).max()
    z, dz = np.linspace(
        low, high, 1 + int(np.ceil((high - low) / std.min() * _STEPS_PER_STD)), retstep=True
    )
    peaks, x = _peaks(z, length, std, weight)
    slope = (peaks * x) @ (gradient / std[:, None])
    rate = background + peaks.sum(1)
    return np.asarray(dz * slope.T @ (slope / np.maximum(rate, np.finfo(float).tiny)[:, None]))


def covariance_bounds(P0: Array, F: Array, Q: Array, J_z: Array) -> Array:
    """The bounds P_n = J_n^-1 (n, d, d) on the covariance of any estimate, step by step.

    ``J_n = (Q_n + F_n J_{n-1}^-1 F_n^T)^-1 + J_z,n`` with ``J_0 = P0^-1``; ``F`` and ``Q``
    (n, d, d) lead into step n, ``J_z`` (n, d, d) is the information of its measurements.

    References
    ----------
    Tichavsky, Muravchik, Nehorai, Posterior Cramér-Rao bounds for discrete-time nonlinear
    filtering, IEEE Trans. Signal Processing 46, 1998, eq. 21 (and 34-36 for linear dynamics).
    """
    P, out = P0, np.empty_like(J_z)
    for n in range(len(J_z)):
        prior = Q[n] + F[n] @ P @ F[n].T
        P = np.linalg.solve(np.eye(len(P)) + prior @ J_z[n], prior)
        P = out[n] = (P + P.T) / 2
    return out

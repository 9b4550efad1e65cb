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
"""Standard deviations to both sides of a path within which its Gaussian is not nothing."""
_WIDEST = 2.0
"""Width of a panel in units of the smallest standard deviation that reaches it."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)
_PARTS, _TOGETHER = 64, 128
"""Most parts into which a panel is cut at once, and panels that are in memory together."""


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
    lengths, ``background`` [1/m]. Gauss-Legendre's rule on panels, each at most twice as wide as
    the smallest ``std`` that reaches it, so that paths of very unlike noise cost no more than
    their own panels; what no path reaches is left out.
    """
    first, last = length - _REACH * std, length + _REACH * std
    J = np.zeros((gradient.shape[1],) * 2)
    low, width = np.array([first.min()]), np.array([last.max() - first.min()])
    while len(low):
        z, w = low[-_TOGETHER:], width[-_TOGETHER:]
        low, width = low[:-_TOGETHER], width[:-_TOGETHER]
        reached = (first < (z + w)[:, None]) & (last > z[:, None])
        least = np.where(reached, std, np.inf).min(1)
        fine = w <= _WIDEST * least
        done = fine & reached.any(1)
        J += _integral(z[done], w[done], length, std, weight, gradient, background)
        z, w = z[~fine], w[~fine]
        parts = np.ceil(np.minimum(w / (_WIDEST * least[~fine]), _PARTS)).astype(int)
        part = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
        cut = np.repeat(w / parts, parts)
        low, width = np.append(low, np.repeat(z, parts) + part * cut), np.append(width, cut)
    return J


def _integral(
    low: Array,
    width: Array,
    length: Array,
    std: Array,
    weight: Array,
    gradient: Array,
    background: float,
) -> Array:
    """The integral (d, d) over panels (n,) that begin at ``low``."""
    z = (low[:, None] + width[:, None] * (1 + _NODES) / 2).ravel()
    dz = (width[:, None] * _WEIGHTS / 2).ravel()
    peaks, x = _peaks(z, length, std, weight)
    slope = (peaks * x) @ (gradient / std[:, None])
    rate = np.maximum(background + peaks.sum(1), np.finfo(float).tiny)
    return np.asarray((dz * slope.T) @ (slope / rate[:, None]))


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

"""What ranges have too much: an offset by anchor and a scale, marginalised in each particle.

A range is ``z = (1 + s) d + b_j + noise`` with d the length of its path, j the receiving anchor.
Given the device it is linear in ``theta = (s, b_1 ... b_J)``, so that each particle holds a
Gaussian of theta and updates it by a Kalman filter; which range is direct and which is false stays
open, and the mixture is collapsed to its moments. Particles need not be spent on theta, and it can
always recover. Murphy and Russell, "Rao-Blackwellised particle filtering for dynamic Bayesian
networks", in Sequential Monte Carlo Methods in Practice (2001).

Layout: mean (N, D) and covariance (N, D, D) with D = 1 + J, or D = 0 for ranges without error.
"""

from __future__ import annotations

import numpy as np

from ....models.records import Array


def excess(length: Array, mean: Array, covariance: Array, rx: Array) -> tuple[Array, Array]:
    """Mean [m] and variance [m^2], both (L, N), of what ranges over paths (L, N) have too much."""
    b, s = mean[:, 1 + rx].T, mean[:, 0]
    shift = s * length + b
    cross, own = covariance[:, 0, 1 + rx].T, covariance[:, 1 + rx, 1 + rx].T
    return shift, own + 2 * length * cross + length**2 * covariance[:, 0, 0]


def direct(
    device: Array,
    height: Array,
    anchors: Array,
    rx: Array,
    offset: Array,
    z: Array,
    variance: Array,
    mean: Array,
    covariance: Array,
    floor: float,
    los: float,
) -> tuple[Array, Array, Array]:
    """Log-likelihood (N,) of active links, and mean and covariance of theta after them.

    ``device`` (2, N), ``height`` (N,), ``anchors`` (J, 3) [m]; links ``rx`` (L,), ``offset``
    (L + 1,) into ``z`` (M,) [m] and ``variance`` (M,) [m^2]. ``floor`` [1/m] is the density of
    ranges that are not direct, ``los`` the mean number of those that are. Range after range,
    ``log L`` grows by ``log(floor + los N(z; d + excess, S))``.
    """
    log_l, n = np.zeros(device.shape[1]), np.arange(device.shape[1])
    mean, covariance = mean.copy(), covariance.copy()
    D = mean.shape[1]
    for e, j in enumerate(rx):
        d = np.sqrt(((device.T - anchors[j, :2]) ** 2).sum(1) + (height - anchors[j, 2]) ** 2)
        H = np.zeros((len(n), D))
        if D:
            H[:, 0], H[:, 1 + j] = d, 1.0
        for l in range(offset[e], offset[e + 1]):
            K = np.einsum("nij,nj->ni", covariance, H)
            S = variance[l] + (K * H).sum(1)
            nu = z[l] - d - (H * mean).sum(1)
            t = nu**2 / (2 * S)
            g = los * np.exp(-t) * (t < 32) / np.sqrt(2 * np.pi * S)
            r = g / (floor + g)
            log_l += np.log(floor + g)
            mean += (r * nu / S)[:, None] * K
            shrink = r / S - r * (1 - r) * (nu / S) ** 2
            covariance -= shrink[:, None, None] * K[:, :, None] * K[:, None, :]
    return log_l, mean, covariance

"""What ranges have too much: an offset by anchor and a scale, marginalised in each particle.

A range is ``z = (1 + s) d + b_j + noise`` with d the length of its path, j the receiving anchor.
Given the device it is linear in ``theta = (s, b_1 ... b_J)``, so that each particle holds a
Gaussian of theta and updates it by a Kalman filter; which range is direct and which is false stays
open, and the mixture is collapsed to its moments. Particles need not be spent on theta, and it can
always recover. Murphy and Russell, "Rao-Blackwellised particle filtering for dynamic Bayesian
networks", in Sequential Monte Carlo Methods in Practice (2001).

A range may also be late: the direct path is blocked or bent, and the detour is exponential. With
the Gaussian of noise and theta it is an exponentially modified Gaussian; what is learnt of theta
follows from derivatives of the likelihood.

Layout: mean (N, D) and covariance (N, D, D) with D = 1 + J, or D = 0 for ranges without error.
"""

from __future__ import annotations

import numpy as np
from scipy.special import erfc, erfcx

from ....models.records import Array

LARGE = 25.0
"""Where the complementary error function is about to underflow."""


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
    late: float,
    detour: float,
) -> tuple[Array, Array, Array]:
    """Log-likelihood (N,) of active links, and mean and covariance of theta after them.

    ``device`` (2, N), ``height`` (N,), ``anchors`` (J, 3) [m]; links ``rx`` (L,), ``offset``
    (L + 1,) into ``z`` (M,) [m] and ``variance`` (M,) [m^2]. ``floor`` [1/m] is the density of
    ranges that are neither direct nor late, ``los`` and ``late`` the mean numbers of those that
    are, ``detour`` [m] the mean of what late ones have too much. Range after range, ``log L``
    grows by the logarithm of ``Z = floor + los N(nu; S) + late E(nu; S)``, and theta moves along
    its gain by the first two derivatives of log Z.
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
            g = np.exp(-t) * (t < 32) / np.sqrt(2 * np.pi * S)
            f = exponential(nu, S, detour) if late else np.zeros_like(g)
            Z = floor + los * g + late * f
            # derivatives by nu: g' = -nu/S g and f' = (g - f) / detour
            slope = los * -nu / S * g + late * (g - f) / detour
            bend = los * ((nu / S) ** 2 - 1 / S) * g
            bend += late * (-nu / S * g - (g - f) / detour) / detour
            log_l += np.log(Z)
            mean -= (slope / Z)[:, None] * K
            shrink = (slope / Z) ** 2 - bend / Z
            covariance -= shrink[:, None, None] * K[:, :, None] * K[:, None, :]
    return log_l, mean, covariance


def exponential(nu: Array, S: Array, detour: float) -> Array:
    """Density (n,) [1/m] of the sum of a Gaussian of variance ``S`` and an exponential length."""
    x = (S / detour - nu) / np.sqrt(2 * S)
    small = np.minimum(x, LARGE)
    near = np.exp(S / (2 * detour**2) - nu / detour, where=x < LARGE, out=np.zeros_like(x))
    far = np.exp(-(nu**2) / (2 * S)) * erfcx(np.maximum(x, LARGE))
    return np.asarray(np.where(x < LARGE, near * erfc(small), far) / (2 * detour))

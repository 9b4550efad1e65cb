"""Differences of distance (TDOA) of a device to pairs of anchors, for many particles.

A difference is ``z = (1 + s) (d_j - d_i) + b_j - b_i + n_j - n_i`` with theta = (s, b_1 .. b_J) as
in :mod:`.range_error` and the noise n of two arrivals. Differences from one anchor i share its
noise: theta is given n_i as a further element, of the share ``correlation`` of the variance, for as
long as they are taken in, and is rid of it by marginalisation. So they are weighed jointly, false
ones among them or not.
"""

from __future__ import annotations

import numpy as np

from ....models.records import Array


def difference(
    device: Array,
    height: Array,
    anchors: Array,
    reference: Array,
    rx: Array,
    offset: Array,
    z: Array,
    variance: Array,
    correlation: float,
    mean: Array,
    covariance: Array,
    floor: float,
    los: float,
) -> tuple[Array, Array, Array]:
    """Log-likelihood (N,) of differences, and mean and covariance of theta after them.

    ``device`` (2, N), ``height`` (N,), ``anchors`` (J, 3) [m]; from the anchors ``reference`` (L,),
    in order, to ``rx`` (L,), with ``offset`` (L + 1,) into ``z`` (M,) [m] and ``variance`` (M,)
    [m^2]. ``floor`` [1/m] is the density of false differences, ``los`` the mean number of others.
    """
    n, D = device.shape[1], mean.shape[1]
    log_l = np.zeros(n)
    m, P = np.zeros((n, D + 1)), np.zeros((n, D + 1, D + 1))
    m[:, :D], P[:, :D, :D] = mean, covariance
    away = device.T - anchors[:, None, :2]
    d = np.sqrt((away**2).sum(-1) + (height - anchors[:, 2, None]) ** 2)
    last = -1
    for e, (i, j) in enumerate(zip(reference.tolist(), rx.tolist(), strict=True)):
        rows = range(offset[e], offset[e + 1])
        if i != last and len(rows):
            last = i
            m[:, D], P[:, D], P[:, :, D] = 0.0, 0.0, 0.0
            P[:, D, D] = correlation * variance[rows[0]]
        H = np.zeros((n, D + 1))
        H[:, D] = -1.0
        if D:
            H[:, 0], H[:, 1 + j], H[:, 1 + i] = d[j] - d[i], 1.0, -1.0
        for l in rows:
            K = np.einsum("nij,nj->ni", P, H)
            S = (1 - correlation) * variance[l] + (K * H).sum(1)
            nu = z[l] - (d[j] - d[i]) - (H * m).sum(1)
            t = nu**2 / (2 * S)
            g = los * np.exp(-t) * (t < 32) / np.sqrt(2 * np.pi * S)
            r = g / (floor + g)
            log_l += np.log(floor + g)
            m += (r * nu / S)[:, None] * K
            shrink = r / S - r * (1 - r) * (nu / S) ** 2
            P -= shrink[:, None, None] * K[:, :, None] * K[:, None, :]
    return log_l, m[:, :D].copy(), P[:, :D, :D].copy()

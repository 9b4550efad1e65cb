"""What a Gaussian target makes a sensor see, and what a detection says of it.

Expected detections with their covariances, densities of pairs, Gaussians updated or begun by
detections; of all pairs (J, n) at once, or of some (k,).
"""

from __future__ import annotations

from math import pi

import numpy as np

from ....models.radar.detection import polar
from ....models.records import Array
from ..kernels.compiled import gaussians
from ..kernels.compiled.pairs import log_likelihood as of_pairs
from ..kernels.gaussians import innovation
from . import doppler
from .sensing import Look, cartesian


def expected(look: Look, m: Array, P: Array, unscented: bool) -> tuple[Array, Array, Array]:
    """Expected detection z_hat (J, 2), its covariances C (J, 4, 2) with the state and S (J, 2, 2).

    S lacks the noise R of the detection. For ranges and azimuths by linearisation at the mean
    (extended) or by 2 dx sigma points (unscented, kappa = 0; Julier and Uhlmann 2004).
    """
    if not look.polar:
        return m[:, :2].copy(), P[:, :, :2], P[:, :2, :2].copy()
    local = (m[:, :2] - look.position) @ look.rotation
    distance, azimuth = polar(local)
    z_hat = np.stack((distance, azimuth), 1)
    if not unscented:
        r = np.maximum(distance, 1e-9)
        c, s = local.T / r
        H = np.stack((np.stack((c, s), -1), np.stack((-s, c), -1) / r[:, None]), 1)
        H = H @ look.rotation.T
        C = P[:, :, :2] @ H.swapaxes(1, 2)
        return z_hat, C, H @ C[:, :2]
    d = m.shape[1]
    L = np.sqrt(d) * np.linalg.cholesky(P).swapaxes(1, 2)
    sigma = np.concatenate((L, -L), 1)
    spread = (m[:, None, :2] + sigma[..., :2] - look.position) @ look.rotation
    points = np.stack(polar(spread), -1)
    e = points - z_hat[:, None]
    e[..., 1] -= 2 * pi * np.round(e[..., 1] / (2 * pi))
    shift = e.mean(1)
    e -= shift[:, None]
    C = sigma.swapaxes(1, 2) @ e / (2 * d)
    return z_hat + shift, C, e.swapaxes(1, 2) @ e / (2 * d)


def innovations(look: Look, m: Array, P: Array, unscented: bool) -> tuple[Array, Array, Array]:
    """:func:`expected` (J, k, ...) of each detection, k = n where they differ from it.

    They do where they have times of their own or Doppler, which is a third entry. Else k is 1. S
    has the noise R of the detections, and so n entries where that differs.
    """
    if not look.parts:
        return _beside(look, m, P, *expected(look, m, P, unscented))
    found = []
    for part in look.parts:
        m_then = m @ part.F.T
        moved = part.F @ P
        P_then = moved @ part.F.T + part.Q
        z_hat, C, S = innovations(part.look, m_then, P_then, unscented)
        # With H as the regression on the state then: the covariance of the state now.
        H = np.linalg.solve(P_then, C[:, 0])
        found.append((z_hat[:, 0], moved.swapaxes(1, 2) @ H, S[:, 0]))
    z_hat, C, S = (np.stack(columns, 1) for columns in zip(*found, strict=True))
    return z_hat, C, S


def _beside(
    look: Look, m: Array, P: Array, z_hat: Array, C: Array, S: Array
) -> tuple[Array, Array, Array]:
    """What is :func:`expected`, with Doppler, if there is any, in all pairs (J, n, ...)."""
    S = S[:, None] + look.R
    if look.rates is None:
        return z_hat[:, None], C[:, None], S
    J, n = len(m), len(look.z)
    j, i = np.repeat(np.arange(J), n), np.tile(np.arange(n), J)
    v = innovation(look.z[i], z_hat[j], look.period)
    of = S[j, i] if S.shape[1] > 1 else S[j, 0]
    found = doppler.beside(look.rates, i, v, m[j], P[j], z_hat[j], C[j], of)
    z_hat, C, S = (a.reshape(J, n, *a.shape[1:]) for a in found)
    return z_hat, C, S


def log_likelihood(look: Look, z_hat: Array, S: Array, gate: float) -> Array:
    """Log densities (J, n) of the detections, -inf outside the gate."""
    J, n = len(z_hat), len(look.z)
    if z_hat.shape[1] == 1 and look.rates is None:
        return gaussians.log_likelihood(look.z, z_hat[:, 0], S, look.period, gate)
    d = z_hat.shape[2]
    at = np.broadcast_to(z_hat, (J, n, d)).reshape(J * n, d)
    S = np.broadcast_to(S, (J, n, d, d)).reshape(J * n, d, d)
    return pair_likelihood(look, at, S, np.tile(np.arange(n), J), gate).reshape(J, n)


def pair_likelihood(look: Look, z_hat: Array, S: Array, i: Array, gate: float) -> Array:
    """Log densities (k,) of the detections ``i`` (k,), -inf outside the gate, of place or Doppler.

    They are expected at z_hat (k, 2 or 3) with covariance S, noise included.
    """
    place, spread = (np.ascontiguousarray(a) for a in (z_hat[:, :2], S[:, :2, :2]))
    none = np.zeros((1, 2, 2))
    log_l = of_pairs(look.z, place, spread, none, look.period, np.arange(len(i)), i, gate)
    if look.rates is None:
        return log_l
    near = np.flatnonzero(log_l > -np.inf)
    v = innovation(look.z[i[near]], place[near], look.period)
    log_l[near] += doppler.log_density(look.rates, i[near], v, z_hat[near], S[near], gate)
    return log_l


def updated(
    look: Look, m: Array, P: Array, z_hat: Array, C: Array, S: Array, j: Array, i: Array
) -> tuple[Array, Array]:
    """Means (k, dx) and covariances of the Gaussians ``j`` (k,) given detections ``i`` (k,)."""
    if z_hat.shape[1] == S.shape[1] == 1 and look.rates is None:
        K, P = gaussians.gain(P, np.ascontiguousarray(C[:, 0]), S[:, 0])
        return gaussians.correct(m[j], K[j], look.z[i], z_hat[j, 0], look.period), P[j]
    at, of = (i if a.shape[1] > 1 else np.zeros_like(i) for a in (z_hat, S))
    return pair_update(look, m[j], P[j], z_hat[j, at], C[j, at], S[j, of], i)


def pair_update(
    look: Look, m: Array, P: Array, z_hat: Array, C: Array, S: Array, i: Array
) -> tuple[Array, Array]:
    """Means (k, dx) and covariances of Gaussians m, P given the detections ``i`` (k,), one each."""
    place = z_hat[:, :2]
    K, P = gaussians.gain(P, np.ascontiguousarray(C[:, :, :2]), np.ascontiguousarray(S[:, :2, :2]))
    m = gaussians.correct(m, K, look.z[i], np.ascontiguousarray(place), look.period)
    if look.rates is None:
        return m, P
    v = innovation(look.z[i], place, look.period)
    return doppler.corrected(look.rates, i, v, m, P, z_hat, C, S)


def first(look: Look, std_velocity: Array) -> tuple[Array, Array, Array]:
    """Targets m (n, 4), P that nothing but the detections tells of, and a density (n,).

    Velocities are about 0, with deviations ``std_velocity`` (2,). The density is that of their
    Doppler, in the measure that clutter has beside its place.
    """
    if look.parts:
        each = [first(part.look, std_velocity) for part in look.parts]
        m, P, density = (np.concatenate(columns) for columns in zip(*each, strict=True))
        return m, P, density
    where, R = positions(look)
    m, P = np.hstack((where, np.zeros_like(where))), np.zeros((len(where), 4, 4))
    P[:, :2, :2], P[:, 2:, 2:] = R, np.diag(np.square(std_velocity))
    if look.rates is None:
        return m, P, np.ones(len(m))
    density, m, P = doppler.first(look.rates, m, P)
    return m, P, density


def positions(look: Look) -> tuple[Array, Array]:
    """Detections as positions (n, 2) in the map with covariances (n, 2, 2), at their own times."""
    if look.parts:
        each = [positions(part.look) for part in look.parts]
        return np.concatenate([x for x, _ in each]), np.concatenate([R for _, R in each])
    R = np.broadcast_to(look.R, (len(look.z), 2, 2))
    if not look.polar:
        return look.z, R
    r, a = look.z.T
    c, s = np.cos(a), np.sin(a)
    J = look.rotation @ np.stack((np.stack((c, s), -1), np.stack((-s, c), -1) * r[:, None]), -1)
    where: Array = look.position + cartesian(look.z) @ look.rotation.T
    return where, J @ R @ J.swapaxes(1, 2)

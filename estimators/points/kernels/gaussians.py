"""Algebra of Gaussian mixtures that the filters of detections share.

A component has weight w, mean m and covariance P. What a component expects to be measured is
``z_hat`` (J, dz), with covariance S of the innovation and C (J, dx, dz) of state and measurement:
linear, extended and unscented updates differ in nothing else. Entries of a measurement with a
``period`` above zero are angles [rad]. B.-N. Vo and W.-K. Ma, "The Gaussian mixture probability
hypothesis density filter", IEEE Trans. Signal Process. 54 (2006) 4091-4104.
"""

from __future__ import annotations

import numpy as np

from ....models.records import Array


def predict(m: Array, P: Array, F: Array, Q: Array) -> tuple[Array, Array]:
    """Means (J, dx) and covariances (J, dx, dx) after x -> F x + noise of covariance Q."""
    return m @ F.T, F @ P @ F.T + Q


def innovation(z: Array, z_hat: Array, period: Array) -> Array:
    """Differences z - z_hat (..., dz), the angles among them in [-pi, pi]."""
    v = z - z_hat
    turn = np.where(period > 0, period, 1.0)
    return np.asarray(np.where(period > 0, v - turn * np.round(v / turn), v))


def log_likelihood(z: Array, z_hat: Array, S: Array, period: Array, gate: float) -> Array:
    """Log densities (J, n) of detections z (n, dz) under N(z_hat, S).

    S is (J, 1, dz, dz), or (J, n, dz, dz) where each detection has its own noise. Pairs whose
    squared Mahalanobis distance exceeds ``gate`` get -inf.
    """
    v = innovation(z, z_hat[:, None], period)
    L = np.linalg.cholesky(S)
    e = np.linalg.solve(L, v[..., None])[..., 0] if len(z) else v
    d2 = (e**2).sum(-1)
    log_det = 2 * np.log(np.diagonal(L, axis1=-2, axis2=-1)).sum(-1)
    log_l = -0.5 * (d2 + log_det + z.shape[1] * np.log(2 * np.pi))
    return np.asarray(np.where(d2 > gate, -np.inf, log_l))


def gain(P: Array, C: Array, S: Array) -> tuple[Array, Array]:
    """Kalman gains K = C S^-1 (J, dx, dz) and updated covariances P - K S K^T (J, dx, dx)."""
    K = np.linalg.solve(S, C.swapaxes(1, 2)).swapaxes(1, 2)
    P = P - K @ C.swapaxes(1, 2)
    return K, (P + P.swapaxes(1, 2)) / 2


def correct(m: Array, K: Array, z: Array, z_hat: Array, period: Array) -> Array:
    """Means m + K (z - z_hat), (J, dx), for one detection (J, dz) each."""
    return np.asarray(m + (K @ innovation(z, z_hat, period)[..., None])[..., 0])


def strongest(w: Array, m: Array, threshold: float, count: int) -> Array:
    """Indices, in order, of the at most ``count`` largest weights above ``threshold``.

    Whom of equals it takes depends on their means m (J, dx), not on where they stand.
    """
    kept = np.flatnonzero(w > threshold)
    if len(kept) > count:
        kept = np.sort(kept[falling(w[kept], m[kept])[:count]])
    return kept


def falling(w: Array, values: Array) -> Array:
    """Indices by falling weight, equals in an order that their ``values`` (J, d) alone decide.

    The values' bits are scrambled (the finalizer of G. L. Steele et al., "Fast splittable
    pseudorandom number generators", OOPSLA 2014), so that no place is preferred, wherever rows
    that come sorted have it.
    """
    key = np.zeros(len(w), np.uint64)
    for column in np.ascontiguousarray(values.T + 0.0).view(np.uint64):
        key = (key ^ column) * np.uint64(0x9E3779B97F4A7C15)
        key = (key ^ (key >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        key = (key ^ (key >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        key ^= key >> np.uint64(31)
    return np.lexsort((key, -w))


def merge(
    w: Array, m: Array, P: Array, scale: Array, threshold: float, by_leader: bool = False
) -> tuple[Array, Array, Array, Array]:
    """Merge what is close to the strongest, then to the strongest of the rest, and so on.

    Component i joins leader l if (m_i - m_l)^T scale_i^-1 (m_i - m_l) <= threshold, or with
    scale_l ``by_leader``; ``scale`` (J, dx, dx) is P for the rule of table II, the identity for
    Euclidean distance. Returns weights, means and covariances that match those of the groups, by
    falling weight of the leader, and the leader's index (G,).
    """
    L = np.linalg.cholesky(scale)
    order = np.argsort(-w, kind="stable")
    left = np.ones(len(w), bool)
    groups = []
    for leader in order:
        if not left[leader]:
            continue
        near = np.flatnonzero(left)
        e = np.linalg.solve(L[[leader] if by_leader else near], (m[near] - m[leader])[..., None])[
            ..., 0
        ]
        near = near[((e**2).sum(1) <= threshold) | (near == leader)]
        left[near] = False
        groups.append((leader, near))
    merged = [moments(w[near], m[near], P[near]) for _, near in groups]
    dx = m.shape[1]
    return (
        np.array([q for q, _, _ in merged]),
        np.array([a for _, a, _ in merged]).reshape(-1, dx),
        np.array([A for _, _, A in merged]).reshape(-1, dx, dx),
        np.array([leader for leader, _ in groups], np.int64),
    )


def moments(w: Array, m: Array, P: Array) -> tuple[float, Array, Array]:
    """Weight, mean and covariance of a mixture as a whole."""
    total = w.sum()
    mean = w @ m / total
    v = m - mean
    spread = P + v[:, :, None] * v[:, None, :]
    return float(total), mean, np.tensordot(w, spread, 1) / total

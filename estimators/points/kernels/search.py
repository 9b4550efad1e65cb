"""The posterior of sets of trajectories given all detections of a recording, one by one.

Of a trajectory its detections are stated, and when it began and ended is integrated out, as in the
mixture of K. Granstrom, L. Svensson, Y. Xia, J. Williams and A. F. Garcia-Fernandez, "Poisson
multi-Bernoulli mixture trackers: continuity through random finite sets of trajectories", FUSION
2018: the first detection is one of the Poisson process of undetected targets, and each later look
either detects a Bernoulli or misses it. So the weight of a set is the product of those of its
trajectories, and that of a global hypothesis of the filter that prunes and merges nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ....models.records import Array

OFF = -1.0
"""Existence of a trajectory before its first detection."""
TINY = 1e-300


class Batch(NamedTuple):
    """S looks in order of time, at N detections in the map, divided by ``offset`` (S + 1,).

    From the look before F and Q (S, dx, dx) lead to each, targets ``survive`` (S,) with that
    probability inside the ``scene`` (4,), and of visibility ``keep`` (S,) is left beside what has
    ``settled``. In view, targets are detected with ``p_detect`` (S,). The view is by ``pose``
    (S, 4), x y and the sensor's cosine and sine, and ``sector`` (S, 4), first azimuth, width, least
    and greatest range. Detections are positions z (N, 2) with covariances R (N, 2, 2);
    ``log_clutter`` and ``log_new`` (N,) are the log densities [m^-2] there of false and of first
    detections, and m (N, dx), P (N, dx, dx) what a first one says of its target.
    """

    F: Array
    Q: Array
    survive: Array
    keep: Array
    settled: float
    scene: Array
    p_detect: Array
    pose: Array
    sector: Array
    offset: Array
    z: Array
    R: Array
    log_clutter: Array
    log_new: Array
    m: Array
    P: Array


class Way(NamedTuple):
    """A trajectory by looks: ``taken`` (S,), the detection or -1, and what it knows after each.

    ``gain`` (S,) is the log of the weight that a look adds, over that of the same detections as
    false ones. Existence r (S,), visibility v (S,), m (S, dx) and P (S, dx, dx) are given what came
    until then; r is :data:`OFF` before the first detection.
    """

    taken: Array
    gain: Array
    r: Array
    v: Array
    m: Array
    P: Array


def weigh(batch: Batch, taken: Array) -> Way:
    """The trajectory that made the detections ``taken`` (S,) and no others.

    Equations (1) to (4) of ``docs/systems/filters.md``.
    """
    S, dx = len(batch.survive), batch.F.shape[1]
    way = Way(taken, np.zeros(S), np.full(S, OFF), np.ones(S), np.zeros((S, dx)),
              np.tile(np.eye(dx), (S, 1, 1)))  # fmt: skip
    r, v, m, P = OFF, 1.0, way.m[0], way.P[0]
    for s, i in enumerate(taken.tolist()):
        if r == OFF:
            if i < 0:
                continue
            way.gain[s] = batch.log_new[i] - batch.log_clutter[i]
            r, v, m, P = 1.0, 1.0, batch.m[i], batch.P[i]
        else:
            r *= batch.survive[s] if inside(batch.scene, m) else 0.0
            m, P = batch.F[s] @ m, batch.F[s] @ P @ batch.F[s].T + batch.Q[s]
            v = batch.settled + (v - batch.settled) * batch.keep[s]
            p = batch.p_detect[s] if seen(batch.pose[s], batch.sector[s], m) else 0.0
            if i < 0:
                none = max(1 - r * v * p, TINY)
                way.gain[s] = np.log(none)
                r, v = r * (1 - v * p) / none, v * (1 - p) / max(1 - v * p, TINY)
            else:
                V = P[:2, :2] + batch.R[i]
                e = batch.z[i] - m[:2]
                K = np.linalg.solve(V, P[:2]).T
                log_l = -0.5 * (e @ np.linalg.solve(V, e) + np.linalg.slogdet(2 * np.pi * V)[1])
                with np.errstate(divide="ignore"):
                    way.gain[s] = np.log(r * v * p) + log_l - batch.log_clutter[i]
                r, v, m, P = 1.0, 1.0, m + K @ e, P - K @ P[:2]
        way.r[s], way.v[s], way.m[s], way.P[s] = r, v, m, P
    return way


def inside(scene: Array, m: Array) -> bool:
    """Whether a mean is in the scene: x_min, x_max, y_min, y_max."""
    return bool(scene[0] <= m[0] <= scene[1] and scene[2] <= m[1] <= scene[3])


def seen(pose: Array, view: Array, m: Array) -> bool:
    """Whether a mean is in view."""
    x, y, c, s = pose
    dx, dy = m[0] - x, m[1] - y
    distance = np.hypot(dx, dy)
    turn = (np.arctan2(c * dy - s * dx, c * dx + s * dy) - view[0]) % (2 * np.pi)
    wide = view[1] >= 2 * np.pi or turn <= view[1]
    return bool(view[2] <= distance <= view[3] and wide)

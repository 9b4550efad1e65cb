"""Which detections of a look may be of which targets, found by a k-d tree.

What is compared grows with the pairs that are near, not with targets times detections.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain

import numpy as np
from scipy.spatial import cKDTree

from ...models.records import Array
from .kernels.compiled.pairs import log_likelihood
from .kernels.gaussians import innovation
from .model.doppler import Rates, beside, log_density
from .model.measurement import expected, pair_update, positions
from .model.sensing import Look

MOST = 1 << 22
"""Pairs of a look that are compared, those of the nearest detections of each target."""
_SLACK = 1 + 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """k pairs inside the gate, by target: ``target``, ``detection`` and ``log_l`` (k,).

    The log density is that of the detection z under N(z_hat, S), with z_hat (k, 2), S (k, 2, 2) and
    its covariance C (k, dx, 2) with the state; Doppler is a third entry. ``cut``
    counts pairs that were left out unseen.
    """

    target: Array
    detection: Array
    log_l: Array
    z_hat: Array
    C: Array
    S: Array
    cut: int = 0

    def __len__(self) -> int:
        return len(self.target)

    def take(self, index: Array) -> Pairs:
        """The pairs ``index``."""
        a = self
        rest = a.log_l[index], a.z_hat[index], a.C[index], a.S[index]
        return Pairs(a.target[index], a.detection[index], *rest, a.cut)

    def updated(self, look: Look, m: Array, P: Array) -> tuple[Array, Array]:
        """Means (k, dx) and covariances of the targets m, P given the detections of the pairs."""
        t = self.target
        return pair_update(look, m[t], P[t], self.z_hat, self.C, self.S, self.detection)


def near(look: Look, m: Array, P: Array, unscented: bool, gate: float) -> Pairs:
    """The pairs of targets m (T, dx), P (T, dx, dx) and detections within the ``gate``.

    Where rows have times of their own, all targets are moved to each of them, one by one.
    """
    if look.parts:
        return _at_own_times(look, m, P, unscented, gate)
    z_hat, C, S = expected(look, m, P, unscented)
    target, detection, cut = _candidates(look, z_hat, S, gate)
    log_l = log_likelihood(look.z, z_hat, S, look.R, look.period, target, detection, gate)
    kept = np.flatnonzero(log_l > -np.inf)
    target, detection = target[kept], detection[kept]
    S = S[target] + (look.R if len(look.R) == 1 else look.R[detection])
    found = Pairs(target, detection, log_l[kept], z_hat[target], C[target], S, cut)
    return found if look.rates is None else _rated(look, look.rates, m, P, found, gate)


def _rated(look: Look, rates: Rates, m: Array, P: Array, x: Pairs, gate: float) -> Pairs:
    """The pairs with their Doppler, without those outside its gate."""
    v = innovation(look.z[x.detection], x.z_hat, look.period)
    moments = m[x.target], P[x.target], x.z_hat, x.C, x.S
    z_hat, C, S = beside(rates, x.detection, v, *moments)
    log_l = x.log_l + log_density(rates, x.detection, v, z_hat, S, gate)
    found = Pairs(x.target, x.detection, log_l, z_hat, C, S, x.cut)
    return found.take(np.flatnonzero(log_l > -np.inf))


def _candidates(look: Look, z_hat: Array, S: Array, gate: float) -> tuple[Array, Array, int]:
    """Targets and detections (k,) near enough to each other in the map, by target.

    Also how many pairs were left out because there are more than :data:`MOST`.
    """
    T, n = len(z_hat), len(look.z)
    if not T or not n:
        return np.zeros(0, np.int64), np.zeros(0, np.int64), 0
    reach = np.minimum(_reach(look, z_hat, S, gate) * _SLACK, 1e12)
    tree, place = cKDTree(positions(look)[0]), _place(look, z_hat)
    if T * n > MOST:
        count = tree.query_ball_point(place, reach, return_length=True)
        if count.sum() > MOST:
            k = max(MOST // T, 1)
            distance, found = tree.query(place, k=np.arange(1, k + 1))
            target, column = np.nonzero(distance <= reach[:, None])
            return target, found[target, column], int(count.sum() - len(target))
    lists = tree.query_ball_point(place, reach, return_sorted=False)
    count = np.fromiter(map(len, lists), np.int64, T)
    detection = np.fromiter(chain.from_iterable(lists), np.int64, int(count.sum()))
    return np.repeat(np.arange(T), count), detection, 0


def _place(look: Look, z_hat: Array) -> Array:
    """Where in the map (T, 2) detections are expected."""
    if not look.polar:
        return np.ascontiguousarray(z_hat)
    r, a = z_hat.T
    local = np.stack((r * np.cos(a), r * np.sin(a)), 1)
    return np.asarray(look.position + local @ look.rotation.T)


def _reach(look: Look, z_hat: Array, S: Array, gate: float) -> Array:
    """Distance (T,) [m] in the map beyond which no detection is inside the gate of a target."""
    if not look.polar:
        return np.asarray(np.sqrt(gate * (_longest(S) + _longest(look.R).max())))
    along, across = (np.sqrt(gate * (S[:, a, a] + look.R[:, a, a].max())) for a in (0, 1))
    r = np.abs(z_hat[:, 0])
    # A chord between ranges r and r' has the square (r - r')^2 + r r' (2 sin(angle / 2))^2.
    return np.asarray(np.sqrt(along**2 + r * (r + along) * np.minimum(across, np.pi) ** 2))


def _at_own_times(look: Look, m: Array, P: Array, unscented: bool, gate: float) -> Pairs:
    found = []
    for i, part in enumerate(look.parts):
        moved = part.F @ P
        P_then = moved @ part.F.T + part.Q
        x = near(part.look, m @ part.F.T, P_then, unscented, gate)
        # With H as the regression on the state then: the covariance of the state now.
        C = moved[x.target].swapaxes(1, 2) @ np.linalg.solve(P_then[x.target], x.C)
        found.append((x.target, np.full(len(x), i), x.log_l, x.z_hat, C, x.S))
    target, *others = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.argsort(target, kind="stable")
    detection, log_l, z_hat, C, S = (column[order] for column in others)
    return Pairs(target[order], detection, log_l, z_hat, C, S)


def _longest(A: Array) -> Array:
    """Largest eigenvalues (J,) of the upper left (2, 2) of symmetric matrices A."""
    a, b, d = A[:, 0, 0], A[:, 0, 1], A[:, 1, 1]
    return np.asarray((a + d) / 2 + np.hypot((a - d) / 2, b))

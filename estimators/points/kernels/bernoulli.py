"""Algebra of multi-Bernoulli mixtures in track-oriented form.

A track is a potential object; each of its single-object hypotheses is a Bernoulli density, and a
global hypothesis picks at most one of every track. Nothing is copied when global hypotheses share
a Bernoulli. J. L. Williams, "Marginal multi-Bernoulli filters: RFS derivation of MHT, JIPDA and
association-based MeMBer", IEEE Trans. Aerosp. Electron. Syst. 51 (2015) 1664-1687;
A. F. Garcia-Fernandez et al., "Poisson multi-Bernoulli mixture filter: direct derivation and
implementation", IEEE Trans. Aerosp. Electron. Syst. 54 (2018) 1883-1901.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ....models.errors import EstimatorError
from ....models.records import Array
from .compiled import bernoulli as compiled
from .compiled import gaussians
from .compiled.murty import k_best
from .gaussians import falling, moments

TINY = 1e-300


@dataclass(frozen=True, slots=True, eq=False)
class Bernoullis:
    """L Bernoulli densities: existence r (L,), mean m (L, dx), covariance P (L, dx, dx).

    ``visible`` (L,) is the probability that the object, if there is one, can be detected now;
    ``unseen`` (L,) [s] how long ago it was; ``origin`` (L,) the index that the Bernoulli had after
    the scans before, -1 for a new one.
    """

    r: Array
    m: Array
    P: Array
    visible: Array
    unseen: Array
    origin: Array

    def __len__(self) -> int:
        return len(self.r)

    def take(self, index: Array) -> Bernoullis:
        """The Bernoullis ``index``."""
        return Bernoullis(*(getattr(self, name)[index] for name in Bernoullis.__slots__))

    def join(self, other: Bernoullis) -> Bernoullis:
        """Those of ``self``, then those of ``other``."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in Bernoullis.__slots__)
        return Bernoullis(*(np.concatenate(pair) for pair in pairs))


def newborn(r: Array, m: Array, P: Array) -> Bernoullis:
    """Visible Bernoullis without a past."""
    return Bernoullis(r, m, P, np.ones(len(r)), np.zeros(len(r)), np.full(len(r), -1))


@dataclass(frozen=True, slots=True, eq=False)
class Mixture:
    """A multi-Bernoulli mixture of T tracks in G global hypotheses.

    A track has a label (T,) and the mean ``start`` (T, dx) of its first detection, NaN before. A
    hypothesis has weight w (G,), falling once pruned, and ``table`` (G, T) has the index in
    ``local`` that it picks of each track, -1 for none. ``parent`` (G,) is the hypothesis that it
    was after the scans before, where nothing else is said itself.
    """

    local: Bernoullis
    label: Array
    start: Array
    w: Array
    table: Array
    parent: Array = field(default_factory=lambda: np.zeros(0, np.int64))

    def __post_init__(self) -> None:
        if len(self.parent) != len(self.w):
            object.__setattr__(self, "parent", np.arange(len(self.w)))

    def existence(self) -> Array:
        """Existence (G, T) of every track in every global hypothesis, 0 where absent."""
        return np.append(self.local.r, 0.0)[self.table]


def nothing(dx: int) -> Mixture:
    """No track, one global hypothesis: certainly nothing there."""
    none = newborn(np.zeros(0), np.zeros((0, dx)), np.zeros((0, dx, dx)))
    label, table = np.zeros(0, np.int64), np.zeros((1, 0), np.int64)
    return Mixture(none, label, none.m, np.ones(1), table)


def add_tracks(mixture: Mixture, new: Bernoullis, label: Array, free: Array) -> Mixture:
    """The mixture with one more track (n,) for each of ``new`` where ``free`` (G, n) says so."""
    column = np.where(free, len(mixture.local) + np.arange(len(new)), -1)
    return Mixture(
        mixture.local.join(new),
        np.concatenate((mixture.label, label)),
        np.concatenate((mixture.start, new.m)),
        mixture.w,
        np.hstack((mixture.table, column)),
        mixture.parent,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Association:
    """The best global hypotheses after a scan, before the densities are updated.

    Weight w (G,) and hypothesis ``parent`` (G,) before; the distinct pairs of a Bernoulli
    ``prior`` (n,) and the ``detection`` (n,) that it takes, -1 for a miss, that occur in them; the
    table (G, T) of pairs; and ``free`` (G, M), which detections no track takes.
    """

    w: Array
    parent: Array
    prior: Array
    detection: Array
    table: Array
    free: Array


def associate(
    mixture: Mixture, log_hit: Array, p_detect: Array, log_free: Array, k: int, gap: float
) -> Association:
    """The ``k`` best joint associations of tracks to detections, over all global hypotheses.

    Their weights are (4) of ``docs/systems/filters.md``, and pairs cost (5).

    Parameters
    ----------
    log_hit : (L, M) log of the probability that the Bernoulli's object, if it is there, is detected
        times the density of the detection then, -inf outside its gate
    p_detect : (L,) that it is detected at all
    log_free : (M,) log density of detections that none of the tracks made: clutter, new objects
    k, gap : how many hypotheses are kept, and how far in log weight below the best one

    Raises
    ------
    EstimatorError : a weight is not finite
    """
    r, table = mixture.local.r, mixture.table
    M = log_hit.shape[1]
    miss = np.log(np.maximum(1 - r * p_detect, TINY))
    there = np.log(np.maximum(r, TINY))
    gain = (there - miss)[:, None] + log_hit - log_free
    # Who gains less by a pair is farther than ``gap`` behind the same hypothesis without it.
    near = gain > -gap
    seen = np.flatnonzero(near.any(axis=0))
    active = np.flatnonzero(np.append(near.any(axis=1), False)[table].any(axis=0))
    n, T = len(seen), len(active)
    gain = np.where(near, gain, -np.inf)[:, seen]
    # The row that index -1 picks: absent tracks take no detection and weigh nothing.
    gain, miss = np.vstack((gain, np.full(n, -np.inf))), np.append(miss, 0.0)
    costs = np.full((len(table), T, n + T), np.inf)
    costs[:, :, :n] = -gain[table[:, active]]
    costs[:, np.arange(T), n + np.arange(T)] = 0.0
    before = np.log(mixture.w) + miss[table].sum(axis=1)
    if T:
        costs[:, 0] -= before[:, None]
        parent, column, cost = k_best(costs, k, gap)
    else:
        parent = np.argsort(-before, kind="stable")
        column, cost = np.zeros((len(parent), 0), np.int64), -before[parent]
    if not len(cost):
        raise EstimatorError("no association of tracks and detections is possible")
    w = np.exp(cost[0] - cost)
    detection = np.full((len(w), table.shape[1]), -1)
    detection[:, active] = np.append(seen, np.full(T, -1))[column]
    free = np.ones((len(w), M + 1), bool)
    free[np.arange(len(w))[:, None], detection] = False
    prior = table[parent]
    pairs, index = np.unique(
        np.where(prior < 0, -1, prior * (M + 1) + detection + 1), return_inverse=True
    )
    absent = int(len(pairs) > 0 and pairs[0] < 0)
    pairs, index = pairs[absent:], index.reshape(prior.shape) - absent
    return Association(
        w / w.sum(), parent, pairs // (M + 1), pairs % (M + 1) - 1, index, free[:, :M]
    )  # fmt: skip


def missed(local: Bernoullis, p_detect: Array) -> Bernoullis:
    """The Bernoullis after a scan that could have, with ``p_detect`` (L,), but has not seen them.

    Equation (1) of ``docs/systems/filters.md``.
    ``p_detect`` is that of a visible object.
    """
    p = p_detect * local.visible
    return replace(
        local,
        r=local.r * (1 - p) / np.maximum(1 - local.r * p, TINY),
        visible=local.visible * (1 - p_detect) / np.maximum(1 - p, TINY),
    )


def prune(mixture: Mixture, min_existence: float, max_tracks: int) -> tuple[Mixture, float]:
    """Drop unlikely Bernoullis, cap the tracks, unite equal hypotheses, drop what is unused.

    Also returns how many targets are to be expected in the tracks beyond the cap.
    """
    keep = np.append(mixture.local.r >= min_existence, False)
    table = np.where(keep[mixture.table], mixture.table, -1)
    expected = mixture.w @ np.append(mixture.local.r, 0.0)[table]
    tracks = np.flatnonzero(expected > 0)
    lost = 0.0
    if len(tracks) > max_tracks:
        best = falling(expected[tracks], mixture.start[tracks])[:max_tracks]
        tracks, all_ = np.sort(tracks[best]), expected[tracks].sum()
        lost = float(all_ - expected[tracks].sum())
    first, same = _distinct(table[:, tracks])
    table, w = table[first][:, tracks], np.bincount(same, mixture.w, len(first))
    order = np.argsort(-w, kind="stable")
    # Of hypotheses that have become one the weightiest tells where it came from.
    rising = np.argsort(mixture.w, kind="stable")
    heaviest = np.zeros(len(table), np.int64)
    heaviest[same[rising]] = rising
    used, index = np.unique(table[order], return_inverse=True)
    absent = int(len(used) > 0 and used[0] < 0)
    pruned = Mixture(
        mixture.local.take(used[absent:]),
        mixture.label[tracks],
        mixture.start[tracks],
        w[order],
        index.reshape(len(table), len(tracks)) - absent,
        mixture.parent[heaviest[order]],
    )
    return pruned, lost


def _distinct(table: Array) -> tuple[Array, Array]:
    """The first of each of the distinct rows of ``table`` (G, T), in order, and which each is."""
    if not table.shape[1]:
        return np.zeros(min(len(table), 1), np.int64), np.zeros(len(table), np.int64)
    # As bytes of whole numbers whose highest come first, rows compare at once.
    text = np.ascontiguousarray(table + 1, ">u8").view(np.dtype((np.void, 8 * table.shape[1])))
    _, first, same = np.unique(text.ravel(), return_index=True, return_inverse=True)
    return first, same.ravel()


def merge(mixture: Mixture, distance: float, existence: float) -> Mixture:
    """Merge Bernoullis of a track that are alike, whatever global hypotheses they stand in.

    Alike are a Bernoulli and a weightier one whose squared Mahalanobis distance, by the latter's
    covariance, is at most ``distance`` and whose existence differs by at most ``existence``. The
    merged ones keep the track's marginal existence, mean and covariance. Global hypotheses that
    have become equal stay apart until :func:`prune`.
    """
    a, picked = mixture.local, mixture.table >= 0
    index = mixture.table[picked]
    weight, track = np.broadcast_arrays(mixture.w[:, None], np.arange(mixture.table.shape[1]))
    omega = np.bincount(index, weight[picked], len(a))
    of = np.zeros(len(a), np.int64)
    of[index] = track[picked]
    leader, r, m, P, visible = compiled.group(
        of, omega, a.r, a.m, a.P, a.visible, distance, existence
    )
    local = replace(a, r=r, m=m, P=P, visible=visible)
    return replace(mixture, local=local, table=np.append(leader, -1)[mixture.table])


def group(
    track: Array, weight: Array, r: Array, m: Array, P: Array, visible: Array,
    distance: float, existence: float,
) -> tuple[Array, Array, Array, Array, Array]:  # fmt: skip
    """Unite like Bernoullis of a track, the weightiest first; :func:`merge` says which are alike.

    Returns for each of the L Bernoullis the index (L,) of the one it joins, and r, m, P, visible
    in which the leaders have the moments of their groups and the others are left as they were.
    """
    leader = np.full(len(r), -1)
    r_out, m_out, P_out, visible_out = r.copy(), m.copy(), P.copy(), visible.copy()
    for l in np.argsort(-weight, kind="stable"):
        if leader[l] >= 0:
            continue
        v = m - m[l]
        d2 = np.einsum("ja,ab,jb->j", v, np.linalg.inv(P[l]), v)
        alike = (d2 <= distance) & (np.abs(r - r[l]) <= existence)
        near = np.flatnonzero((leader < 0) & (track == track[l]) & alike)
        leader[near] = l
        mass = weight[near] * r[near]
        if len(near) > 1 and mass.sum() > 0:
            total, m_out[l], P_out[l] = moments(mass, m[near], P[near])
            visible_out[l] = mass @ visible[near] / total
            r_out[l] = total / weight[near].sum()
    return leader, r_out, m_out, P_out, visible_out


def unite(mixture: Mixture, distance: float) -> Mixture:
    """Make one of those tracks of the best hypothesis whose means are at most ``distance`` apart.

    The likeliest takes in the others, with their mean and covariance by existence, and the sum of
    their existences, at most 1.
    """
    tracks = np.flatnonzero(mixture.table[0] >= 0)
    a = mixture.local.take(mixture.table[0, tracks])
    scale = np.tile(np.eye(a.m.shape[1]), (len(a), 1, 1))
    r, m, P, leader = gaussians.merge(a.r, a.m, a.P, scale, distance**2)
    united = replace(a.take(leader), r=np.minimum(r, 1.0), m=m, P=P)
    table = mixture.table.copy()
    table[0] = -1
    table[0, tracks[leader]] = len(mixture.local) + np.arange(len(leader))
    return replace(mixture, local=mixture.local.join(united), table=table)


def cardinality(mixture: Mixture) -> Array:
    """Distribution (G, T + 1) of the number of objects in every global hypothesis."""
    r = mixture.existence()
    rho = np.zeros((r.shape[0], r.shape[1] + 1))
    rho[:, 0] = 1.0
    for p in r.T[:, :, None]:
        rho[:, 1:] = rho[:, 1:] * (1 - p) + rho[:, :-1] * p
        rho[:, :1] *= 1 - p
    return rho

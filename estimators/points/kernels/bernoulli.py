"""Algebra of multi-Bernoulli mixtures in track-oriented form.

A track is a potential object; each of its single-object hypotheses is a Bernoulli density, and a
global hypothesis picks at most one of every track. Nothing is copied when global hypotheses share
a Bernoulli. J. L. Williams, "Marginal multi-Bernoulli filters: RFS derivation of MHT, JIPDA and
association-based MeMBer", IEEE Trans. Aerosp. Electron. Syst. 51 (2015) 1664-1687;
A. F. Garcia-Fernandez et al., "Poisson multi-Bernoulli mixture filter: direct derivation and
implementation", IEEE Trans. Aerosp. Electron. Syst. 54 (2018) 1883-1901.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ....models.errors import EstimatorError
from ....models.records import Array
from .compiled import bernoulli as compiled
from .compiled import gaussians, groups
from .gaussians import falling, moments
from .groups import MANY, MOST, OVER, OVER_MANY, SHARE, marginal, taken
from .modes import Modes

TINY = 1e-300
_COLUMNS = ("r", "m", "P", "visible", "unseen", "origin")
ONE = np.ones(1)
"""Of targets that move in one way, the probabilities (1,) of their modes."""


@dataclass(frozen=True, slots=True, eq=False)
class Bernoullis:
    """L Bernoulli densities: existence r (L,), mean m (L, dx), covariance P (L, dx, dx).

    ``visible`` (L,) is the probability that the object, if there is one, can be detected now;
    ``unseen`` (L,) [s] how long ago it was; ``origin`` (L,) the index that the Bernoulli had after
    the scans before, -1 for a new one. Where targets manoeuvre m and P are the moments of their
    ``modes``.
    """

    r: Array
    m: Array
    P: Array
    visible: Array
    unseen: Array
    origin: Array
    modes: Modes | None = None

    def __len__(self) -> int:
        return len(self.r)

    def take(self, index: Array) -> Bernoullis:
        """The Bernoullis ``index``."""
        modes = None if self.modes is None else self.modes.take(index)
        columns: dict[str, Any] = {name: getattr(self, name)[index] for name in _COLUMNS}
        return Bernoullis(**columns, modes=modes)

    def join(self, other: Bernoullis) -> Bernoullis:
        """Those of ``self``, then those of ``other``."""
        columns: dict[str, Any] = {
            name: np.concatenate((getattr(self, name), getattr(other, name))) for name in _COLUMNS
        }
        modes = None
        if self.modes is not None:
            assert other.modes is not None
            modes = self.modes.join(other.modes)
        return Bernoullis(**columns, modes=modes)

    def put(self, at: Array, m: Array, P: Array, modes: Modes | None) -> None:
        """Give those ``at`` (k,) other densities."""
        self.m[at], self.P[at] = m, P
        if self.modes is not None and modes is not None:
            self.modes.w[at], self.modes.m[at], self.modes.P[at] = modes.w, modes.m, modes.P


def newborn(r: Array, m: Array, P: Array, mode: Array = ONE) -> Bernoullis:
    """Visible Bernoullis without a past, in modes of the probabilities ``mode`` (M,)."""
    modes = Modes.of(mode, m, P) if len(mode) > 1 else None
    one, none = np.ones(len(r)), np.zeros(len(r))
    return Bernoullis(r, m, P, one, none, np.full(len(r), -1), modes)


@dataclass(frozen=True, slots=True, eq=False)
class Mixture:
    """Independent multi-Bernoulli mixtures: T tracks in C groups of at most G hypotheses each.

    A track has a label (T,), the mean ``start`` (T, dx) of its first detection, NaN before, and is
    in a ``group`` (T,). The hypotheses of a group have weights w (G, C) that add up to 1, falling
    once pruned, 0 beyond the last, and ``table`` (G, T) has the index in ``local`` that they pick
    of each track, -1 for none. A global hypothesis picks one of each group: the first row is the
    best. ``parent`` (G, n) says which hypothesis of the group ``came`` (n,) after the scans before
    stands in those of ``heir`` (n,), a group that it, or a part of it, is in now.
    """

    local: Bernoullis
    label: Array
    start: Array
    w: Array
    table: Array
    group: Array
    parent: Array
    came: Array
    heir: Array

    @staticmethod
    def whole(local: Bernoullis, label: Array, start: Array, w: Array, table: Array) -> Mixture:
        """All tracks in one group whose hypotheses weigh w (G,)."""
        G, one = len(w), np.zeros(1, np.int64)
        parent = np.arange(G)[:, None]
        group = np.zeros(len(label), np.int64)
        return Mixture(local, label, start, w[:, None], table, group, parent, one, one)

    def existence(self) -> Array:
        """Existence (G, T) of every track in every hypothesis, 0 where absent."""
        return np.append(self.local.r, 0.0)[self.table]

    def weight(self) -> Array:
        """Weights (G, T) of the hypotheses of the group of every track."""
        return self.w[:, self.group]

    def by_group(self, values: Array) -> Array:
        """Sums (G, C) of ``values`` (G, T) over the tracks of each group."""
        G, C = self.w.shape
        at = (np.arange(G)[:, None] * C + self.group).ravel()
        return np.bincount(at, values.ravel(), G * C).reshape(G, C)

    def rows(self, row: Array, w: Array, group: Array, into: Array) -> Mixture:
        """Hypotheses with weights w (G', C') made of one ``row`` (G', C) of each group, -1: none.

        Tracks then are in ``group`` (T,), what a group was before is found ``into`` (C,) another.
        """
        return replace(
            self,
            w=w,
            table=taken(self.table, row, self.group, -1),
            group=group,
            parent=taken(self.parent, row, self.heir, 0),
            heir=into[self.heir],
        )

    def regrouped(self, group: Array, old: Array) -> Mixture:
        """The tracks in other groups (T,), each with the hypotheses of the ``old`` (C',) one."""
        link, part = np.nonzero(self.heir[:, None] == old)
        return replace(
            self,
            w=self.w.take(old, axis=1),
            group=group,
            parent=self.parent.take(link, axis=1),
            came=self.came[link],
            heir=part,
        )

    def restarted(self) -> Mixture:
        """The same as what comes after it sees it."""
        G, C = self.w.shape
        every = np.arange(C)
        return replace(self, parent=np.tile(np.arange(G)[:, None], (1, C)), came=every, heir=every)


def nothing(dx: int, mode: Array = ONE) -> Mixture:
    """No track, one hypothesis: certainly nothing there. Targets have modes as of ``mode`` (M,)."""
    none = newborn(np.zeros(0), np.zeros((0, dx)), np.zeros((0, dx, dx)), mode)
    label, table = np.zeros(0, np.int64), np.zeros((1, 0), np.int64)
    return Mixture.whole(none, label, none.m, np.ones(1), table)


def add_tracks(
    mixture: Mixture, new: Bernoullis, label: Array, free: Array, group: Array
) -> Mixture:
    """The mixture with one more track (n,) for each of ``new`` where ``free`` (G, n) says so.

    Each is in a ``group`` (n,), or for -1 in one of its own.
    """
    own = group < 0
    column = np.where(free, len(mixture.local) + np.arange(len(new)), -1)
    column[1:, own] = -1
    G, C = mixture.w.shape
    alone = np.zeros((G, own.sum()))
    alone[0] = 1.0
    return replace(
        mixture,
        local=mixture.local.join(new),
        label=np.concatenate((mixture.label, label)),
        start=np.concatenate((mixture.start, new.m)),
        w=np.hstack((mixture.w, alone)),
        table=np.hstack((mixture.table, column)),
        group=np.concatenate((mixture.group, np.where(own, C - 1 + np.cumsum(own), group))),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Association:
    """The best hypotheses after a scan, before the densities are updated.

    The ``mixture`` has the distinct pairs of a Bernoulli ``prior`` (n,) and the ``detection`` (n,)
    that it takes, -1 for a miss, in its table; its ``local`` are those before. Each of M detections
    may be of tracks of the group ``of`` (M,), -1 for none, whose hypotheses leave it ``free``
    (G, M) or not. Of ``over`` groups only the marginals could be told: those of the tracks
    ``loose`` (T,), which made the detections with the probability ``taken`` (M,).
    """

    mixture: Mixture
    prior: Array
    detection: Array
    of: Array
    free: Array
    taken: Array
    loose: Array
    over: int

    def novelty(self) -> Array:
        """How probably (M,) no track takes a detection."""
        w = np.column_stack((self.mixture.w, np.arange(len(self.free)) == 0))
        return np.asarray((1 - self.taken) * (w[:, self.of] * self.free).sum(0))


def associate(
    mixture: Mixture, log_hit: Array, p_detect: Array, log_free: Array, k: int, gap: float,
    parted: bool = False, many: int = MANY,
) -> Association:  # fmt: skip
    """The ``k`` best joint associations of tracks to detections, over all hypotheses of a group.

    Their weights are (4) of ``docs/systems/filters.md``, and pairs cost (5).

    Parameters
    ----------
    log_hit : (L, M) log of the probability that the Bernoulli's object, if it is there, is detected
        times the density of the detection then, -inf outside its gate
    p_detect : (L,) that it is detected at all
    log_free : (M,) log density of detections that none of the tracks made: clutter, new objects
    k, gap : how many hypotheses are kept, and how far in log weight below the best one
    parted : tracks are in groups, which become one where they may have made the same detection
    many : tracks of a group, beyond which its hypotheses count as too few unless the last hardly
        weighs

    Raises
    ------
    EstimatorError : a weight is not finite
    """
    r, M = mixture.local.r, log_hit.shape[1]
    miss = np.log(np.maximum(1 - r * p_detect, TINY))
    there = np.log(np.maximum(r, TINY))
    gain = (there - miss)[:, None] + log_hit - log_free
    # Who gains less by a pair is farther than ``gap`` behind the same hypothesis without it.
    near = gain > -gap
    # The row that index -1 picks: absent tracks take no detection and weigh nothing.
    gain = np.vstack((np.where(near, gain, -np.inf), np.full(M, -np.inf)))
    miss, of = np.append(miss, 0.0), np.zeros(M, np.int64)
    if parted:
        x, (cost, row, detection), of, taken, loose, over = _by_group(
            mixture, gain, miss, near, k, gap, many
        )
    else:
        x, taken, loose, over = mixture, np.zeros(M), np.zeros(len(mixture.label), bool), 0
        cost, row, detection = groups.best(x.w, x.table, x.group, gain, miss, of, k, gap)
    if np.isinf(cost[0]).any():
        raise EstimatorError("no association of tracks and detections is possible")
    w = np.exp(cost[0] - cost)
    x = x.rows(row, w / w.sum(0), x.group, np.arange(w.shape[1]))
    g, t = np.nonzero(detection >= 0)
    free = np.column_stack((row >= 0, np.arange(len(row)) == 0))[:, of]
    free[g, detection[g, t]] = False
    key = np.where(x.table < 0, -1, x.table * (M + 1) + detection + 1)
    pairs, table = _numbered(key, len(r) * (M + 1))
    prior, detection = np.divmod(pairs, M + 1)
    x = replace(x, table=table)
    return Association(x, prior, detection - 1, of, free, taken, loose, over)


def _by_group(
    mixture: Mixture, gain: Array, miss: Array, near: Array, k: int, gap: float, many: int
) -> tuple[Mixture, tuple[Array, Array, Array], Array, Array, Array, int]:
    """The mixture in groups that share no detection, and what :func:`.groups.best` says of it.

    Where too many hypotheses matter beside the ``k`` best, each track is in a group of its own,
    with its marginals. Also the group ``of`` (M,) each detection, how probably (M,) such tracks
    made it, which (T,) they are, and of how many groups.
    """
    l, i = map(np.ascontiguousarray, np.nonzero(near))
    part, seen = groups.together(_owner(mixture)[l], i, mixture.w.shape[1], near.shape[1])
    size = np.bincount(part[mixture.group], minlength=part.max(initial=-1) + 1)
    over = size > MOST
    while True:
        number = np.append(np.where(over, -1, np.cumsum(~over) - 1), -1)
        x, into = _apart(mixture, number[part])
        row, w, share = groups.join(x.w, into, k, gap)
        kept, of = np.flatnonzero(~over), number[seen]
        more = share[: len(kept)] < SHARE
        if not more.any():
            x = x.rows(row, w, into[x.group], into)
            found = groups.best(x.w, x.table, x.group, gain, miss, of, k, gap)
            if len(found[0]) >= k:
                last = np.exp(found[0][0] - found[0][k - 1])[: len(kept)]
                more = last > np.where(size[kept] > many, OVER_MANY, OVER)
        if not more.any():
            break
        over[kept[more]] = True
    taken, loose = np.zeros(len(of)), over[part[mixture.group]]
    if not over.any():
        return x, found, of, taken, loose, 0
    room = ((0, max(k - len(found[0]), 0)), (0, 0))
    cost = np.pad(found[0], room, constant_values=np.inf)
    row, detection = (np.pad(a, room, constant_values=-1) for a in found[1:])
    w = mixture.weight()
    for c in np.flatnonzero(over):
        tracks, those = np.flatnonzero(part[mixture.group] == c), np.flatnonzero(seen == c)
        each, taken[those] = marginal(
            w[:, tracks], mixture.table[:, tracks], gain, miss, those, k, gap
        )
        for t, (price, before, z) in zip(tracks, each, strict=True):
            n, g = len(price), x.group[t]
            cost[:, g], row[:, g], detection[:, t] = np.inf, -1, -1
            cost[:n, g], row[:n, g], detection[:n, t] = price, before, z
    return x, (cost, row, detection), of, taken, loose, int(over.sum())


def _apart(mixture: Mixture, into: Array) -> tuple[Mixture, Array]:
    """The mixture with the tracks of the groups that go ``into`` (C,) none, -1, each by itself.

    Then where its groups go: these to places of their own, after the others.
    """
    alone = np.flatnonzero(into[mixture.group] < 0)
    if not (into < 0).any():
        return mixture, into
    stay = np.flatnonzero(into >= 0)
    group = (np.cumsum(into >= 0) - 1)[mixture.group]
    group[alone] = len(stay) + np.arange(len(alone))
    free = into.max(initial=-1) + 1 + np.arange(len(alone))
    old = np.concatenate((stay, mixture.group[alone]))
    return mixture.regrouped(group, old), np.concatenate((into[stay], free))


def _owner(mixture: Mixture) -> Array:
    """The group (L,) of each Bernoulli."""
    of = np.zeros(len(mixture.local) + 1, np.int64)
    of[mixture.table] = mixture.group
    return of[:-1]


def _numbered(key: Array, n: int) -> tuple[Array, Array]:
    """The distinct of the entries of ``key`` below n, in order, and which each is; -1 stays."""
    used = np.zeros(n + 1, bool)
    used[key] = True
    used[-1] = False
    number = np.cumsum(used) - 1
    number[-1] = -1
    return np.flatnonzero(used), number[key]


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


def prune(
    mixture: Mixture, min_existence: float, max_tracks: int, dependence: float | None = None
) -> tuple[Mixture, float]:
    """Drop unlikely Bernoullis, cap the tracks, unite equal hypotheses, drop what is unused.

    Tracks whose ``dependence`` is less part, see :func:`.groups.split`; none do for None. Also
    returns how many targets are to be expected in the tracks beyond the cap.
    """
    keep = np.append(mixture.local.r >= min_existence, False)
    table = np.where(keep[mixture.table], mixture.table, -1)
    expected = (mixture.weight() * np.append(mixture.local.r, 0.0)[table]).sum(0)
    tracks = np.flatnonzero(expected > 0)
    lost = 0.0
    if len(tracks) > max_tracks:
        best = falling(expected[tracks], mixture.start[tracks])[:max_tracks]
        tracks, all_ = np.sort(tracks[best]), expected[tracks].sum()
        lost = float(all_ - expected[tracks].sum())
    x = replace(
        mixture,
        label=mixture.label[tracks],
        start=mixture.start[tracks],
        table=np.ascontiguousarray(table[:, tracks]),
        group=mixture.group[tracks],
    )
    if dependence is not None:
        x = _parted(x, dependence)
    row, w = groups.distinct(x.w, x.table, x.group)
    x = x.rows(row, w, x.group, np.arange(w.shape[1]))
    used, index = _numbered(x.table, len(mixture.local))
    return replace(x, local=mixture.local.take(used), table=index), lost


def _parted(x: Mixture, dependence: float) -> Mixture:
    """The mixture in groups that depend on each other no more; those without tracks are gone."""
    group = groups.split(x.w, x.table, x.group, x.local.r, dependence)
    _, first = np.unique(group, return_index=True)
    return x.regrouped(group, x.group[first])


def matched(mixture: Mixture, loose: Array) -> Mixture:
    """The mixture in which each track of ``loose`` (T,) is one Bernoulli, which has its marginals.

    They are in groups of their own, whose other hypotheses are gone but for that of the weightiest
    Bernoulli, as which the track goes on.
    """
    track = np.flatnonzero(loose)
    g, t = np.nonzero(mixture.table[:, track] >= 0)
    group = mixture.group[track[t]]
    used, row, at = np.unique(mixture.table[g, track[t]], return_index=True, return_inverse=True)
    a, of = mixture.local.take(used), t[row]
    omega = np.bincount(at, mixture.w[g, group], len(used))
    leader, r, m, P, visible = compiled.group(of, omega, a.r, a.m, a.P, a.visible, np.inf, np.inf)
    modes = None if a.modes is None else a.modes.merged(leader, omega * a.r)
    first = np.flatnonzero(leader == np.arange(len(used)))
    r[first] *= np.bincount(of, omega, len(track))[of[first]]
    one = replace(a, r=r, m=m, P=P, visible=visible, modes=modes).take(first)
    table, w, parent = mixture.table.copy(), mixture.w.copy(), mixture.parent.copy()
    table[:, track] = -1
    table[0, track[of[first]]] = len(mixture.local) + np.arange(len(first))
    w[:, mixture.group[track]] = np.arange(len(w))[:, None] == 0
    kept = np.zeros(w.shape[1], np.int64)
    kept[group[row[first]]] = g[row[first]]
    parent[0] = parent[kept[mixture.heir], np.arange(len(mixture.heir))]
    return replace(mixture, local=mixture.local.join(one), table=table, w=w, parent=parent)


def merge(mixture: Mixture, distance: float, existence: float) -> Mixture:
    """Merge Bernoullis of a track that are alike, whatever global hypotheses they stand in.

    Alike are a Bernoulli and a weightier one whose squared Mahalanobis distance, by the latter's
    covariance, is at most ``distance`` and whose existence differs by at most ``existence``. The
    merged ones keep the track's marginal existence, mean and covariance. Global hypotheses that
    have become equal stay apart until :func:`prune`.
    """
    a, picked = mixture.local, mixture.table >= 0
    index = mixture.table[picked]
    weight, track = np.broadcast_arrays(mixture.weight(), np.arange(mixture.table.shape[1]))
    omega = np.bincount(index, weight[picked], len(a))
    of = np.zeros(len(a), np.int64)
    of[index] = track[picked]
    leader, r, m, P, visible = compiled.group(
        of, omega, a.r, a.m, a.P, a.visible, distance, existence
    )
    modes = None if a.modes is None else a.modes.merged(leader, omega * a.r)
    local = replace(a, r=r, m=m, P=P, visible=visible, modes=modes)
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

    All are in one group.

    The likeliest takes in the others, with their mean and covariance by existence, and the sum of
    their existences, at most 1.
    """
    tracks = np.flatnonzero(mixture.table[0] >= 0)
    a = mixture.local.take(mixture.table[0, tracks])
    scale = np.tile(np.eye(a.m.shape[1]), (len(a), 1, 1))
    r, m, P, leader = gaussians.merge(a.r, a.m, a.P, scale, distance**2)
    united = replace(a.take(leader), r=np.minimum(r, 1.0), m=m, P=P)
    if united.modes is not None:
        united = replace(united, modes=Modes.each(united.modes.w, m, P))
    table = mixture.table.copy()
    table[0] = -1
    table[0, tracks[leader]] = len(mixture.local) + np.arange(len(leader))
    return replace(mixture, local=mixture.local.join(united), table=table)


def cardinality(mixture: Mixture) -> Array:
    """Distribution (G, T + 1) of the number of objects in every hypothesis of one group."""
    r = mixture.existence()
    rho = np.zeros((r.shape[0], r.shape[1] + 1))
    rho[:, 0] = 1.0
    for p in r.T[:, :, None]:
        rho[:, 1:] = rho[:, 1:] * (1 - p) + rho[:, :-1] * p
        rho[:, :1] *= 1 - p
    return rho

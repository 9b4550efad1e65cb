"""Update of the PHD filter by one look, and by several looks of one time in any order.

For one look the equations of Vo and Ma (2006). Of several, the intensity of the posterior of all: a
target that none has detected stays a part of the Poisson process, one that the first of them has is
a Bernoulli, which the others miss or detect. R. Mahler, "The multisensor PHD filter: I. General
solution via multitarget calculus", SPIE 7336 (2009); the sum over partitions by
:func:`.kernels.association.marginals`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.records import Array
from .kernels.association import marginals
from .kernels.bernoulli import TINY
from .model.sensing import Look, SensorParams
from .model.sight import Sight
from .phd_filter import Mixture, Params

SURE = 1e-12
"""Least probability that a target is missed."""
NEGLIGIBLE = 1e-9
"""Weight below which a pair adds nothing to a region."""


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """The updated mixture before reduction, and to which detected target (J,) each component is.

    -1 where all looks have missed. ``missed`` is the weight of these and ``q`` (T,) the existence
    of the others, components too light for the mixture included; with one look there is one of them
    for each detection. ``novelty`` (n,) tells of each look how probably no target that was known
    made the detections. ``beside`` (J,) is the share of a component that goes on, see
    :func:`_beside`.
    """

    mixture: Mixture
    detection: Array
    missed: float
    q: Array
    novelty: tuple[Array, ...]
    beside: Array

    @property
    def going_on(self) -> Mixture:
        """The mixture without what is counted beside the detected target that it is."""
        return replace(self.mixture, w=self.mixture.w * self.beside)


def update(
    mixture: Mixture, looks: Sequence[tuple[Look, SensorParams]], params: Params, is_new: Array
) -> Posterior:
    """The mixture given the looks of one time, in any order (eqs. 30-37 for one look)."""
    x, target, q = mixture, np.full(len(mixture.w), -1), np.zeros(0)
    counted = params.keep or params.regions
    least = min(params.prune_weight, NEGLIGIBLE) if counted else params.prune_weight
    taken, missed, outside = [], float(mixture.w.sum()), np.ones(len(mixture.w))
    for seen, own in looks:
        found = _corrected(x, target, q, seen, own, params.gate, least)
        x, target, q, missed, by_others, source, beyond = found
        is_new, outside = is_new[source], (outside * beyond)[source]
        taken.append(by_others)
    if params.drop_missed_births:
        late = (target < 0) & is_new
        missed -= float(x.w[late].sum())
        x, target, outside = x.take(~late), target[~late], outside[~late]
    first = len(q) - np.cumsum([len(t) for t in taken[::-1]])[::-1]
    novelty = tuple(1 - t - q[f : f + len(t)] for t, f in zip(taken, first.tolist(), strict=True))
    beside = np.where(target < 0, 1 - outside * (1 - _beside(mixture, x, target)), 1.0)
    return Posterior(x, target, missed, q, novelty, beside)


def _beside(before: Mixture, x: Mixture, target: Array) -> Array:
    """Probability (J,) that a target of the label of a component is there and is not detected.

    The Poisson process takes the part of a target that may be out of view for another target than
    the one that is detected, and so would count one along the border of the view anew with every
    scan. A label is one target, or as many as it weighs where that is more: of who is detected no
    part is elsewhere, as in a Bernoulli filter.
    """
    label, index = np.unique(np.append(before.label, x.label), return_inverse=True)
    old, new = np.split(index, [len(before.label)])
    number = np.maximum(np.bincount(old, before.w, len(label)), 1.0)
    detected = np.bincount(new, np.where(target < 0, 0.0, x.w), len(label))
    return np.asarray(np.maximum(1 - detected / number, 0.0)[new])


def _corrected(
    x: Mixture, target: Array, q: Array, seen: Look, own: SensorParams, gate: float, least: float
) -> tuple[Mixture, Array, Array, float, Array, Array, Array]:
    """The mixture after one of the looks of a time.

    Components are of the Poisson process (``target`` (J,) -1), or of Bernoullis with existence
    ``q`` (T,). Returned are the same for the components above ``least``, detections (n,) having
    begun one more Bernoulli each; then the Poisson weight, the probability (n,) that one of the
    earlier Bernoullis made the detections, from which (J',) each component came, and how probably
    (J,) one that is missed is out of view.
    """
    w, T, n = x.w, len(q), len(seen.z)
    sight = Sight.of(x.m, x.P, x.modes, seen, gate, own)
    p, hit = sight.mean(sight.border.p), sight.hit(w)
    free = target < 0
    none = seen.clutter + hit[free].sum(0)
    share = 1 / np.where(none > 0, none, 1.0)
    begun = hit[free].sum(0) * share
    by_others = np.zeros(n)
    # Weights of components, and of pairs of them with detections, as the target would have them.
    missed, weight = (1 - p) * w, hit * share
    if T:
        j, i = np.nonzero(hit * ~free[:, None])
        pair, of = np.unique(target[j] * n + i, return_inverse=True)
        t, z = pair // n, pair % n
        sum_hit = np.bincount(of, hit[j, i], len(pair))
        miss = np.maximum(1 - np.bincount(target[~free], (w * p)[~free], T), SURE)
        taken, left = marginals(t, z, sum_hit / (miss[t] * np.maximum(none[z], TINY)), T, n)
        by_others = np.minimum(np.bincount(z, taken, n), 1.0)
        q = np.clip(left * (q - 1 + miss) / miss + np.bincount(t, taken, T), 0.0, 1.0)
        missed[~free] *= (left / miss)[target[~free]]
        weight *= 1 - by_others
        weight[j, i] = hit[j, i] * (taken / sum_hit)[of]
        begun = begun * (1 - by_others)
    elsewhere = np.where(free, 1 - weight.sum(1) / np.maximum(w, 1.0), 1.0)
    m_missed, P_missed, missing = sight.missed(np.ones(len(w)), np.maximum(elsewhere, 0.0))
    share = sight.mean(sight.border.share)
    beyond = (1 - share) / np.maximum(1 - p, SURE) if own.fov_mass else np.zeros(len(w))
    kept = np.flatnonzero(missed > least)
    j, i = np.nonzero(weight > least)
    m_new, P_new, modes = sight.detected(j, i)
    if missing is not None and modes is not None:
        modes = missing.take(kept).join(modes)
    source = np.concatenate((kept, j))
    after = Mixture(
        np.concatenate((missed[kept], weight[j, i])),
        np.concatenate((m_missed[kept], m_new)),
        np.concatenate((P_missed[kept], P_new)),
        x.label[source],
        x.origin[source],
        modes,
    )
    of = np.concatenate((target[kept], np.where(free[j], T + i, target[j])))
    q, left_over = np.concatenate((q, begun)), float(missed[free].sum())
    return after, of, q, left_over, by_others, source, beyond

"""Gaussian-mixture probability hypothesis density filter, with statistics of regions.

B.-N. Vo and W.-K. Ma, "The Gaussian mixture probability hypothesis density filter", IEEE Trans.
Signal Process. 54 (2006) 4091-4104: the intensity of targets is a mixture of components; each is
predicted, updated by being missed and by every detection, and the sum is pruned, merged and capped.
A component keeps the label of the birth that it goes back to.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any

import numpy as np

from ...models.errors import EstimatorError
from ...models.parameters import parameter
from ...models.records import Array, Estimates, Objects, Recording, Scan
from ...models.regions import polygons, statistics
from .clutter_map import Maps, learnt, persistent
from .cuts import Cut, Told
from .edge import detection_probability, unseen
from .kernels import births
from .kernels.association import marginals
from .kernels.compiled import gaussians
from .kernels.gaussians import strongest
from .sensing import (
    Look,
    SensorParams,
    at_once,
    count,
    innovations,
    log_likelihood,
    looks,
    updated,
)
from .source import Classes, Nothing, Source, recognised
from .streams import per_stream
from .targets import Interval, TargetParams, born, elapse, limit, newborn, settled, within

TINY = 1e-300
"""Least density that a weight is divided by."""
EXPLAINED = 0.05
"""Share of a component that detections have taken, from which on the rest stays where it is."""
SURE = 1e-12
"""Least probability that a target is missed."""
NAMES, UNITS = ("x", "y", "vx", "vy"), ("m", "m", "m s-1", "m s-1")
CROWD = 5000
"""Updated components that are looked at."""
NEGLIGIBLE = 1e-9
"""Weight below which a pair adds nothing to a region."""


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class Params(TargetParams, SensorParams):
    """Sensors, targets, and how the mixture is kept small and read."""

    TITLE = "mixture"

    gate: float = parameter(
        30.0, "1", "squared Mahalanobis distance of a detection from its gate", within="(0, inf)"
    )
    prune_weight: float = parameter(
        1e-5, "1", "components of less weight are dropped", within="[0, 1)"
    )
    merge_distance: float = parameter(
        4.0, "1", "squared distance within which components merge", within="(0, inf)"
    )
    merge_by: str = parameter(
        "candidate",
        "1",
        "whose covariance scales distances from the strongest: candidate (table II), leader (the "
        "strongest's own: vague components stay apart) or none (Euclidean, m and m s-1)",
        within=("candidate", "leader", "none"),
    )
    max_components: int | None = parameter(
        None,
        "1",
        "components kept; null: three for each detection of a time, at least 100, up to 1000",
        within="[1, inf)",
    )
    cap_before_merge: bool = parameter(False, "1", "cap, then merge; not merge, then cap")
    extraction: str = parameter(
        "weight",
        "1",
        "weight: a component above extract_weight counts as often as its rounded weight; "
        "rounding: the strongest components, as many as the rounded sum of weights",
        within=("weight", "rounding"),
    )
    extract_weight: float = parameter(
        0.5, "1", "least weight of what is extracted by weight", within="[0, 1)"
    )
    drop_missed_births: bool = parameter(
        False, "1", "variant: what appears and is not detected at once is forgotten"
    )
    cap_merged_weight: bool = parameter(False, "1", "variant: no merged component weighs above one")
    regions: Any = parameter(
        {}, "m", "regions to count targets in: name to x_min, x_max, y_min, y_max or to corners"
    )

    keep: bool = parameter(
        False, "1", "keep the updated mixture of every step, for regions that are named afterwards"
    )
    keep_components: int = parameter(
        500, "1", "the strongest so many components of it", within="[1, inf)"
    )

    def __post_init__(self) -> None:
        SensorParams.__post_init__(self)
        TargetParams.__post_init__(self)
        polygons(self.regions)


@dataclass(frozen=True, slots=True, eq=False)
class Mixture:
    """Intensity of targets: weights w (J,), means m (J, 4), covariances P (J, 4, 4), label (J,)."""

    w: Array
    m: Array
    P: Array
    label: Array

    def take(self, index: Array) -> Mixture:
        """The components ``index``."""
        return Mixture(self.w[index], self.m[index], self.P[index], self.label[index])


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """The reduced mixture after the scans at ``time_ns`` (None: before any).

    ``waiting`` appeared at the last detections and enters with the next prediction;
    ``next_label`` is free. ``maps`` of persistent clutter are those of the streams, ``classes``
    those of the targets; ``cut`` is the expected number of targets that limits left out this time,
    and ``detections`` how many a time has had lately.
    """

    mixture: Mixture
    waiting: births.Components
    next_label: int
    time_ns: int | None
    maps: Maps = field(default_factory=dict)
    classes: Classes = field(default_factory=dict)
    cut: Cut = field(default_factory=dict)
    detections: int = 0


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """The updated mixture before reduction, and to which detected target (J,) each component is.

    -1 where all looks have missed. ``missed`` is the weight of these and ``q`` (T,) the existence
    of the others, components too light for the mixture included; with one look there is one of them
    for each detection. ``novelty`` (n,) tells of each look how probably no target that was known
    made the detections.
    """

    mixture: Mixture
    detection: Array
    missed: float
    q: Array
    novelty: tuple[Array, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Context:
    """What stays: the recording's setup, parameters (in all and by stream), corners of regions.

    ``source`` makes detections of scans that hold none.
    """

    setup: Recording
    params: Params
    sensing: Mapping[str, Params]
    regions: Mapping[str, Array]
    source: Source

    @staticmethod
    def of(setup: Recording, params: Params, source: Source | None = None) -> Context:
        """The context of a recording."""
        params = settled(params, setup)
        sensing = per_stream(params, setup)
        return Context(setup, params, sensing, polygons(params.regions), source or Nothing())


def init() -> State:
    """Nothing is known."""
    return State(Mixture(*births.none(), np.zeros(0, np.int64)), births.none(), 0, None)


def predict(state: State, params: TargetParams, time_ns: int) -> tuple[State, Array, Interval]:
    """The mixture at ``time_ns`` with what may have appeared (eqs. 22-29), and which of it did.

    Births at detections appeared at the last scan and move; others stand where they are expected.

    Raises
    ------
    InputError : the time goes back
    """
    gone = elapse(params, state.time_ns, time_ns)
    old, (w, m, P) = state.mixture, state.waiting
    w, m, P = np.concatenate((old.w, w)), np.concatenate((old.m, m)), np.concatenate((old.P, P))
    w = w * gone.survival(params, m)
    m, P, known = gone.predict(m, P)
    label = np.concatenate((old.label, state.next_label + np.arange(len(w) - len(old.w))))
    is_new = np.arange(len(w)) >= len(old.w)
    new = newborn(params, gone)
    w, m, P = births.join((w[known], m[known], P[known]), new)
    first = state.next_label + len(label) - len(old.w)
    label = np.concatenate((label[known], first + np.arange(len(new[0]))))
    is_new = np.concatenate((is_new[known], np.ones(len(new[0]), bool)))
    predicted = replace(
        state,
        mixture=Mixture(w, m, P, label),
        waiting=births.none(),
        next_label=first + len(new[0]),
        time_ns=time_ns,
        cut={},
    )
    return predicted, is_new, gone


def update(
    mixture: Mixture, looks: Sequence[tuple[Look, SensorParams]], params: Params, is_new: Array
) -> Posterior:
    """The mixture given the looks of one time, in any order (eqs. 30-37 for one look).

    The intensity of the posterior of all looks: a target that none has detected stays a part of
    the Poisson process, one that the first of them has is a Bernoulli, which the others miss or
    detect. R. Mahler, "The multisensor PHD filter: I. General solution via multitarget calculus",
    SPIE 7336 (2009); the sum over partitions by :func:`.kernels.association.marginals`.
    """
    x, target, q = mixture, np.full(len(mixture.w), -1), np.zeros(0)
    counted = params.keep or params.regions
    least = min(params.prune_weight, NEGLIGIBLE) if counted else params.prune_weight
    taken, missed = [], float(mixture.w.sum())
    for seen, own in looks:
        found = _corrected(x, target, q, seen, own, params.gate, least)
        x, target, q, missed, by_others, source = found
        is_new = is_new[source]
        taken.append(by_others)
    if params.drop_missed_births:
        late = (target < 0) & is_new
        missed -= float(x.w[late].sum())
        x, target = x.take(~late), target[~late]
    first = len(q) - np.cumsum([len(t) for t in taken[::-1]])[::-1]
    novelty = tuple(1 - t - q[f : f + len(t)] for t, f in zip(taken, first.tolist(), strict=True))
    return Posterior(x, target, missed, q, novelty)


def _corrected(
    x: Mixture, target: Array, q: Array, seen: Look, own: SensorParams, gate: float, least: float
) -> tuple[Mixture, Array, Array, float, Array, Array]:
    """The mixture after one of the looks of a time.

    Components are of the Poisson process (``target`` (J,) -1), or of Bernoullis with existence
    ``q`` (T,). Returned are the same for the components above ``least``, detections (n,) having
    begun one more Bernoulli each; then the Poisson weight, the probability (n,) that one of the
    earlier Bernoullis made the detections, and from which (J',) each component came.
    """
    w, m, P, T, n = x.w, x.m, x.P, len(q), len(seen.z)
    z_hat, C, S = innovations(seen, m, P, own.unscented)
    p, m_missed, P_missed = unseen(seen, m, P, np.ones(len(w)), own.fov_mass)
    hit = w[:, None] * np.exp(log_likelihood(seen, z_hat, S, gate))
    hit *= _found(seen, own, x, z_hat, C, S, hit, p)
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
    # Of a target that has been detected no part moves out of view, to be counted beside it.
    explained = weight.sum(1) > EXPLAINED * w
    m_missed, P_missed = (
        np.where(explained.reshape(-1, *[1] * (a.ndim - 1)), a, b)
        for a, b in ((m, m_missed), (P, P_missed))
    )
    kept = np.flatnonzero(missed > least)
    j, i = np.nonzero(weight > least)
    m_new, P_new = updated(seen, m, P, z_hat, C, S, j, i)
    source = np.concatenate((kept, j))
    after = Mixture(
        np.concatenate((missed[kept], weight[j, i])),
        np.concatenate((m_missed[kept], m_new)),
        np.concatenate((P_missed[kept], P_new)),
        x.label[source],
    )
    of = np.concatenate((target[kept], np.where(free[j], T + i, target[j])))
    return after, of, np.concatenate((q, begun)), float(missed[free].sum()), by_others, source


def _found(
    seen: Look,
    own: SensorParams,
    x: Mixture,
    z_hat: Array,
    C: Array,
    S: Array,
    hit: Array,
    p: Array,
) -> Array:
    """Probability of detection (J, 1 or n) by each detection: the mass in view once updated."""
    partial = (p > 0) & (p < seen.p_detect)
    if not partial.any():
        return p[:, None]
    found = np.repeat(p[:, None], hit.shape[1], axis=1)
    j, i = np.nonzero(hit * partial[:, None])
    m, P = updated(seen, x.m, x.P, z_hat, C, S, j, i)
    found[j, i] = detection_probability(seen, m, P, own.fov_mass)
    return found


def reduce(mixture: Mixture, params: Params, detections: int = 0) -> tuple[Mixture, float]:
    """Prune, merge and cap the mixture (table II), and the weight that the cap cut."""
    cap = limit(params.max_components, detections, 3, 100)
    at_once = cap if params.cap_before_merge else max(cap, CROWD)
    left = mixture.w[mixture.w > params.prune_weight].sum()
    x = mixture.take(strongest(mixture.w, mixture.m, params.prune_weight, at_once))
    cut = left - x.w.sum()
    none = params.merge_by == "none"
    scale = np.tile(np.eye(x.m.shape[1]), (len(x.w), 1, 1)) if none else x.P
    w, m, P, leader = gaussians.merge(
        x.w, x.m, x.P, scale, params.merge_distance, params.merge_by == "leader"
    )
    if params.cap_merged_weight:
        w = np.minimum(w, 1.0)
    kept = strongest(w, m, 0.0, cap)
    cut += w.sum() - w[kept].sum()
    return Mixture(w, m, P, x.label[leader]).take(kept), max(float(cut), 0.0)


def extract(mixture: Mixture, params: Params) -> tuple[Array, Array]:
    """Components that stand for targets, the strongest first, and how often each does.

    By weight after table III; by rounding after E. Favarelli et al., eqs. 7-8.
    """
    order = np.argsort(-mixture.w, kind="stable")
    if params.extraction == "rounding":
        chosen = order[: int(np.rint(mixture.w.sum()))]
        return chosen, np.ones(len(chosen), int)
    chosen = order[mixture.w[order] > params.extract_weight]
    return chosen, np.maximum(np.rint(mixture.w[chosen]).astype(int), 1)


def step(state: State, scans: Iterable[Scan], context: Context) -> tuple[State, Estimates]:
    """The state after the ``scans`` of one time, in any order, and what it says.

    A source follows the targets that were extracted before.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    EstimatorError : the weights are not finite
    """
    params, together = context.params, at_once(scans)
    followed, _ = extract(state.mixture, params)
    x, source = state.mixture.take(followed), context.source
    state, is_new, gone = predict(state, params, together[0].time_ns)
    where = x.m[:, :2] + gone.dt * x.m[:, 2:]
    sight = source.see(together, x.label, where, state.classes)
    shown = [*looks(together, sight, context.setup, context.sensing, source.region, within(params))]
    seen = [
        (replace(s, clutter=s.clutter + persistent(state.maps, scan.stream, s, own)), own)
        for scan, s in shown
        for own in [context.sensing[scan.stream]]
    ]
    n = sum(len(s.z) for s, _ in seen)
    posterior = update(state.mixture, seen, params, is_new)
    numbers = _numbers(posterior, context.regions)
    mixture, lost = reduce(posterior.mixture, params, max(n, state.detections))
    waiting, unborn = born(params, [s for s, _ in seen], posterior.novelty, gone)
    cut = {"max_components": lost, "max_births": unborn}
    if params.keep:
        kept, cut["keep_components"] = _kept(posterior, params.keep_components)
        numbers |= kept
    maps = state.maps
    for scan, s in shown:
        maps = learnt(maps, scan, s, context.sensing[scan.stream])
    state = replace(
        state,
        mixture=mixture,
        waiting=waiting,
        maps=maps,
        cut=cut,
        detections=max(n, state.detections // 2),
    )
    state, objects = _objects(state, params)
    alive, where = state.mixture.label, objects.state[:, :2]
    classes = recognised(sight, objects.label, where, alive, state.classes)
    state, objects = replace(state, classes=classes), source.named(objects, classes)
    numbers["components"] = np.array([len(state.mixture.w)])
    numbers["cut"] = np.array([lost + unborn])
    return state, Estimates(context.setup.meta, objects, numbers)


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """Yield the targets after each time, and their expected number in all and in the regions.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    EstimatorError : the weights are not finite
    """
    return run(Context.of(setup, params), scans)


def run(context: Context, scans: Iterable[Scan]) -> Iterator[Estimates]:
    """:func:`estimate` in a context of the caller's."""
    state, told = init(), Told()
    for time_ns, group in groupby(context.source.used(scans), key=lambda scan: scan.time_ns):
        together = list(group)
        state, estimates = step(state, together, context)
        told.warn(state.cut, time_ns, count(together))
        yield estimates


def _numbers(posterior: Posterior, regions: Mapping[str, Array]) -> dict[str, Array]:
    """Mean and variance of the number of targets, in all and by region, (1,) each."""
    x, q = posterior.mixture, posterior.q
    all_ = posterior.missed + q.sum(), posterior.missed + q @ (1 - q)
    if not np.isfinite(all_).all():
        raise EstimatorError("the weights are not finite")
    found = {"cardinality_mean": all_[0], "cardinality_variance": all_[1]}
    for name, pair in statistics(x.w, x.m, x.P, posterior.detection, regions).items():
        found[f"region_mean_{name}"], found[f"region_variance_{name}"] = pair
    return {key: np.array([value]) for key, value in found.items()}


def _kept(posterior: Posterior, count: int) -> tuple[dict[str, Array], float]:
    """The strongest ``count`` components before reduction, zeros where there are fewer.

    Then the weight of the others.
    """
    strong = strongest(posterior.mixture.w, posterior.mixture.m, 0.0, count)
    x, empty = posterior.mixture.take(strong), count - len(strong)
    columns = {"weight": x.w, "mean": x.m, "covariance": x.P}
    columns["detection"] = posterior.detection[strong]
    padded = {
        f"mixture_{key}": np.pad(v, [(0, empty), *[(0, 0)] * (v.ndim - 1)])[None]
        for key, v in columns.items()
    }
    return padded, max(float(posterior.mixture.w.sum() - x.w.sum()), 0.0)


def _objects(state: State, params: Params) -> tuple[State, Objects]:
    """The targets extracted; of those of one label the strongest keeps it."""
    x = state.mixture
    chosen, copies = extract(x, params)
    label, free = x.label.copy(), state.next_label
    _, first = np.unique(label[chosen], return_index=True)
    again = np.delete(chosen, first)
    label[again] = free + np.arange(len(again))
    free += len(again)
    row = np.repeat(chosen, copies)
    shown = label[row]
    copy = np.concatenate(([False], row[1:] == row[:-1])) if len(row) else np.zeros(0, bool)
    shown[copy] = free + np.arange(copy.sum())
    objects = Objects(
        np.array([state.time_ns], np.int64),
        np.array([0, len(row)], np.int64),
        shown,
        NAMES,
        UNITS,
        x.m[row],
        covariance=x.P[row],
        existence=np.minimum(x.w[row], 1.0),
    )
    return replace(
        state, mixture=replace(x, label=label), next_label=free + int(copy.sum())
    ), objects

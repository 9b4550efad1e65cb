"""Gaussian-mixture probability hypothesis density filter, with statistics of regions.

B.-N. Vo and W.-K. Ma, "The Gaussian mixture probability hypothesis density filter", IEEE Trans.
Signal Process. 54 (2006) 4091-4104: the intensity of targets is a mixture of components; each is
predicted, updated by being missed and by every detection, and the sum is pruned, merged and capped.
A component keeps the label of the birth that it goes back to.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any

import numpy as np

from ...models.errors import EstimatorError, InputError
from ...models.parameters import parameter
from ...models.records import Array, Estimates, Objects, Recording, Scan
from ...models.regions import polygons, statistics
from .clutter_map import Maps, learnt, persistent
from .kernels import births
from .kernels.compiled import gaussians
from .kernels.gaussians import strongest
from .sensing import (
    Look,
    SensorParams,
    detection_probability,
    expected,
    looks,
    per_stream,
    positions,
)
from .source import MADE, Classes, Nothing, Source, recognised
from .targets import TargetParams, elapse, newborn, survival

NAMES, UNITS = ("x", "y", "vx", "vy"), ("m", "m", "m s-1", "m s-1")
CROWD = 5000
"""Detections of a scan above which a warning says so; updated components that are looked at."""
NEGLIGIBLE = 1e-9
"""Weight below which a pair adds nothing to a region."""
_log = logging.getLogger(__name__)


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
    max_components: int = parameter(100, "1", "components kept", within="[1, inf)")
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
    those of the targets.
    """

    mixture: Mixture
    waiting: births.Components
    next_label: int
    time_ns: int | None
    maps: Maps = field(default_factory=dict)
    classes: Classes = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """The updated mixture before reduction, and of which detection (J,) each component is.

    -1 where the target was missed. ``missed`` is the weight that was missed and ``q`` (n,) that of
    each detection, components too light for the mixture included.
    """

    mixture: Mixture
    detection: Array
    missed: float
    q: Array


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
        sensing = per_stream(params, setup) | {MADE: params}
        return Context(setup, params, sensing, polygons(params.regions), source or Nothing())


def init() -> State:
    """Nothing is known."""
    return State(Mixture(*births.none(), np.zeros(0, np.int64)), births.none(), 0, None)


def predict(state: State, params: TargetParams, time_ns: int) -> tuple[State, Array]:
    """The mixture at ``time_ns`` with what may have appeared (eqs. 22-29), and which of it did.

    Births at detections appeared at the last scan and move; others stand where they are expected.

    Raises
    ------
    InputError : the time goes back
    """
    dt, count, F, Q = elapse(params, state.time_ns, time_ns)
    old, (w, m, P) = state.mixture, state.waiting
    w = np.concatenate((old.w * survival(params, old.m, dt), np.minimum(count * w, 1.0)))
    m, P = gaussians.predict(np.concatenate((old.m, m)), np.concatenate((old.P, P)), F, Q)
    w, m, P = births.join((w, m, P), newborn(params, count))
    known, J = len(old.w), len(w)
    free = state.next_label + np.arange(J - known)
    mixture = Mixture(w, m, P, np.concatenate((old.label, free)))
    free_from = state.next_label + J - known
    predicted = replace(
        state, mixture=mixture, waiting=births.none(), next_label=free_from, time_ns=time_ns
    )
    return predicted, np.arange(J) >= known


def update(mixture: Mixture, seen: Look, params: Params, is_new: Array) -> Posterior:
    """The mixture given a scan (eqs. 30-37), for any linear or linearised measurement."""
    w, m, P = mixture.w, mixture.m, mixture.P
    z_hat, C, S = expected(seen, m, P, params.unscented)
    S = S[:, None] + seen.R
    p = detection_probability(seen, m, P, params.fov_mass)
    log_l = gaussians.log_likelihood(seen.z, z_hat, S, seen.period, params.gate)
    g = (p * w)[:, None] * np.exp(log_l)
    norm = seen.clutter + g.sum(0)
    g /= np.where(norm > 0, norm, 1.0)

    missed = (1 - p) * w
    if params.drop_missed_births:
        missed[is_new] = 0.0
    counted = params.keep or params.regions
    least = min(params.prune_weight, NEGLIGIBLE) if counted else params.prune_weight
    kept = np.flatnonzero(missed > least)
    j, i = np.nonzero(g > least)
    if S.shape[1] == 1:
        K, P_new = gaussians.gain(P, C, S[:, 0])
        K, P_new = K[j], P_new[j]
    else:
        K, P_new = gaussians.gain(P[j], C[j], S[j, i])
    m_new = gaussians.correct(m[j], K, seen.z[i], z_hat[j], seen.period)
    posterior = Mixture(
        np.concatenate((missed[kept], g[j, i])),
        np.concatenate((m[kept], m_new)),
        np.concatenate((P[kept], P_new)),
        np.concatenate((mixture.label[kept], mixture.label[j])),
    )
    detection = np.concatenate((np.full(len(kept), -1), i))
    return Posterior(posterior, detection, float(missed.sum()), g.sum(0))


def reduce(mixture: Mixture, params: Params) -> Mixture:
    """Prune, merge and cap the mixture (table II)."""
    cap = params.max_components
    x = mixture.take(
        strongest(
            mixture.w, params.prune_weight, cap if params.cap_before_merge else max(cap, CROWD)
        )
    )
    none = params.merge_by == "none"
    scale = np.tile(np.eye(x.m.shape[1]), (len(x.w), 1, 1)) if none else x.P
    w, m, P, leader = gaussians.merge(
        x.w, x.m, x.P, scale, params.merge_distance, params.merge_by == "leader"
    )
    if params.cap_merged_weight:
        w = np.minimum(w, 1.0)
    return Mixture(w, m, P, x.label[leader]).take(strongest(w, 0.0, cap))


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
    """The state after the ``scans`` of one time, taken one after the other, and what it says.

    A source follows the targets that were extracted before.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    EstimatorError : the weights are not finite
    """
    params, together = context.params, list(scans)
    time_ns = together[0].time_ns
    names = [scan.stream for scan in together]
    if len(set(names)) < len(names):
        raise InputError(f"scans at {time_ns} ns: two of one stream")
    followed, _ = extract(state.mixture, params)
    state, is_new = predict(state, params, time_ns)
    x, source = state.mixture.take(followed), context.source
    sight = source.see(together, x.label, x.m[:, :2], state.classes)
    for scan, seen in looks(together, sight, context.setup, context.sensing, source.region):
        own = context.sensing[scan.stream]
        if len(seen.z) > CROWD:
            _log.warning("scan of %s at %d ns: %d detections", scan.stream, time_ns, len(seen.z))
        clutter = seen.clutter + persistent(state.maps, scan.stream, seen, own)
        posterior = update(state.mixture, replace(seen, clutter=clutter), own, is_new)
        mixture = reduce(posterior.mixture, params)
        is_new = np.zeros(len(mixture.w), bool)
        born = births.join(state.waiting, _born(posterior, seen, params))
        maps = learnt(state.maps, scan, seen, own)
        state = replace(state, mixture=mixture, waiting=born, maps=maps)
    numbers = _numbers(posterior, context.regions)
    if params.keep:
        numbers |= _kept(posterior, params.keep_components)
    state, objects = _objects(state, params)
    alive, where = state.mixture.label, objects.state[:, :2]
    classes = recognised(sight, objects.label, where, alive, state.classes)
    state, objects = replace(state, classes=classes), source.named(objects, classes)
    numbers["components"] = np.array([len(state.mixture.w)])
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
    state = init()
    for _, together in groupby(context.source.used(scans), key=lambda scan: scan.time_ns):
        state, estimates = step(state, together, context)
        yield estimates


def _born(posterior: Posterior, seen: Look, params: Params) -> births.Components:
    """Components that may have appeared at the detections."""
    if params.birth != "detections":
        return births.none()
    std = np.array(params.birth_std_velocity)
    novelty = np.clip(1 - posterior.q, 0.0, 1.0)
    return births.at_detections(
        params.birth_rate, *positions(seen), novelty, std, params.max_births
    )


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


def _kept(posterior: Posterior, count: int) -> dict[str, Array]:
    """The strongest ``count`` components before reduction, zeros where there are fewer."""
    strong = strongest(posterior.mixture.w, 0.0, count)
    x, empty = posterior.mixture.take(strong), count - len(strong)
    columns = {"weight": x.w, "mean": x.m, "covariance": x.P}
    columns["detection"] = posterior.detection[strong]
    return {
        f"mixture_{key}": np.pad(v, [(0, empty), *[(0, 0)] * (v.ndim - 1)])[None]
        for key, v in columns.items()
    }


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

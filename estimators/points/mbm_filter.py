"""Multi-Bernoulli mixture of point targets: what it assumes, and its prediction and update.

References stand in :mod:`echoset.estimators.points.mbm`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...models.parameters import parameter
from ...models.records import Array
from .clutter_map import Maps
from .kernels import births
from .kernels.bernoulli import (
    TINY,
    Bernoullis,
    Mixture,
    add_tracks,
    associate,
    merge,
    missed,
    newborn,
    nothing,
    prune,
    unite,
)
from .kernels.compiled import gaussians
from .kernels.gaussians import strongest
from .kernels.poisson import first_detections
from .sensing import Look, SensorParams, detection_probability, expected, positions
from .source import Classes
from .targets import TargetParams, elapse, survival
from .targets import newborn as appearing


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class Params(TargetParams, SensorParams):
    """Sensors, targets, and how the mixture is kept small and read."""

    TITLE = "mixture"

    poisson: bool = parameter(
        False,
        "1",
        "undetected targets are a Poisson process, not Bernoulli tracks; births at detections then "
        "spread like the clutter and begin with their first detection, not a scan later",
    )
    hide_rate: float = parameter(
        0.0, "s-1", "rate at which targets become invisible", within="[0, inf)"
    )
    show_rate: float = parameter(
        1.0, "s-1", "rate at which invisible targets become visible", within="[0, inf)"
    )
    gate: float = parameter(
        20.0, "1", "squared Mahalanobis distance of a detection from its gate", within="(0, inf)"
    )
    max_detections: int = parameter(
        1000, "1", "detections of a scan that are used, the likeliest", within="[1, inf)"
    )
    max_hypotheses: int = parameter(100, "1", "global hypotheses kept", within="[1, inf)")
    min_weight: float = parameter(
        1e-4, "1", "least weight of one, relative to the best", within="(0, inf)"
    )
    max_tracks: int = parameter(100, "1", "tracks kept", within="[1, inf)")
    min_existence: float = parameter(
        1e-5, "1", "Bernoullis that exist less likely are dropped", within="[0, 1)"
    )
    max_coast: float = parameter(
        0.0,
        "s",
        "tracks not detected for longer are given up; 0: existence alone decides",
        within="[0, inf)",
    )
    merge_distance: float = parameter(
        0.5,
        "1",
        "squared distance within which Bernoullis of a track merge; 0: never",
        within="[0, inf)",
    )
    merge_existence: float = parameter(0.1, "1", "difference in existence up to which they merge")
    unite_distance: float = parameter(
        0.0,
        "m, m s-1",
        "Euclidean distance of states below which tracks of the best hypothesis become one; 0: "
        "never",
        within="[0, inf)",
    )
    extraction: str = parameter(
        "existence",
        "1",
        "existence: the tracks of the best hypothesis that exist with extract_existence; "
        "cardinality: as many as is most probable, of the best hypothesis with that number",
        within=("existence", "cardinality"),
    )
    extract_existence: float = parameter(
        0.5, "1", "least existence of what is extracted by it", within="[0, 1)"
    )
    min_travel: float = parameter(
        0.0,
        "m",
        "only tracks that have been as far from where they began: leaves out what lies",
        within="[0, inf)",
    )
    lag: float = parameter(
        0.0,
        "s",
        "how long an estimate waits for what comes: fixed-lag smoothing, tracks shown from the "
        "start",
        within="[0, inf)",
    )
    retrodict: float = parameter(
        0.0,
        "s",
        "with a lag: how long before its first detection a target is shown, straight back",
        within="[0, inf)",
    )

    def __post_init__(self) -> None:
        SensorParams.__post_init__(self)
        TargetParams.__post_init__(self)


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """The reduced mixture after the scans at ``time_ns`` (None: before any).

    ``undetected`` are targets no detection has told of, ``waiting`` what appeared at the last
    detections and enters with the next prediction; ``next_label`` is free. ``maps`` of persistent
    clutter are those of the streams, ``classes`` those of the targets.
    """

    mixture: Mixture
    undetected: births.Components
    waiting: births.Components
    next_label: int
    time_ns: int | None
    maps: Maps = field(default_factory=dict)
    classes: Classes = field(default_factory=dict)


def init() -> State:
    """Nothing is known."""
    return State(nothing(4), births.none(), births.none(), 0, None)


def predict(state: State, params: Params, time_ns: int) -> tuple[State, float, Array, Array]:
    """The state at ``time_ns`` with what may have appeared, and in how many steps it did; F, Q.

    Raises
    ------
    InputError : the time goes back
    """
    dt, count, F, Q = elapse(params, state.time_ns, time_ns)
    a = state.mixture.local
    m, P = gaussians.predict(a.m, a.P, F, Q)
    change = params.hide_rate + params.show_rate
    settled = params.show_rate / change if change else 1.0
    local = Bernoullis(
        a.r * survival(params, a.m, dt),
        m,
        P,
        settled + (a.visible - settled) * np.exp(-change * dt),
        a.unseen + dt,
        np.arange(len(a)),
    )
    state = replace(state, mixture=replace(state.mixture, local=local), time_ns=time_ns)
    w, m, P = state.waiting
    waiting = np.minimum(count * w, 1.0), *gaussians.predict(m, P, F, Q)
    new = births.join(waiting, appearing(params, count))
    state = replace(state, waiting=births.none())
    if params.poisson:
        w, m, P = state.undetected
        old = w * survival(params, m, dt), *gaussians.predict(m, P, F, Q)
        return replace(state, undetected=births.join(old, new)), count, F, Q
    certain = np.ones((len(state.mixture.w), len(new[0])), bool)
    return _begin(state, newborn(*new), certain), count, F, Q


def update(state: State, seen: Look, params: Params, even: Array) -> State:
    """The state given a scan.

    ``even`` (n,) is the density of undetected targets that may be anywhere, at the detections.

    Raises
    ------
    EstimatorError : no hypothesis is possible
    """
    a = state.mixture.local
    z_hat, C, S = expected(seen, a.m, a.P, params.unscented)
    S = S[:, None] + seen.R
    log_l = gaussians.log_likelihood(seen.z, z_hat, S, seen.period, params.gate)
    p = detection_probability(seen, a.m, a.P, params.fov_mass)
    undetected, (new, m_new, P_new) = _first_detections(state.undetected, seen, params, even)
    free = np.maximum(seen.clutter + new, TINY)
    found = associate(
        state.mixture,
        log_l,
        p * a.visible,
        np.log(free),
        params.max_hypotheses,
        -np.log(params.min_weight),
    )
    local = missed(a, p).take(found.prior)
    hit = np.flatnonzero(found.detection >= 0)
    i, l = found.detection[hit], found.prior[hit]
    S = S[l, 0 if S.shape[1] == 1 else i]
    K, local.P[hit] = gaussians.gain(a.P[l], np.ascontiguousarray(C[l]), S)
    local.m[hit] = gaussians.correct(a.m[l], K, seen.z[i], z_hat[l], seen.period)
    local.r[hit] = local.visible[hit] = 1.0
    local.unseen[hit] = 0.0
    mixture = replace(state.mixture, local=local, w=found.w, table=found.table)
    waiting = births.join(state.waiting, _born(seen, params, found.w @ found.free))
    state = replace(state, mixture=mixture, undetected=undetected, waiting=waiting)
    r = new / free
    begun = np.flatnonzero(r > params.min_existence)
    return _begin(state, newborn(r[begun], m_new[begun], P_new[begun]), found.free[:, begun])


def reduce(state: State, params: Params) -> State:
    """Prune, merge and cap tracks, hypotheses and undetected targets."""
    a = state.mixture.local
    given_up = a.unseen > (params.max_coast or np.inf)
    mixture = replace(state.mixture, local=replace(a, r=np.where(given_up, 0.0, a.r)))
    if params.merge_distance:
        mixture = merge(mixture, params.merge_distance, params.merge_existence)
    mixture = prune(mixture, params.min_existence, params.max_tracks)
    if params.unite_distance:
        mixture = unite(mixture, params.unite_distance)
    w, m, P = state.undetected
    kept = strongest(w, params.min_existence, params.max_tracks)
    w, m, P = w[kept], m[kept], P[kept]
    if params.merge_distance:
        w, m, P, _ = gaussians.merge(w, m, P, P, params.merge_distance)
    return replace(state, mixture=mixture, undetected=(w, m, P))


def _begin(state: State, new: Bernoullis, free: Array) -> State:
    """The state with ``new`` tracks (n,) in the hypotheses ``free`` (G, n)."""
    label = state.next_label + np.arange(len(new))
    return replace(
        state,
        mixture=add_tracks(state.mixture, new, label, free),
        next_label=state.next_label + len(new),
    )


def _born(seen: Look, params: Params, novelty: Array) -> births.Components:
    """What may have appeared at the detections, to enter with the next prediction."""
    if params.poisson or params.birth != "detections":
        return births.none()
    std = np.array(params.birth_std_velocity)
    return births.at_detections(
        params.birth_rate, *positions(seen), novelty, std, params.max_births
    )


def _first_detections(
    undetected: births.Components, seen: Look, params: Params, even: Array
) -> tuple[births.Components, tuple[Array, Array, Array]]:
    """The undetected targets that stay so, and what the detections say if they are the first."""
    where, R = positions(seen)
    n = len(where)
    std = np.array(params.birth_std_velocity)
    m_even, P_even = np.hstack((where, np.zeros((n, 2)))), np.zeros((n, 4, 4))
    P_even[:, :2, :2], P_even[:, 2:, 2:] = R, np.diag(std**2)
    inside = detection_probability(seen, m_even, P_even, False) > 0
    even = even * inside
    w, m, P = undetected
    if not len(w):
        return undetected, (even, m_even, P_even)
    z_hat, C, S = expected(seen, m, P, params.unscented)
    S = np.broadcast_to(S[:, None] + seen.R, (len(w), n, 2, 2))
    p = detection_probability(seen, m, P, params.fov_mass)
    density = np.zeros((len(w) + 1, n))
    log_l = gaussians.log_likelihood(seen.z, z_hat, S, seen.period, params.gate)
    density[:-1], density[-1] = (p * w)[:, None] * np.exp(log_l), even
    j, i = np.nonzero(density[:-1])
    m_all, P_all = np.tile(m_even, (len(density), 1, 1)), np.tile(P_even, (len(density), 1, 1, 1))
    K, P_all[j, i] = gaussians.gain(P[j], C[j], S[j, i])
    m_all[j, i] = gaussians.correct(m[j], K, seen.z[i], z_hat[j], seen.period)
    return (w * (1 - p), m, P), first_detections(density, m_all, P_all)

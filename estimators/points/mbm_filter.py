"""Multi-Bernoulli mixture of point targets: what it assumes, and its prediction and update.

References stand in :mod:`echoset.estimators.points.mbm`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...models.parameters import parameter, require
from ...models.records import Array
from ..kernels.passes import SEARCH
from .backlog import Backlog, BacklogParams
from .context import FilterParams
from .cuts import Cut
from .kernels import births
from .kernels.bernoulli import (
    ONE,
    TINY,
    Bernoullis,
    Mixture,
    add_tracks,
    associate,
    matched,
    merge,
    missed,
    nothing,
    prune,
    unite,
)
from .kernels.bernoulli import newborn as begun
from .kernels.compiled import gaussians
from .kernels.gaussians import strongest
from .kernels.groups import MANY, MOST
from .kernels.modes import Way
from .kernels.poisson import first_detections as of_each
from .model.edge import detection_probability, unseen
from .model.measurement import innovations, log_likelihood, updated
from .model.sensing import Look, SensorParams
from .model.sight import Sight
from .model.targets import Interval, elapse, limit, newborn, started
from .modes import ModeParams, initial, moved
from .times import Memory
from .trails import TrailParams


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class Params(TrailParams, ModeParams, BacklogParams, FilterParams):
    """Sensors, targets, and how the mixture is kept small and read."""

    TITLE = "mixture"
    WAYS = ("none", "whole", SEARCH)

    smooth: str = parameter(
        "none",
        "1",
        "none: each estimate from what came until then; whole: from all of the recording; 5s: from "
        "what came up to 5 s later; search: whole, by the likeliest trajectories that a search "
        "finds from those of the filter on",
    )
    poisson: bool = parameter(
        True,
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
    max_hypotheses: int = parameter(
        100, "1", "hypotheses kept, of each group of tracks", within="[1, inf)"
    )
    min_weight: float = parameter(
        1e-4, "1", "least weight of one, relative to the best", within="(0, inf)"
    )
    group_dependence: float | None = parameter(
        0.01,
        "1",
        "total variation between what two tracks do together and each by itself, up to which they "
        "part; null: all tracks are one group, as they are with unite_distance and with extraction "
        "by cardinality, which ask of whole hypotheses",
        within="[0, 1]",
    )
    max_tracks: int | None = parameter(
        None,
        "1",
        "tracks kept; null: two for each detection of a scan, at least 100, up to 1000",
        within="[1, inf)",
    )
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
        "only tracks detected as far from where they began, or smoothed from where they end: "
        "leaves out what lies",
        within="[0, inf)",
    )
    lag: float = parameter(
        0.0,
        "s",
        "how long an estimate waits for what comes, tracks shown from the start; smooth, where it "
        "is not none, says so in its place",
        within="[0, inf)",
    )
    retrodict: float = parameter(
        0.0,
        "s",
        "with a lag or smoothed: how long before its first detection a target is shown, straight "
        "back",
        within="[0, inf)",
    )

    def __post_init__(self) -> None:
        FilterParams.__post_init__(self)
        ModeParams.__post_init__(self)
        TrailParams.__post_init__(self)
        known = self.smooth != SEARCH or (self.poisson and self.motion != "imm")
        require(known, "smooth", "search with poisson alone, and one motion", self.smooth)

    @property
    def looks_back(self) -> bool:
        """Whether what targets were is asked again when more is known."""
        return self.lag > 0 or self.wait is not None

    @property
    def dependence(self) -> float | None:
        """``group_dependence``, null where whole hypotheses are asked of."""
        whole = self.unite_distance or self.extraction == "cardinality"
        return None if whole else self.group_dependence


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """The reduced mixture after the scans at ``time_ns`` (None: before any).

    ``undetected`` are targets no detection has told of, ``backlog`` those of them that may be
    anywhere, ``waiting`` what appeared at the last detections and enters with the next prediction;
    ``next_label`` is free, ``memory`` what is known
    beside; ``cut`` is the expected number of targets that limits left out this time. ``way`` is how
    those that manoeuvre came there.
    """

    mixture: Mixture
    undetected: births.Components
    waiting: births.Components
    backlog: Backlog
    next_label: int
    time_ns: int | None
    memory: Memory = field(default_factory=Memory)
    cut: Cut = field(default_factory=dict)
    way: Way | None = None


def init(width: int = 4, mode: Array = ONE) -> State:
    """Nothing is known of targets whose state has so many entries, and modes as of ``mode``."""
    none = births.none(width)
    return State(nothing(width, mode), none, none, Backlog(0.0), 0, None)


def predict(state: State, params: Params, time_ns: int) -> tuple[State, Interval]:
    """The state at ``time_ns`` with what may have appeared, and the interval since.

    Raises
    ------
    InputError : the time goes back
    """
    gone = elapse(params, state.time_ns, time_ns)
    a = state.mixture.local
    m, P, modes, way, known = moved(a.m, a.P, a.modes, params, gone)
    backlog = Backlog(params.backlog) if state.time_ns is None else state.backlog
    change = params.hide_rate + params.show_rate
    settled = params.show_rate / change if change else 1.0
    local = Bernoullis(
        np.where(known, a.r * gone.survival(params, a.m), 0.0),
        m,
        np.where(known[:, None, None], P, np.eye(params.width)),
        settled + (a.visible - settled) * np.exp(-change * gone.dt),
        a.unseen + gone.dt,
        np.arange(len(a)),
        modes,
    )
    mixture = replace(state.mixture.restarted(), local=local)
    state = replace(state, mixture=mixture, time_ns=time_ns, cut={}, way=way)
    new = births.join(_moved(state.waiting, params, gone), newborn(params, gone))
    state = replace(state, waiting=births.none(params.width))
    if params.poisson:
        old = _moved(state.undetected, params, gone)
        backlog = backlog.predict(params.p_survive, gone.steps)
        return replace(state, undetected=births.join(old, new), backlog=backlog), gone
    w, m, P = births.at_most_one(*new)
    certain = np.ones((len(state.mixture.w), len(w)), bool)
    group = np.full(len(w), 0 if params.dependence is None else -1)
    state = _begin(state, begun(w, m, P, initial(params)), certain, group)
    # A track begins where it is first detected, which is known only then.
    start = state.mixture.start.copy()
    start[len(start) - len(w) :] = np.nan
    return replace(state, mixture=replace(state.mixture, start=start)), gone


def update(
    state: State, seen: Look, params: Params, own: SensorParams, even: Array
) -> tuple[State, Array]:
    """The state given a scan, and how probably (n,) no known target made the detections.

    Equations (1) to (5) of ``docs/systems/filters.md``, whose table of symbols has these letters.

    ``own`` holds for the sensor, and ``even`` (n,) is the density at the detections of undetected
    targets that may be anywhere.

    Raises
    ------
    EstimatorError : no hypothesis is possible
    """
    a = state.mixture.local
    sight = Sight.of(a.m, a.P, a.modes, seen, params.gate, own)
    log_hit, p = sight.log_hit(a.visible), sight.mean(sight.border.p)
    undetected, (new, m_new, P_new) = first_detections(state.undetected, seen, params, own, even)
    free = np.maximum(seen.clutter + new, TINY)
    found = associate(
        state.mixture,
        log_hit,
        p * a.visible,
        np.log(free),
        params.max_hypotheses,
        -np.log(params.min_weight),
        params.dependence is not None,
        MOST if params.looks_back else MANY,
    )
    # (1), and (2) for who is detected.
    hit = np.flatnonzero(found.detection >= 0)
    i, l = found.detection[hit], found.prior[hit]
    m, P, modes = sight.missed(a.visible, np.ones(len(a)))
    local = missed(replace(a, m=m, P=P, modes=modes), p).take(found.prior)
    local.put(hit, *sight.detected(l, i))
    local.r[hit] = local.visible[hit] = 1.0
    local.unseen[hit] = 0.0
    start, best = state.mixture.start.copy(), found.mixture.table[0]
    first = np.flatnonzero((best >= 0) & np.isnan(start[:, 0]))
    first = first[found.detection[best[first]] >= 0]
    start[first] = local.m[best[first]]
    mixture = replace(found.mixture, local=local, start=start)
    if found.over:
        mixture = matched(mixture, found.loose)
    state = replace(state, mixture=mixture, undetected=undetected)
    if found.over:
        over = state.cut.get("max_hypotheses", 0.0) + found.over
        state = replace(state, cut={**state.cut, "max_hypotheses": over})
    r = new / free * (1 - found.taken)  # (3)
    some = np.flatnonzero(r > params.min_existence)
    new_tracks = begun(r[some], m_new[some], P_new[some], initial(params))
    state = _begin(state, new_tracks, found.free[:, some], found.of[some])
    return state, found.novelty()


def reduce(state: State, params: Params, detections: int = 0) -> State:
    """Prune, merge and cap tracks, hypotheses and undetected targets."""
    a, most = state.mixture.local, limit(params.max_tracks, detections, 2, 100)
    given_up = a.unseen > (params.max_coast or np.inf)
    mixture = replace(state.mixture, local=replace(a, r=np.where(given_up, 0.0, a.r)))
    if params.merge_distance:
        mixture = merge(mixture, params.merge_distance, params.merge_existence)
    mixture, lost = prune(mixture, params.min_existence, most, params.dependence)
    if params.unite_distance:
        mixture = unite(mixture, params.unite_distance)
    w, m, P = state.undetected
    kept = strongest(w, m, params.min_existence, most)
    lost += max(float(w[w > params.min_existence].sum() - w[kept].sum()), 0.0)
    w, m, P = w[kept], m[kept], P[kept]
    if params.merge_distance:
        w, m, P, _ = gaussians.merge(w, m, P, P, params.merge_distance)
    cut = {**state.cut, "max_tracks": state.cut.get("max_tracks", 0.0) + lost}
    return replace(state, mixture=mixture, undetected=(w, m, P), cut=cut)


def _begin(state: State, new: Bernoullis, free: Array, group: Array) -> State:
    """The state with ``new`` tracks (n,) in the hypotheses ``free`` (G, n) of a ``group`` (n,)."""
    label = state.next_label + np.arange(len(new))
    return replace(
        state,
        mixture=add_tracks(state.mixture, new, label, free, group),
        next_label=state.next_label + len(new),
    )


def _moved(old: births.Components, params: Params, gone: Interval) -> births.Components:
    """What was there before and is still, at its new place."""
    w, m, P = old
    w = w * gone.survival(params, m)
    m, P, known = gone.predict(m, P)
    return w[known], m[known], P[known]


def first_detections(
    undetected: births.Components, seen: Look, params: Params, own: SensorParams, even: Array
) -> tuple[births.Components, tuple[Array, Array, Array]]:
    """The undetected targets that stay so, and what the detections say if they are the first."""
    m_even, P_even, rated = started(params, seen)
    n = len(m_even)
    even = even * rated * detection_probability(seen, m_even, P_even, False)
    w, m, P = undetected
    if not len(w):
        return undetected, (even, m_even, P_even)
    z_hat, C, S = innovations(seen, m, P, own.unscented)
    p, m_missed, P_missed = unseen(seen, m, P, np.ones(len(w)), own.fov_mass)
    density = np.zeros((len(w) + 1, n))
    log_l = log_likelihood(seen, z_hat, S, params.gate)
    density[:-1], density[-1] = (p * w)[:, None] * np.exp(log_l), even
    j, i = np.nonzero(density[:-1])
    m_all, P_all = np.tile(m_even, (len(density), 1, 1)), np.tile(P_even, (len(density), 1, 1, 1))
    m_all[j, i], P_all[j, i] = updated(seen, m, P, z_hat, C, S, j, i)
    known = np.maximum(p[j], TINY)
    density[j, i] *= detection_probability(seen, m_all[j, i], P_all[j, i], own.fov_mass) / known
    return (w * (1 - p), m_missed, P_missed), of_each(density, m_all, P_all)

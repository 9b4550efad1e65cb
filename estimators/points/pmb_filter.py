"""Poisson multi-Bernoulli filter of point targets: assumptions, prediction and update.

References stand in :mod:`echoset.estimators.points.pmb`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...models.errors import InputError
from ...models.parameters import parameter
from ...models.records import Array
from ..kernels.passes import SmoothParams
from .backlog import Backlog
from .context import FilterParams
from .cuts import Cut
from .edge import Border, detection_probability
from .kernels import births
from .kernels.compiled import gaussians
from .kernels.compiled.association import marginals
from .kernels.compiled.pairs import matched
from .kernels.gaussians import falling, strongest
from .pairs import Pairs, near
from .sensing import UNKNOWN, Look, SensorParams, positions
from .targets import Interval, elapse, newborn
from .times import Memory

SURE = 1e-6
"""Least probability of a miss, so that detections are not sure but compared."""
FREE = 1e-9
"""Least density of clutter and of first detections beside the likeliest target's, likewise."""
FAINT = 1e-3
"""Odds of a pair, below which it is no pair."""
TINY = 1e-300
MERGED = 0.5
"""Squared distance within which components of undetected targets become one."""


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class Params(SmoothParams, FilterParams):
    """Sensors, targets, and which of them are kept and shown."""

    TITLE = "filter"

    backlog: float = parameter(
        100.0,
        "1",
        "steps of births that wait undetected where no sensor has looked, at the start",
        within="[0, inf)",
    )
    gate: float = parameter(
        14.0, "1", "squared Mahalanobis distance of a detection from its gate", within="(0, inf)"
    )
    max_tracks: int | None = parameter(
        None,
        "1",
        "targets kept, those that are likeliest to explain a detection; null: two for each "
        "detection of a scan, at least 100",
        within="[1, inf)",
    )
    min_existence: float = parameter(
        1e-4, "1", "targets that exist less likely are dropped", within="(0, 1)"
    )
    extract_existence: float = parameter(
        0.5, "1", "least existence of what is extracted", within="[0, 1)"
    )
    extract_smoothed: float = parameter(
        0.95,
        "1",
        "smoothed: least existence, then or later, of what is extracted; more than for a filter, "
        "since it is the largest of many",
        within="[0, 1)",
    )

    def __post_init__(self) -> None:
        FilterParams.__post_init__(self)
        SmoothParams.__post_init__(self)


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """T Bernoullis by label (T,), rising: existence r (T,), means m (T, 4), covariances P."""

    label: Array
    r: Array
    m: Array
    P: Array

    def __len__(self) -> int:
        return len(self.r)

    def take(self, index: Array) -> Tracks:
        """The tracks ``index``."""
        return Tracks(self.label[index], self.r[index], self.m[index], self.P[index])


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """What is known after the scans at ``time_ns`` (None: before any).

    Targets that were detected are ``tracks``; of the others, ``undetected`` are components and
    ``backlog`` what may be anywhere. ``next_label`` is free, ``memory`` what is known beside, and
    ``cut`` what limits left out.
    """

    tracks: Tracks
    undetected: births.Components
    backlog: Backlog
    next_label: int
    time_ns: int | None
    memory: Memory = field(default_factory=Memory)
    cut: Cut = field(default_factory=dict)


def init(params: Params) -> State:
    """No target is known."""
    none = Tracks(np.zeros(0, np.int64), np.zeros(0), np.zeros((0, 4)), np.zeros((0, 4, 4)))
    return State(none, births.none(), Backlog(params.backlog), 0, None)


def predict(state: State, params: Params, time_ns: int) -> tuple[State, Interval]:
    """The state at ``time_ns`` with what may have appeared, and the interval since.

    Raises
    ------
    InputError : the time goes back
    """
    gone = elapse(params, state.time_ns, time_ns)
    a = state.tracks
    m, P, known = gone.predict(a.m, a.P)
    tracks = Tracks(a.label, a.r * gone.survival(params, a.m), m, P)
    if not known.all():
        tracks = tracks.take(np.flatnonzero(known))
    w, m, P = state.undetected
    w = w * gone.survival(params, m)
    m, P, known = gone.predict(m, P)
    old = w[known], m[known], P[known]
    undetected = births.join(old, newborn(params, gone))
    backlog = state.backlog.predict(params.p_survive, gone.steps)
    return replace(
        state, tracks=tracks, undetected=undetected, backlog=backlog, time_ns=time_ns, cut={}
    ), gone


def update(state: State, seen: Look, params: Params, own: SensorParams) -> State:
    """The state given a look, with the parameters ``own`` of its sensor.

    Each Bernoulli has the marginal probabilities of its associations, its density the moments of
    their mixture; each detection begins a Bernoulli.

    Raises
    ------
    InputError : it is not known where the clutter lies
    """
    a = state.tracks
    state, first, m_first, P_first = _first_detections(state, seen, params, own)
    pairs = near(seen, a.m, a.P, own.unscented, params.gate)
    t, z = pairs.target, pairs.detection
    border = Border.of(seen, a.m, a.P, own.fov_mass)
    p, (m_missed, P_missed) = border.p, border.missed(np.ones(len(a)), np.ones(len(a)))
    free = np.maximum(seen.clutter + first, TINY)
    miss = np.maximum(1 - a.r * p, SURE)
    most = a.r * seen.p_detect / miss
    pairs = pairs.take(np.flatnonzero(most[t] * np.exp(pairs.log_l) >= FAINT * free[z]))
    t, z = pairs.target, pairs.detection
    m_hit, P_hit = pairs.updated(seen, a.m, a.P)
    density = a.r[t] * _found(seen, own, p, pairs, m_hit, P_hit) * np.exp(pairs.log_l)
    np.maximum.at(free, z, FREE * density)
    hit, none = marginals(t, z, density / (miss[t] * free[z]), len(a), len(free))
    still = none * a.r * (1 - p) / miss
    r, m, P = matched(
        np.concatenate((np.arange(len(a)), t)),
        np.concatenate((still, hit)),
        np.concatenate((m_missed, m_hit)),
        np.concatenate((P_missed, P_hit)),
        len(a),
    )
    new = np.clip(1 - np.bincount(z, hit, len(free)), 0.0, 1.0) * first / free
    most = len(new) if params.max_births is None else params.max_births
    some = strongest(new, m_first, params.min_existence, most)
    label = state.next_label + np.arange(len(some))
    kept = np.flatnonzero(r >= params.min_existence)
    tracks = Tracks(
        np.concatenate((a.label[kept], label)),
        np.concatenate((np.minimum(r[kept], 1.0), new[some])),
        np.concatenate((m[kept], m_first[some])),
        np.concatenate((P[kept], P_first[some])),
    )
    cut = dict(state.cut)
    if pairs.cut:
        cut["pairs"] = cut.get("pairs", 0.0) + pairs.cut
    return replace(state, tracks=tracks, next_label=state.next_label + len(some), cut=cut)


def reduce(state: State, params: Params, detections: int) -> State:
    """The state with ``max_tracks``, or as many as so many ``detections`` at once allow."""
    a = state.tracks
    most = max(100, 2 * detections) if params.max_tracks is None else params.max_tracks
    if len(a) <= most:
        return state
    # The odds of a detection where the target is expected.
    promise = a.r / np.sqrt(a.P[:, 0, 0] * a.P[:, 1, 1] - a.P[:, 0, 1] ** 2)
    kept = np.sort(falling(promise, a.m)[:most])
    lost = float(a.r.sum() - a.r[kept].sum())
    cut = {**state.cut, "max_tracks": state.cut.get("max_tracks", 0.0) + lost}
    return replace(state, tracks=a.take(kept), cut=cut)


def _found(seen: Look, own: SensorParams, p: Array, pairs: Pairs, m: Array, P: Array) -> Array:
    """Probability of detection (k,) by each pair: the mass in view of m, P, once updated."""
    found = np.asarray(p[pairs.target])
    partial = np.flatnonzero((found > 0) & (found < seen.p_detect))
    if len(partial):
        found[partial] = detection_probability(seen, m[partial], P[partial], own.fov_mass)
    return found


def _first_detections(
    state: State, seen: Look, params: Params, own: SensorParams
) -> tuple[State, Array, Array, Array]:
    """What stays undetected, and of each detection as the first of a target: density and moments.

    The density (n,) is that of detections of undetected targets; means (n, 4), covariances.

    Raises
    ------
    InputError : it is not known where the clutter lies
    """
    where, R = positions(seen)
    n = len(where)
    m_even, P_even = np.hstack((where, np.zeros((n, 2)))), np.zeros((n, 4, 4))
    P_even[:, :2, :2], P_even[:, 2:, 2:] = R, np.diag(np.square(params.birth_std_velocity))
    even, backlog = np.zeros(n), state.backlog
    if params.birth == "detections" and params.birth_rate:
        if np.isnan(seen.spatial).any():
            raise InputError(UNKNOWN)
        even = params.birth_rate * seen.p_detect * backlog.at(where) * seen.spatial
        backlog = backlog.missed(seen)
    w, m, P = state.undetected
    if not len(w):
        return replace(state, backlog=backlog), even, m_even, P_even
    pairs = near(seen, m, P, own.unscented, params.gate)
    border = Border.of(seen, m, P, own.fov_mass)
    p, (m_missed, P_missed) = border.p, border.missed(np.ones(len(w)), np.ones(len(w)))
    m_hit, P_hit = pairs.updated(seen, m, P)
    density = _found(seen, own, p, pairs, m_hit, P_hit) * w[pairs.target] * np.exp(pairs.log_l)
    total, mean, spread = matched(
        np.concatenate((np.arange(n), pairs.detection)),
        np.concatenate((even, density)),
        np.concatenate((m_even, m_hit)),
        np.concatenate((P_even, P_hit)),
        n,
    )
    kept = np.flatnonzero(w * (1 - p) > params.min_existence)
    left = (w * (1 - p))[kept], m_missed[kept], P_missed[kept]
    if len(kept):
        w, m, P = left
        left = gaussians.merge(w, m, P, P, MERGED)[:3]
    return replace(state, backlog=backlog, undetected=left), total, mean, spread

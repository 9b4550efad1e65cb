"""Poisson multi-Bernoulli filter of point targets: assumptions, prediction and update.

References stand in :mod:`echoset.estimators.points.pmb`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...models.errors import InputError
from ...models.parameters import parameter
from ...models.records import Array
from .backlog import Backlog, BacklogParams
from .context import FilterParams
from .cuts import Cut
from .kernels import births
from .kernels.compiled import gaussians
from .kernels.compiled.association import marginals
from .kernels.compiled.pairs import matched
from .kernels.gaussians import falling, strongest
from .kernels.modes import Modes, Way
from .model.edge import Border, detection_probability
from .model.measurement import positions
from .model.sensing import UNKNOWN, Look, SensorParams
from .model.targets import Interval, elapse, newborn, started
from .modes import ModeParams, initial, moved
from .pairs import Pairs, near
from .times import Memory
from .trails import TrailParams

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
class Params(TrailParams, ModeParams, BacklogParams, FilterParams):
    """Sensors, targets, and which of them are kept and shown."""

    TITLE = "filter"

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

    def __post_init__(self) -> None:
        FilterParams.__post_init__(self)
        ModeParams.__post_init__(self)
        TrailParams.__post_init__(self)


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """T Bernoullis by label (T,), rising: existence r (T,), means m (T, 4), covariances P.

    Where targets manoeuvre m and P are the moments of their ``modes``.
    """

    label: Array
    r: Array
    m: Array
    P: Array
    modes: Modes | None = None

    def __len__(self) -> int:
        return len(self.r)

    def take(self, index: Array) -> Tracks:
        """The tracks ``index``."""
        modes = None if self.modes is None else self.modes.take(index)
        return Tracks(self.label[index], self.r[index], self.m[index], self.P[index], modes)

    def join(self, label: Array, r: Array, m: Array, P: Array, mode: Array) -> Tracks:
        """The tracks and new ones, whose modes have the probabilities ``mode`` (M,)."""
        modes = None if self.modes is None else self.modes.join(Modes.of(mode, m, P))
        columns = (self.label, label), (self.r, r), (self.m, m), (self.P, P)
        label, r, m, P = (np.concatenate(pair) for pair in columns)
        return Tracks(label, r, m, P, modes)


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """What is known after the scans at ``time_ns`` (None: before any).

    Targets that were detected are ``tracks``; of the others, ``undetected`` are components and
    ``backlog`` what may be anywhere. ``way`` is how those that manoeuvre came there; ``next_label``
    is free, ``memory`` what is known beside, and ``cut`` what limits left out. ``evidence`` is that
    of the time.
    """

    tracks: Tracks
    undetected: births.Components
    backlog: Backlog
    next_label: int
    time_ns: int | None
    memory: Memory = field(default_factory=Memory)
    cut: Cut = field(default_factory=dict)
    way: Way | None = None
    evidence: float = 0.0


def init(params: Params) -> State:
    """No target is known."""
    unborn = births.none(params.width)
    label, (r, m, P) = np.zeros(0, np.int64), unborn
    modes = Modes.of(initial(params), m, P) if params.modes > 1 else None
    none = Tracks(label, r, m, P, modes)
    return State(none, unborn, Backlog(params.backlog), 0, None)


def predict(state: State, params: Params, time_ns: int) -> tuple[State, Interval]:
    """The state at ``time_ns`` with what may have appeared, and the interval since.

    Raises
    ------
    InputError : the time goes back
    """
    gone = elapse(params, state.time_ns, time_ns)
    a = state.tracks
    r = a.r * gone.survival(params, a.m)
    m, P, modes, way, known = moved(a.m, a.P, a.modes, params, gone)
    tracks = Tracks(a.label, r, m, P, modes).take(np.flatnonzero(known))
    w, m, P = state.undetected
    w = w * gone.survival(params, m)
    m, P, known = gone.predict(m, P)
    old = w[known], m[known], P[known]
    undetected = births.join(old, newborn(params, gone))
    backlog = state.backlog.predict(params.p_survive, gone.steps)
    return replace(
        state,
        tracks=tracks,
        undetected=undetected,
        backlog=backlog,
        time_ns=time_ns,
        cut={},
        way=way,
        evidence=0.0,
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
    state, density, m_first, P_first = _first_detections(state, seen, params, own)
    free = np.maximum(seen.clutter + density, TINY)
    tracks, taken, cut, evidence = _associated(a, seen, params, own, free)
    state = replace(state, evidence=state.evidence + evidence - own.clutter_rate)
    new = np.clip(1 - taken, 0.0, 1.0) * density / free
    most = len(new) if params.max_births is None else params.max_births
    some = strongest(new, m_first, params.min_existence, most)
    label = state.next_label + np.arange(len(some))
    tracks = tracks.join(label, new[some], m_first[some], P_first[some], initial(params))
    if cut:
        state = replace(state, cut={**state.cut, "pairs": state.cut.get("pairs", 0.0) + cut})
    return replace(state, tracks=tracks, next_label=state.next_label + len(some))


def _associated(
    a: Tracks, seen: Look, params: Params, own: SensorParams, free: Array
) -> tuple[Tracks, Array, int, float]:
    """The tracks given a look, and how probably (n,) they made the detections.

    ``free`` (n,) is the density of detections that they did not make. All Gaussians are compared
    with detections, each with its share of its track; also how many pairs were left out, and the
    evidence as of a Poisson process, but for the number of false detections.
    """
    T, n, M = len(a), len(free), 1 if a.modes is None else a.modes.w.shape[1]
    share, m, P = (np.ones(T), a.m, a.P) if a.modes is None else a.modes.flat()
    owner, there = np.repeat(np.arange(T), M), np.repeat(a.r, M) * share
    pairs = near(seen, m, P, own.unscented, params.gate)
    border = Border.of(seen, m, P, own.fov_mass)
    p, (m_missed, P_missed) = border.p, border.missed(np.ones(len(m)), np.ones(len(m)))
    miss = np.maximum(1 - np.bincount(owner, there * p, T), SURE)
    most = (a.r * seen.p_detect / miss)[owner]
    faint = most[pairs.target] * np.exp(pairs.log_l) < FAINT * free[pairs.detection]
    pairs = pairs.take(np.flatnonzero(~faint))
    g, z = pairs.target, pairs.detection
    m_hit, P_hit = pairs.updated(seen, m, P)
    density = there[g] * _found(seen, own, p, pairs, m_hit, P_hit) * np.exp(pairs.log_l)
    evidence = float(np.log(free + np.bincount(z, density, n)).sum() - there @ p)
    t, of = owner[g], np.arange(len(g))
    whole, at = density, z
    if M > 1:
        key, of = np.unique(t * n + z, return_inverse=True)
        t, at = np.divmod(key, max(n, 1))
        whole = np.bincount(of, density, len(key))
    np.maximum.at(free, at, FREE * whole)
    hit, none = marginals(t, at, whole / (miss[t] * free[at]), T, n)
    still = (none / miss)[owner] * there * (1 - p)
    # A pair that no density supports has no weight, and no share either.
    part = hit[of] * density / np.maximum(whole, TINY)[of]
    w, m_new, P_new = matched(
        np.concatenate((np.arange(T * M), g)),
        np.concatenate((still, part)),
        np.concatenate((m_missed, m_hit)),
        np.concatenate((P_missed, P_hit)),
        T * M,
    )
    r = np.bincount(owner, w, T)
    kept = np.flatnonzero(r >= params.min_existence)
    modes = None
    if a.modes is not None:
        gone = w == 0
        m_new[gone], P_new[gone] = m[gone], P[gone]
        mode = w / np.maximum(r, TINY)[owner]
        modes = a.modes.like(mode, m_new, P_new).take(kept)
        m_new, P_new = modes.together()
    else:
        m_new, P_new = m_new[kept], P_new[kept]
    tracks = Tracks(a.label[kept], np.minimum(r[kept], 1.0), m_new, P_new, modes)
    return tracks, np.bincount(at, hit, n), pairs.cut, evidence


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
    m_even, P_even, rated = started(params, seen)
    n = len(m_even)
    even, backlog = np.zeros(n), state.backlog
    if params.birth == "detections" and params.birth_rate:
        if np.isnan(seen.spatial).any():
            raise InputError(UNKNOWN)
        where = positions(seen)[0]
        even = params.birth_rate * seen.p_detect * backlog.at(where) * seen.spatial * rated
        expected = params.birth_rate * seen.p_detect * backlog.mean(seen)
        state = replace(state, evidence=state.evidence - expected)
        backlog = backlog.missed(seen)
    w, m, P = state.undetected
    if not len(w):
        return replace(state, backlog=backlog), even, m_even, P_even
    pairs = near(seen, m, P, own.unscented, params.gate)
    border = Border.of(seen, m, P, own.fov_mass)
    p, (m_missed, P_missed) = border.p, border.missed(np.ones(len(w)), np.ones(len(w)))
    state = replace(state, evidence=state.evidence - float(w @ p))
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

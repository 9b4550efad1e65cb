"""Gaussian mixture of the PHD filter: what it assumes, its prediction, reduction and reading.

References stand in :mod:`echoset.estimators.points.phd`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...models.parameters import parameter
from ...models.records import Array
from .context import FilterParams
from .cuts import Cut
from .kernels import births
from .kernels.bernoulli import ONE
from .kernels.compiled import gaussians
from .kernels.gaussians import strongest
from .kernels.modes import Modes, Way
from .model.targets import Interval, elapse, limit, newborn
from .modes import ModeParams, initial, moved
from .times import Memory
from .trails import TrailParams

CROWD = 5000
"""Updated components that are looked at."""


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class Params(TrailParams, ModeParams, FilterParams):
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
    keep: bool = parameter(
        False, "1", "keep the updated mixture of every step, for regions that are named afterwards"
    )
    keep_components: int = parameter(
        500, "1", "the strongest so many components of it", within="[1, inf)"
    )

    def __post_init__(self) -> None:
        FilterParams.__post_init__(self)
        ModeParams.__post_init__(self)
        TrailParams.__post_init__(self)


@dataclass(frozen=True, slots=True, eq=False)
class Mixture:
    """Intensity of targets: weights w (J,), means m (J, 4), covariances P (J, 4, 4), label (J,).

    ``origin`` (J,) is the component that each was after the scans before, -1 for a new one. Where
    targets manoeuvre m and P are the moments of their ``modes``.
    """

    w: Array
    m: Array
    P: Array
    label: Array
    origin: Array
    modes: Modes | None = None

    def take(self, index: Array) -> Mixture:
        """The components ``index``."""
        modes = None if self.modes is None else self.modes.take(index)
        columns = self.w, self.m, self.P, self.label, self.origin
        w, m, P, label, origin = (column[index] for column in columns)
        return Mixture(w, m, P, label, origin, modes)


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """The reduced mixture after the scans at ``time_ns`` (None: before any).

    ``waiting`` appeared at the last detections and enters with the next prediction;
    ``next_label`` is free, ``memory`` what is known beside; ``cut`` is the expected number of
    targets that limits left out this time. ``way`` is how those that manoeuvre came there.
    """

    mixture: Mixture
    waiting: births.Components
    next_label: int
    time_ns: int | None
    memory: Memory = field(default_factory=Memory)
    cut: Cut = field(default_factory=dict)
    way: Way | None = None


def init(width: int = 4, mode: Array = ONE) -> State:
    """Nothing is known of targets whose state has so many entries, and modes as of ``mode``."""
    nothing, none = births.none(width), np.zeros(0, np.int64)
    modes = Modes.of(mode, *nothing[1:]) if len(mode) > 1 else None
    return State(Mixture(*nothing, none, none, modes), nothing, 0, None)


def predict(state: State, params: Params, time_ns: int) -> tuple[State, Array, Interval]:
    """The mixture at ``time_ns`` with what may have appeared (eqs. 22-29), and which of it did.

    Births at detections appeared at the last scan and move; others stand where they are expected.

    Raises
    ------
    InputError : the time goes back
    """
    gone = elapse(params, state.time_ns, time_ns)
    old, (w, m, P), mode = state.mixture, state.waiting, initial(params)
    modes = None if old.modes is None else old.modes.join(Modes.of(mode, m, P))
    w, m, P = np.concatenate((old.w, w)), np.concatenate((old.m, m)), np.concatenate((old.P, P))
    w = w * gone.survival(params, m)
    m, P, modes, way, known = moved(m, P, modes, params, gone)
    label = np.concatenate((old.label, state.next_label + np.arange(len(w) - len(old.w))))
    is_new = np.arange(len(w)) >= len(old.w)
    new = newborn(params, gone)
    if modes is not None:
        modes = modes.take(known).join(Modes.of(mode, *new[1:]))
    w, m, P = births.join((w[known], m[known], P[known]), new)
    first = state.next_label + len(label) - len(old.w)
    label = np.concatenate((label[known], first + np.arange(len(new[0]))))
    origin = np.where(is_new, -1, np.arange(len(is_new)))[known]
    origin = np.concatenate((origin, np.full(len(new[0]), -1)))
    is_new = np.concatenate((is_new[known], np.ones(len(new[0]), bool)))
    predicted = replace(
        state,
        mixture=Mixture(w, m, P, label, origin, modes),
        waiting=births.none(params.width),
        next_label=first + len(new[0]),
        time_ns=time_ns,
        cut={},
        way=way,
    )
    return predicted, is_new, gone


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
    modes = None
    if x.modes is not None:
        by_leader = params.merge_by == "leader"
        into = _leaders(x.m, scale, leader, params.merge_distance, by_leader)
        modes = x.modes.merged(into, x.w).take(leader)
    merged = Mixture(w, m, P, x.label[leader], x.origin[leader], modes)
    return merged.take(kept), max(float(cut), 0.0)


def _leaders(m: Array, scale: Array, leader: Array, threshold: float, by_leader: bool) -> Array:
    """The ``leader`` (J,) that each component has joined: the first that is near enough."""
    v = m[:, None] - m[leader]
    root = np.linalg.cholesky(scale)
    root = root[None, leader] if by_leader else root[:, None]
    e = np.linalg.solve(np.broadcast_to(root, (*v.shape, v.shape[2])), v[..., None])[..., 0]
    near = (e**2).sum(2) <= threshold
    near[leader] = np.eye(len(leader), dtype=bool)
    return np.asarray(leader[near.argmax(1)]) if len(leader) else leader


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

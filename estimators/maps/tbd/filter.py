"""``tbd``: targets tracked in the range-angle maps of base stations, before any detection.

The likelihood of all cells of all maps given the targets (:mod:`..kernels.response`) in place of
thresholds, gates and clusters. In every scan targets are predicted, corrected one after the other
(:mod:`.targets`), left if they explain nothing, and found where the maps hold more than the targets
explain (:mod:`.moves`); now and then a few are explained anew. The means of all cells come from the
geometry and the waveform that the recording states, so that nothing is learnt for a layout.
S. Davey, M. Rutten and B. Cheung, "A comparison of detection performance for several
track-before-detect algorithms", EURASIP J. Adv. Signal Process. 2008, tells the field.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from ....models.classifier import CLASSES
from ....models.errors import EstimatorError
from ....models.records import Array, Estimates, Objects, Recording, Scan
from ...kernels.passes import smoothed
from ..choice import Choice
from ..params import MAPS
from .moves import CROWD, born, needed, overlapping, rethought, without
from .params import Params
from .scene import Layout, View
from .smoothing import Trail, back
from .targets import GAIN, SURE, VEHICLE, YOUNG, Targets, predict, update

__all__ = ["PRESETS", "STREAMS", "SUMMARY", "Params", "estimate"]
SUMMARY = "Track-before-detect in range-angle maps of base stations, by the likelihood of all cells"
STREAMS = (MAPS,)
PRESETS: dict[str, dict[str, object]] = {}
NAMES, UNITS = ("x", "y", "vx", "vy"), ("m", "m", "m s-1", "m s-1")
MEMORY = 0.7
"""What the evidence of a place keeps from scan to scan."""
SOON = 1, 3, 6, 10
"""Ages in scans at which what is new beside another target is explained anew."""
OVERLAP = 6.0
"""Log-odds of existence that a target loses in a scan in which its body overlaps another."""
FIRST, LATER = 30, 2
"""Places at which new targets are looked for, in the first scan and in others."""


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Targets after the maps at ``time_ns`` (None: before any), and the evidence (J,) of places."""

    targets: Targets
    evidence: Array
    free: int
    time_ns: int | None
    turn: int


def init(layout: Layout) -> State:
    """Nothing is known."""
    return State(Targets.none(), np.zeros(len(layout.places)), 0, None, 0)


def step(
    state: State, scans: Sequence[Scan], layout: Layout, setup: Recording, params: Params
) -> State:
    """The state after the maps of one time.

    Raises
    ------
    InputError : a map that does not have the shape of its axes
    """
    time_ns = scans[0].time_ns
    dt = 0.0 if state.time_ns is None else (time_ns - state.time_ns) / 1e9
    targets = predict(state.targets, params, dt)
    view = View.of(layout, scans, setup).shown(targets.kind, targets.vectors)
    mean = view.mean(targets.kind, targets.vectors)
    targets, mean = update(targets, view, mean, params)
    exists = targets.exists - OVERLAP * overlapping(targets, params)
    targets = replace(targets, exists=exists)
    gone = np.flatnonzero(exists < -params.birth_price)
    if len(gone):
        targets, mean = without(targets, view, mean, gone)
    targets = doubted(targets, view, mean, params)
    evidence = MEMORY * state.evidence + (1 - MEMORY) * view.gains(mean, params.shape)
    most = FIRST if state.time_ns is None else LATER
    if state.time_ns is None:
        evidence /= 1 - MEMORY
    targets, free = born(targets, view, mean, evidence, state.free, most, params)
    for label in targets.label[due(targets, params)].tolist():
        about = np.flatnonzero(targets.label == label)
        if len(about):
            targets, mean, free = rethought(targets, view, mean, int(about[0]), free, params)
    return State(targets, evidence, free, time_ns, state.turn + 1)


def doubted(targets: Targets, view: View, mean: Array, params: Params) -> Targets:
    """The targets, those that are young or unsure beside others less sure if these do without."""
    crowded, young = _crowded(targets), targets.age <= YOUNG
    exists = targets.exists.copy()
    for i in np.flatnonzero(crowded & (young | (targets.exists < SURE))):
        gain = needed(targets, view, mean, int(i), params) - params.live_price
        exists[i] = min(exists[i] + min(np.clip(gain, -GAIN, GAIN), 0.0), SURE)
    return replace(targets, exists=exists)


def _crowded(targets: Targets) -> Array:
    """Which targets (n,) have another near them."""
    x, y = targets.m[:, :2].T
    d = np.hypot(x[:, None] - x, y[:, None] - y)
    return np.asarray(np.count_nonzero(d < CROWD, axis=0) > 1)


def due(targets: Targets, params: Params) -> Array:
    """Which targets (n,) are explained anew: after some scans, and new ones beside others."""
    crowded = _crowded(targets)
    often = (targets.age + targets.label) % params.rethink == 0
    return np.asarray((np.isin(targets.age, SOON) & crowded) | (often & (targets.age > 1)))


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """Yield the targets after each time, smoothed or not.

    Raises
    ------
    InputError : fewer streams of maps than are asked for, a stream that does not state its waveform
    EstimatorError : a state that is not finite
    """
    return smoothed(_forward(setup, scans, params), _backward(params), params.wait)


def _forward(
    setup: Recording, scans: Iterable[Scan], params: Params
) -> Iterator[tuple[Estimates, Trail]]:
    """The filter's estimates, and all targets that it follows."""
    choice = Choice.of(setup, params)
    layout = Layout.of(setup, choice.used, params)
    state = init(layout)
    maps = (s for s in choice.scans(scans, params.fuse_within) if s.stream in choice.used)
    for time_ns, together in groupby(maps, key=lambda scan: scan.time_ns):
        state = step(state, list(together), layout, setup, params)
        trail = Trail(time_ns, state.targets)
        objects = _objects(trail, params)
        yield Estimates(replace(setup.meta), objects, _numbers(state.targets)), trail


def _backward(params: Params) -> Callable[[Trail | None, Trail], tuple[Trail, Objects]]:
    """The way back from time to time."""

    def step(later: Trail | None, now: Trail) -> tuple[Trail, Objects]:
        trail = back(later, now, params)
        return trail, _objects(trail, params)

    return step


def _objects(trail: Trail, params: Params) -> Objects:
    """The targets of one time whose existence is probable enough."""
    t = trail.targets
    if not np.isfinite(t.m).all():
        raise EstimatorError("the state of a target is not finite")
    p = 1 / (1 + np.exp(-t.exists))
    shown = np.flatnonzero(p > params.extract_existence)
    t, n = t.take(shown), len(shown)
    P = t.P[:, :4, :4].copy()
    P[:, [0, 1], [0, 1]] += (params.std_body**2 * (t.kind == VEHICLE))[:, None]
    vehicle = 1 / (1 + np.exp(-t.vehicle))
    probability = np.stack((1 - vehicle, vehicle), 1)
    return Objects(
        np.array([trail.time_ns], np.int64),
        np.array([0, n], np.int64),
        t.label,
        NAMES,
        UNITS,
        t.m[:, :4],
        covariance=P,
        existence=p[shown],
        class_names=CLASSES,
        class_index=probability.argmax(1),
        class_probability=probability,
    )


def _numbers(targets: Targets) -> dict[str, Array]:
    """What is stated per step."""
    p = 1 / (1 + np.exp(-targets.exists))
    return {
        "cardinality_mean": np.array([p.sum()]),
        "cardinality_variance": np.array([(p * (1 - p)).sum()]),
    }

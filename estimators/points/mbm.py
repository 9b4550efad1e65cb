"""Multi-Bernoulli mixture filter, with a Poisson part for undetected targets where wanted.

A. F. Garcia-Fernandez, J. L. Williams, K. Granstrom and L. Svensson, "Poisson multi-Bernoulli
mixture filter: direct derivation and implementation", IEEE Trans. Aerosp. Electron. Syst. 54 (2018)
1883-1901; without the Poisson part, A. F. Garcia-Fernandez et al., "Gaussian implementation of the
multi-Bernoulli mixture filter", FUSION 2019. Each scan's best global hypotheses come from Murty's
algorithm over all hypotheses at once. Whether a target can be seen at all is a Markov chain of two
states, D. Musicki and R. Evans, "Joint integrated probabilistic data association: JIPDA", IEEE
Trans. Aerosp. Electron. Syst. 40 (2004) 1093-1099.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import inf

import numpy as np

from ...models.errors import InputError
from ...models.geometry.regions import mass
from ...models.records import Array, Estimates, Objects, Recording, Scan
from ..kernels.passes import SEARCH, smoothed
from . import trails
from .backlog import Backlog
from .context import Context
from .cuts import WHAT
from .kernels.bernoulli import Bernoullis, Mixture, cardinality
from .kernels.gaussians import falling
from .kernels.paths import Paths, back
from .kernels.smoothing import Epoch, ended, smooth
from .mbm_filter import Params, State, first_detections, init, predict, reduce, update
from .model.measurement import innovations, log_likelihood, positions
from .model.sensing import UNKNOWN, Look, SensorParams, at_once, spread
from .model.targets import NAMES, UNITS, born
from .modes import initial
from .search import Sighting, searched
from .times import observe, remember, through
from .trails import Trail


def followed(mixture: Mixture, params: Params) -> tuple[Array, Array]:
    """Labels (n,) and means (n, 4) of the targets that are extracted, travelled or not."""
    tracks, index = extract(mixture, params)
    if params.extraction == "existence":
        sure = mixture.local.r[index] >= params.extract_existence
        tracks, index = tracks[sure], index[sure]
    return mixture.label[tracks], mixture.local.m[index]


def extract(mixture: Mixture, params: Params) -> tuple[Array, Array]:
    """Tracks (n,) of a global hypothesis, and which Bernoulli (n,) each has there.

    By existence all tracks of the best hypothesis, for :func:`_objects` to choose from.
    """
    if params.extraction == "existence":
        picked = mixture.table[0]
        tracks = np.flatnonzero(picked >= 0)
        return tracks, picked[tracks]
    joint = mixture.w * cardinality(mixture)
    n = joint.sum(axis=0).argmax()
    g = joint[:, n].argmax()
    tracks = np.sort(np.argsort(-mixture.existence()[g], kind="stable")[:n])
    return tracks, mixture.table[g, tracks]


def step(
    state: State,
    scans: Iterable[Scan],
    context: Context[Params],
    sights: list[Sighting] | None = None,
) -> tuple[State, Epoch]:
    """The state after the ``scans`` of one time, taken one after the other, and how it came there.

    A source follows the targets that were extracted before. What the looks show as first
    detections goes to ``sights``.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    EstimatorError : no hypothesis is possible
    """
    params, together = context.params, at_once(scans)
    label, m = followed(state.mixture, params)
    state, gone = predict(state, params, together[0].time_ns)
    moment = observe(context, together, state.memory, label, (m @ gone.F.T)[:, :2])
    used: list[Look] = []
    novelty: list[Array] = []
    cut = {"max_detections": 0.0}
    for seen, own in moment.looks:
        if len(seen.z) > params.max_detections:
            cut["max_detections"] += len(seen.z) - params.max_detections
            seen = _likeliest(seen, state.mixture.local, own, params)
        even = _even(seen, [look for look, _ in moment.looks], state.backlog, params)
        if sights is not None:
            first = first_detections(state.undetected, seen, params, own, even)[1]
            sights.append(Sighting(seen, own, *first))
        state, new = update(state, seen, params, own, even)
        state = reduce(state, params, max(len(seen.z), state.memory.crowd))
        state = replace(state, backlog=state.backlog.missed(seen))
        used.append(seen)
        novelty.append(new)
    if not params.poisson:
        waiting, cut["max_births"] = born(params, used, novelty, gone)
        state = replace(state, waiting=waiting)
    label, m = followed(state.mixture, params)
    x, n = state.mixture, max(len(seen.z) for seen in used)
    memory = remember(state.memory, moment, n, label, m[:, :2], x.label)
    state = replace(state, memory=memory, cut={**state.cut, **cut})
    survive = params.p_survive**gone.steps
    return state, Epoch(together[0].time_ns, x, gone.F, gone.Q, survive, state.way)


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """Yield the targets at each time, ``lag`` seconds late.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    EstimatorError : no hypothesis is possible
    """
    return run(Context.of(setup, params), scans, rng)


def run(
    context: Context[Params], scans: Iterable[Scan], rng: np.random.Generator | None = None
) -> Iterator[Estimates]:
    """:func:`estimate` in a context of the caller's; a search alone draws from ``rng``."""
    wait = context.params.wait
    if context.params.smooth == SEARCH:
        assert rng is not None
        return _searched(context, scans, rng)
    if wait == inf:
        return _whole(context, scans)
    return _lagging(context, scans, context.params.lag if wait is None else wait)


def _whole(context: Context[Params], scans: Iterable[Scan]) -> Iterator[Estimates]:
    """All times at the end, by the trajectories of the hypothesis that is best then.

    How far a target has travelled is known of its whole trajectory, before any of it is shown.
    """
    params, meta = context.params, context.setup.meta
    travelled = Travelled(params.min_travel)
    classes: dict[int, Array] = {}

    def forward() -> Iterator[tuple[Estimates, Epoch]]:
        for state, epoch in through(context, scans, init(params.width, initial(params)), step):
            classes.update(state.memory.classes)
            x, none = state.mixture, np.zeros(0, np.int64)
            nobody = _listed(epoch.time_ns, none, x.local.r[none], x.local.m[none], x.local.P[none])
            yield Estimates(meta, nobody, _counted(state, context)), epoch

    def backward(later: Paths | None, epoch: Epoch) -> tuple[Paths, Objects]:
        x = back(later, epoch, params.retrodict, params.max_coast or inf)
        shown = x.r >= params.extract_smoothed
        # What is straight on before the first detection, or without any, is no way that was seen.
        seen = shown & x.hit
        travelled.see(x.label[seen], x.m[seen, :2])
        found = _listed(epoch.time_ns, x.label[shown], x.r[shown], x.m[shown], x.P[shown])
        return x, context.source.named(found, classes)

    yield from map(travelled.only, smoothed(forward(), backward, inf))


def _searched(
    context: Context[Params], scans: Iterable[Scan], rng: np.random.Generator
) -> Iterator[Estimates]:
    """All times at the end, by the likeliest trajectories that a search finds."""
    params, meta = context.params, context.setup.meta
    travelled = Travelled(params.min_travel)
    classes: dict[int, Array] = {}
    sights: list[Sighting] = []

    def filtered() -> Iterator[tuple[dict[str, Array], Epoch, tuple[Sighting, ...]]]:
        known = partial(step, sights=sights)
        for state, epoch in through(context, scans, init(params.width, initial(params)), known):
            classes.update(state.memory.classes)
            yield _counted(state, context), epoch, tuple(sights)
            sights.clear()

    def forward() -> Iterator[tuple[Estimates, tuple[Trail, Array]]]:
        for numbers, (x, hit) in searched(params, filtered(), rng):
            none = np.zeros(0, np.int64)
            nobody = _listed(x.time_ns, none, x.r[none], x.m[none], x.P[none])
            yield Estimates(meta, nobody, numbers), (x, hit)

    def backward(later: Trail | None, now: tuple[Trail, Array]) -> tuple[Trail, Objects]:
        x = trails.back(later, now[0])
        shown = x.r >= params.extract_smoothed
        seen = shown & np.isin(x.label, now[1])
        travelled.see(x.label[seen], x.m[seen, :2])
        found = _listed(x.time_ns, x.label[shown], x.r[shown], x.m[shown], x.P[shown])
        return x, context.source.named(found, classes)

    yield from map(travelled.only, smoothed(forward(), backward, inf))


class Travelled:
    """How far targets have been from where they end, on a way back: ``least`` [m] counts."""

    def __init__(self, least: float) -> None:
        self._least = least
        self._end: dict[int, Array] = {}
        self._farthest: dict[int, float] = {}

    def see(self, label: Array, where: Array) -> None:
        """Targets with ``label`` (n,) are at ``where`` (n, 2)."""
        for own, here in zip(label.tolist(), where, strict=True) if self._least else ():
            way = float(np.hypot(*(here - self._end.setdefault(own, here))))
            self._farthest[own] = max(way, self._farthest.get(own, 0.0))

    def only(self, estimates: Estimates) -> Estimates:
        """The estimates, of targets that have been far enough."""
        if not self._least:
            return estimates
        x = estimates.objects
        way = np.array([self._farthest.get(label, 0.0) for label in x.label.tolist()])
        rows = np.flatnonzero(way >= self._least)
        return replace(estimates, objects=x.take(rows, x.time_ns, np.array([len(rows)])))


def _lagging(context: Context[Params], scans: Iterable[Scan], lag: float) -> Iterator[Estimates]:
    """Each time ``lag`` seconds late."""
    params = context.params
    moved: set[int] = set()
    epochs: deque[Epoch] = deque()
    numbers: deque[dict[str, Array]] = deque()

    def leave() -> Estimates:
        objects = _objects(state.mixture, list(epochs), moved, params)
        epochs.popleft()
        objects = context.source.named(objects, state.memory.classes)
        return Estimates(context.setup.meta, objects, numbers.popleft())

    for state, epoch in through(context, scans, init(params.width, initial(params)), step):
        epochs.append(epoch)
        moved = _moved(state.mixture, moved, params, epochs)
        numbers.append(_counted(state, context))
        while epochs and epoch.time_ns - epochs[0].time_ns >= 1e9 * lag:
            yield leave()
    while epochs:
        yield leave()


def _counted(state: State, context: Context[Params]) -> dict[str, Array]:
    """What is stated per step."""
    lost = sum(v for name, v in state.cut.items() if name not in WHAT)
    return _numbers(state.mixture, lost) | regional(state.mixture, context.regions)


def _likeliest(seen: Look, a: Bernoullis, own: SensorParams, params: Params) -> Look:
    """The ``max_detections`` detections that are nearest to a known target."""
    z_hat, _, S = innovations(seen, a.m, a.P, own.unscented)
    log_l = log_likelihood(seen, z_hat, S, np.inf)
    likely = np.maximum(log_l.max(axis=0, initial=-np.inf), -1e300)
    best = np.sort(falling(likely, seen.z)[: params.max_detections])
    return seen.take(best)


def _even(seen: Look, looks: Sequence[Look], backlog: Backlog, params: Params) -> Array:
    """Density (n,) of targets, spread like the clutter, that no look has detected yet.

    All ``looks`` of the time share them: where their fields lie apart they are spread over all.

    Raises
    ------
    InputError : it is not known where the clutter lies
    """
    if not params.poisson or params.birth != "detections" or not params.birth_rate:
        return np.zeros(len(seen.z))
    if np.isnan(seen.spatial).any():
        raise InputError(UNKNOWN)
    where = positions(seen)[0]
    density = params.birth_rate * backlog.at(where) * seen.spatial
    if len(looks) > 1:
        own, all_ = spread(seen, where), np.mean([spread(look, where) for look in looks], axis=0)
        density = density * np.where(own > 0, all_ / np.where(own > 0, own, 1.0), 1.0)
    return density


def regional(mixture: Mixture, regions: Mapping[str, Array]) -> dict[str, Array]:
    """Mean and variance of the number of detected targets in each region, (1,) each.

    Those of every hypothesis, and that of their means; E. Delande, J. Houssineau and D. E. Clark,
    "Regional variance in target number: analysis and application for multi-Bernoulli point
    processes", Data Fusion & Target Tracking 2014.
    """
    a, found = mixture.local, {}
    for name, corners in regions.items():
        r = np.append(a.r * mass(a.m[:, :2], a.P[:, :2, :2], corners), 0.0)[mixture.table]
        total, variance = _moments(mixture, r)
        found[f"region_mean_{name}"] = np.array([total])
        found[f"region_variance_{name}"] = np.array([variance])
    return found


def _moments(mixture: Mixture, p: Array) -> tuple[float, float]:
    """Mean and variance of how many tracks fulfil what each does with probability p (G, T)."""
    mean = mixture.by_group(p)
    total = (mixture.w * mean).sum(0)
    spread = mixture.by_group(p * (1 - p)) + (mean - total) ** 2
    return float(total.sum()), float((mixture.w * spread).sum())


def _numbers(mixture: Mixture, cut: float = 0.0) -> dict[str, Array]:
    """Mean and variance of the number of detected targets, and the size of the mixture.

    Of the targets ``cut`` off by limits no more is known than how many to expect.
    """
    total, variance = _moments(mixture, mixture.existence())
    values = {"cardinality_mean": total + cut, "cardinality_variance": variance + cut, "cut": cut}
    most, groups = mixture.w.shape
    sizes = {"hypotheses": most, "groups": groups, "tracks": len(mixture.label)}
    return {key: np.array([value]) for key, value in (values | sizes).items()}


def _moved(
    mixture: Mixture, moved: set[int], params: Params, epochs: Iterable[Epoch] = ()
) -> set[int]:
    """Labels of the tracks that have travelled far enough from their first detection, ever."""
    tracks, index = extract(mixture, params)
    way = mixture.local.m[index] - mixture.start[tracks]
    way = np.where(np.isnan(way), 0.0, way)
    # What is straight on without a detection is no way that was seen.
    way[mixture.local.unseen[index] > 0] = 0.0
    far = np.hypot(way[:, 0], way[:, 1]) >= params.min_travel
    living = {label for epoch in epochs for label in epoch.mixture.label.tolist()}
    living |= set(mixture.label.tolist())
    return moved & living | set(mixture.label[tracks[far]].tolist())


def _objects(mixture: Mixture, epochs: list[Epoch], moved: set[int], params: Params) -> Objects:
    """The targets at the first of ``epochs``, as they look after the last of their own."""
    tracks, index = extract(mixture, params)
    found = [(mixture.label[tracks], *smooth(epochs, index))]
    for k, those in ended(epochs, mixture.label).items():
        gone, last = np.array(those).T
        found.append((gone, *smooth(epochs[: k + 1], last)))
    label, age, r, m, P = (np.concatenate(columns) for columns in zip(*found, strict=True))
    shown = np.isin(label, list(moved)) & (age >= -params.retrodict)
    if params.extraction == "existence":
        shown &= r >= params.extract_existence
    return _listed(epochs[0].time_ns, label[shown], r[shown], m[shown], P[shown])


def _listed(time_ns: int, label: Array, r: Array, m: Array, P: Array) -> Objects:
    """Objects of one time."""
    offset = np.array([0, len(label)], np.int64)
    return Objects(
        np.array([time_ns], np.int64),
        offset,
        label,
        NAMES[: m.shape[1]],
        UNITS[: m.shape[1]],
        m,
        covariance=P,
        existence=r,
    )

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

import logging
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from ...models.errors import InputError
from ...models.records import Array, Estimates, Objects, Recording, Scan
from .clutter_map import learnt, persistent
from .kernels.bernoulli import Bernoullis, Mixture, cardinality
from .kernels.compiled import gaussians
from .kernels.smoothing import Epoch, smooth
from .mbm_filter import Params, State, init, predict, reduce, update
from .sensing import Look, expected, looks, per_stream
from .source import MADE, Nothing, Source, recognised

NAMES, UNITS = ("x", "y", "vx", "vy"), ("m", "m", "m s-1", "m s-1")
_log = logging.getLogger(__name__)


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
    joint = mixture.w[:, None] * cardinality(mixture)
    n = joint.sum(axis=0).argmax()
    g = joint[:, n].argmax()
    tracks = np.sort(np.argsort(-mixture.existence()[g], kind="stable")[:n])
    return tracks, mixture.table[g, tracks]


@dataclass(frozen=True, slots=True, eq=False)
class Context:
    """What stays: the recording's setup and the parameters, in all and by stream.

    ``spread`` are those by stream with undetected targets among the clutter, where they are;
    ``source`` makes detections of scans that hold none.
    """

    setup: Recording
    params: Params
    sensing: Mapping[str, Params]
    spread: Mapping[str, Params]
    source: Source

    @staticmethod
    def of(setup: Recording, params: Params, source: Source | None = None) -> Context:
        """The context of a recording."""
        sensing = per_stream(params, setup) | {MADE: params}
        more = params.birth_rate if params.poisson and params.birth == "detections" else 0.0
        spread = {n: replace(p, clutter_rate=p.clutter_rate + more) for n, p in sensing.items()}
        return Context(setup, params, sensing, spread, source or Nothing())


def step(state: State, scans: Iterable[Scan], context: Context) -> tuple[State, Epoch]:
    """The state after the ``scans`` of one time, taken one after the other, and how it came there.

    A source follows the targets that were extracted before.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    EstimatorError : no hypothesis is possible
    """
    together = list(scans)
    time_ns = together[0].time_ns
    names = [scan.stream for scan in together]
    if len(set(names)) < len(names):
        raise InputError(f"scans at {time_ns} ns: two of one stream")
    label, m = followed(state.mixture, context.params)
    state, count, F, Q = predict(state, context.params, time_ns)
    source = context.source
    sight = source.see(together, label, (m @ F.T)[:, :2], state.classes)
    for scan, all_ in looks(together, sight, context.setup, context.spread, source.region):
        params, spread, seen = context.sensing[scan.stream], context.spread[scan.stream], all_
        if len(seen.z) > params.max_detections:
            _log.warning("scan of %s at %d ns: %d detections", scan.stream, time_ns, len(seen.z))
            seen = _likeliest(seen, state.mixture.local, params)
        known = params.clutter_rate / (spread.clutter_rate or 1.0)
        even = (1 - known) * count * seen.clutter
        clutter = known * seen.clutter + persistent(state.maps, scan.stream, seen, params)
        state = update(state, replace(seen, clutter=clutter), params, even)
        maps = learnt(state.maps, scan, all_, params)
        state = replace(reduce(state, params), maps=maps)
    label, m = followed(state.mixture, context.params)
    alive = state.mixture.label
    classes = recognised(sight, label, m[:, :2], alive, state.classes)
    state = replace(state, classes=classes)
    return state, Epoch(time_ns, state.mixture.local, F, Q)


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """Yield the targets at each time, ``lag`` seconds late.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    EstimatorError : no hypothesis is possible
    """
    return run(Context.of(setup, params), scans)


def run(context: Context, scans: Iterable[Scan]) -> Iterator[Estimates]:
    """:func:`estimate` in a context of the caller's."""
    params, state = context.params, init()
    moved: set[int] = set()
    epochs: deque[Epoch] = deque()
    numbers: deque[dict[str, Array]] = deque()

    def leave() -> Estimates:
        objects = _objects(state.mixture, list(epochs), moved, params)
        epochs.popleft()
        objects = context.source.named(objects, state.classes)
        return Estimates(context.setup.meta, objects, numbers.popleft())

    for _, together in groupby(context.source.used(scans), key=lambda scan: scan.time_ns):
        state, epoch = step(state, together, context)
        moved = _moved(state.mixture, moved, params)
        epochs.append(epoch)
        numbers.append(_numbers(state.mixture))
        while epochs and epoch.time_ns - epochs[0].time_ns >= 1e9 * params.lag:
            yield leave()
    while epochs:
        yield leave()


def _likeliest(seen: Look, a: Bernoullis, params: Params) -> Look:
    """The ``max_detections`` detections that are nearest to a known target."""
    z_hat, _, S = expected(seen, a.m, a.P, params.unscented)
    log_l = gaussians.log_likelihood(seen.z, z_hat, S[:, None] + seen.R, seen.period, np.inf)
    best = np.argsort(-log_l.max(axis=0, initial=-np.inf), kind="stable")[: params.max_detections]
    best.sort()
    R = seen.R if len(seen.R) == 1 else seen.R[best]
    return replace(seen, z=seen.z[best], R=R, clutter=seen.clutter[best])


def _numbers(mixture: Mixture) -> dict[str, Array]:
    """Mean and variance of the number of detected targets, and the size of the mixture."""
    r = mixture.existence()
    mean = r.sum(axis=1)
    total = mixture.w @ mean
    variance = mixture.w @ ((r * (1 - r)).sum(axis=1) + (mean - total) ** 2)
    values = {"cardinality_mean": total, "cardinality_variance": variance}
    sizes = {"hypotheses": len(mixture.w), "tracks": len(mixture.label)}
    return {key: np.array([value]) for key, value in (values | sizes).items()}


def _moved(mixture: Mixture, moved: set[int], params: Params) -> set[int]:
    """Labels of the tracks that have travelled far enough in the best hypothesis, once or now."""
    tracks = np.flatnonzero(mixture.table[0] >= 0)
    way = mixture.local.m[mixture.table[0, tracks]] - mixture.start[tracks]
    far = np.hypot(way[:, 0], way[:, 1]) >= params.min_travel
    return moved & set(mixture.label.tolist()) | set(mixture.label[tracks[far]].tolist())


def _objects(mixture: Mixture, epochs: list[Epoch], moved: set[int], params: Params) -> Objects:
    """The targets at the first of ``epochs``, as they look after the last."""
    tracks, index = extract(mixture, params)
    age, r, m, P = smooth(epochs, index)
    label = mixture.label[tracks]
    shown = np.isin(label, list(moved)) & (age >= -params.retrodict)
    if params.extraction == "existence":
        shown &= r >= params.extract_existence
    return Objects(
        np.array([epochs[0].time_ns], np.int64),
        np.array([0, shown.sum()], np.int64),
        label[shown],
        NAMES,
        UNITS,
        m[shown],
        covariance=P[shown],
        existence=r[shown],
    )

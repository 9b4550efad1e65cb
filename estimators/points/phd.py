"""Gaussian-mixture probability hypothesis density filter, with statistics of regions.

B.-N. Vo and W.-K. Ma, "The Gaussian mixture probability hypothesis density filter", IEEE Trans.
Signal Process. 54 (2006) 4091-4104: the intensity of targets is a mixture of components; each is
predicted, updated by being missed and by every detection, and the sum is pruned, merged and capped.
A component keeps the label of the birth that it goes back to. Smoothed by :mod:`.strands`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from ...models.errors import EstimatorError
from ...models.geometry.regions import mass, statistics
from ...models.records import Array, Estimates, Objects, Recording, Scan
from ..kernels.passes import smoothed
from .context import Context
from .kernels.gaussians import strongest
from .model.sensing import at_once
from .model.targets import NAMES, UNITS, born
from .modes import initial
from .phd_filter import Params, State, extract, init, predict, reduce
from .phd_update import Posterior, update
from .strands import Strands, back
from .times import observe, remember, through


def step(
    state: State, scans: Iterable[Scan], context: Context[Params]
) -> tuple[State, tuple[Estimates, Strands]]:
    """The state after the ``scans`` of one time, in any order, what it says, and how it came there.

    A source follows the targets that were extracted before.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    EstimatorError : the weights are not finite
    """
    params, together, source = context.params, at_once(scans), context.source
    followed, _ = extract(state.mixture, params)
    x = state.mixture.take(followed)
    state, is_new, gone = predict(state, params, together[0].time_ns)
    where = (x.m @ gone.F.T)[:, :2]
    moment = observe(context, together, state.memory, x.label, where)
    seen = [look for look, _ in moment.looks]
    n = sum(len(look.z) for look in seen)
    posterior = update(state.mixture, moment.looks, params, is_new)
    numbers = _numbers(posterior, context.regions)
    mixture, lost = reduce(posterior.going_on, params, max(n, state.memory.crowd))
    waiting, unborn = born(params, seen, posterior.novelty, gone)
    cut = {"max_components": lost, "max_births": unborn}
    if params.keep:
        kept, cut["keep_components"] = _kept(posterior, params.keep_components)
        numbers |= kept
    state, objects = _objects(replace(state, mixture=mixture, waiting=waiting, cut=cut), params)
    alive, where = state.mixture.label, objects.state[:, :2]
    memory = remember(state.memory, moment, n, objects.label, where, alive)
    numbers["components"] = np.array([len(mixture.w)])
    numbers["cut"] = np.array([lost + unborn])
    objects = source.named(objects, memory.classes)
    x, survive = state.mixture, params.p_survive**gone.steps
    strands = Strands(
        together[0].time_ns, x.label, x.origin, x.w, x.m, x.P, gone.F, gone.Q, survive,
        memory.classes, way=state.way,
    )  # fmt: skip
    found = Estimates(context.setup.meta, objects, numbers)
    return replace(state, memory=memory), (found, strands)


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """Yield the targets at each time, and their expected number in all and in the regions.

    Smoothed, these are of the targets that the filter has ever known.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    EstimatorError : the weights are not finite
    """
    return run(Context.of(setup, params), scans)


def run(context: Context[Params], scans: Iterable[Scan]) -> Iterator[Estimates]:
    """:func:`estimate` in a context of the caller's."""
    start = init(context.params.width, initial(context.params))
    forward = (found for _, found in through(context, scans, start, step))
    found = smoothed(forward, _backward(context), context.params.wait)
    return found if context.params.wait is None else (_shown(x, context) for x in found)


def _backward(
    context: Context[Params],
) -> Callable[[Strands | None, Strands], tuple[Strands, Objects]]:
    """The way back from time to time, with all that may exist."""

    def step(later: Strands | None, now: Strands) -> tuple[Strands, Objects]:
        x = back(later, now)
        found = _listed(x.time_ns, x.label, x.m, x.P, x.r)
        return x, context.source.named(found, x.classes)

    return step


def _shown(found: Estimates, context: Context[Params]) -> Estimates:
    """Of all lines of a time those that exist, and the numbers of all."""
    x = found.objects
    r = x.existence
    assert r is not None and x.covariance is not None
    numbers = {"cardinality_mean": r.sum(), "cardinality_variance": (r * (1 - r)).sum()}
    for name, corners in context.regions.items():
        inside = r * mass(x.state[:, :2], x.covariance[:, :2, :2], corners)
        numbers[f"region_mean_{name}"] = inside.sum()
        numbers[f"region_variance_{name}"] = (inside * (1 - inside)).sum()
    steps = {**found.steps, **{name: np.array([value]) for name, value in numbers.items()}}
    rows = np.flatnonzero(r >= context.params.extract_smoothed)
    return replace(found, objects=x.take(rows, x.time_ns, np.array([len(rows)])), steps=steps)


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
    assert state.time_ns is not None
    objects = _listed(state.time_ns, shown, x.m[row], x.P[row], np.minimum(x.w[row], 1.0))
    return replace(
        state, mixture=replace(x, label=label), next_label=free + int(copy.sum())
    ), objects


def _listed(time_ns: int, label: Array, m: Array, P: Array, r: Array) -> Objects:
    """Objects of one time."""
    offset, width = np.array([0, len(label)], np.int64), m.shape[1]
    return Objects(
        np.array([time_ns], np.int64),
        offset,
        label,
        NAMES[:width],
        UNITS[:width],
        m,
        covariance=P,
        existence=r,
    )

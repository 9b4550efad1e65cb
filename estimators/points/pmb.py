"""Track-oriented Poisson multi-Bernoulli filter with marginal associations by belief propagation.

J. L. Williams, "Marginal multi-Bernoulli filters: RFS derivation of MHT, JIPDA and
association-based MeMBer", IEEE Trans. Aerosp. Electron. Syst. 51 (2015) 1664-1687, algorithm TOMB/P
(fig. 6); F. Meyer et al., "Message passing algorithms for scalable multitarget tracking", Proc.
IEEE 106 (2018) 221-259. Targets not detected yet are a Poisson process, all others Bernoullis; of a
scan's associations only the marginals are kept, so that cost is linear in what is near each other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from ...models.geometry.regions import mass
from ...models.records import Array, Estimates, Objects, Recording, Scan
from ..kernels.passes import smoothed
from .context import Context
from .model.sensing import at_once
from .model.targets import NAMES, UNITS, Interval
from .pmb_filter import Params, State, Tracks, init, predict, reduce, update
from .times import observe, remember, through
from .trails import Trail, back


def shown(tracks: Tracks, least: float) -> Tracks:
    """Those that exist with ``least``."""
    return tracks.take(np.flatnonzero(tracks.r >= least))


def step(state: State, scans: Iterable[Scan], context: Context[Params]) -> tuple[State, Interval]:
    """The state after the ``scans`` of one time, taken one after the other, and the time before.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    """
    params, together = context.params, at_once(scans)
    before = shown(state.tracks, params.extract_existence)
    state, gone = predict(state, params, together[0].time_ns)
    where = (before.m @ gone.F.T)[:, :2]
    moment = observe(context, together, state.memory, before.label, where)
    n = max(len(seen.z) for seen, _ in moment.looks)
    for seen, own in moment.looks:
        state = update(state, seen, params, own)
        state = reduce(state, params, max(n, state.memory.crowd))
    after = shown(state.tracks, params.extract_existence)
    where, alive = after.m[:, :2], state.tracks.label
    memory = remember(state.memory, moment, n, after.label, where, alive)
    return replace(state, memory=memory), gone


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """:func:`run` on a recording whose scans hold all detections."""
    return run(Context.of(setup, params), scans)


def run(context: Context[Params], scans: Iterable[Scan]) -> Iterator[Estimates]:
    """Yield the targets at each time, smoothed or not, and how many are known in all and regions.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    """
    return smoothed(forward(context, scans), backward(context), context.params.wait)


def forward(context: Context[Params], scans: Iterable[Scan]) -> Iterator[tuple[Estimates, Trail]]:
    """The filter's estimates, and all that it knows of each time."""
    params = context.params
    for state, gone in through(context, scans, init(params), step):
        a, time_ns, classes = state.tracks, state.time_ns, state.memory.classes
        assert time_ns is not None
        found = context.source.named(objects(time_ns, shown(a, params.extract_existence)), classes)
        said = numbers(a, context.regions) | {"evidence": np.array([state.evidence])}
        estimates = Estimates(context.setup.meta, found, said)
        yield (
            estimates,
            Trail(
                time_ns,
                a.label,
                a.r,
                a.m,
                a.P,
                gone.F,
                gone.Q,
                params.p_survive**gone.steps,
                classes,
                state.way,
            ),
        )


def backward(context: Context[Params]) -> Callable[[Trail | None, Trail], tuple[Trail, Objects]]:
    """The way back from time to time."""

    def step(later: Trail | None, now: Trail) -> tuple[Trail, Objects]:
        x = back(later, now)
        tracks = Tracks(x.label, x.r, x.m, x.P)
        found = objects(x.time_ns, shown(tracks, context.params.extract_smoothed))
        return x, context.source.named(found, x.classes)

    return step


def objects(time_ns: int, tracks: Tracks) -> Objects:
    """The tracks as objects of one time."""
    return Objects(
        np.array([time_ns], np.int64),
        np.array([0, len(tracks)], np.int64),
        tracks.label,
        NAMES[: tracks.m.shape[1]],
        UNITS[: tracks.m.shape[1]],
        tracks.m,
        covariance=tracks.P,
        existence=tracks.r,
    )


def numbers(tracks: Tracks, regions: Mapping[str, Array]) -> dict[str, Array]:
    """Mean and variance of the number of detected targets, in all and in each region, (1,) each."""
    r = tracks.r
    found = {"cardinality_mean": r.sum(), "cardinality_variance": (r * (1 - r)).sum()}
    for name, corners in regions.items():
        inside = r * mass(tracks.m[:, :2], tracks.P[:, :2, :2], corners)
        found[f"region_mean_{name}"] = inside.sum()
        found[f"region_variance_{name}"] = (inside * (1 - inside)).sum()
    return {name: np.array([value]) for name, value in (found | {"tracks": len(r)}).items()}

"""Track-oriented Poisson multi-Bernoulli filter with marginal associations by belief propagation.

J. L. Williams, "Marginal multi-Bernoulli filters: RFS derivation of MHT, JIPDA and
association-based MeMBer", IEEE Trans. Aerosp. Electron. Syst. 51 (2015) 1664-1687, algorithm TOMB/P
(fig. 6); F. Meyer et al., "Message passing algorithms for scalable multitarget tracking", Proc.
IEEE 106 (2018) 221-259. Targets not detected yet are a Poisson process, all others Bernoullis; of a
scan's associations only the marginals are kept, so that cost is linear in what is near each other.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace

import numpy as np

from ...models.records import Array, Estimates, Objects, Recording, Scan
from ...models.regions import mass
from .context import Context
from .pmb_filter import Params, State, Tracks, init, predict, update
from .sensing import at_once
from .targets import NAMES, UNITS, Interval
from .times import observe, remember, through


def shown(tracks: Tracks, params: Params) -> Tracks:
    """Those that exist with ``extract_existence``."""
    return tracks.take(np.flatnonzero(tracks.r >= params.extract_existence))


def step(state: State, scans: Iterable[Scan], context: Context[Params]) -> tuple[State, Interval]:
    """The state after the ``scans`` of one time, taken one after the other, and the time before.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    """
    params, together = context.params, at_once(scans)
    before = shown(state.tracks, params)
    state, gone = predict(state, params, together[0].time_ns)
    where = (before.m @ gone.F.T)[:, :2]
    moment = observe(context, together, state.memory, before.label, where)
    for seen, own in moment.looks:
        state = update(state, seen, params, own)
    after = shown(state.tracks, params)
    where, alive = after.m[:, :2], state.tracks.label
    memory = remember(state.memory, moment, 0, after.label, where, alive)
    return replace(state, memory=memory), gone


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """:func:`run` on a recording whose scans hold all detections."""
    return run(Context.of(setup, params), scans)


def run(context: Context[Params], scans: Iterable[Scan]) -> Iterator[Estimates]:
    """Yield the targets after each time, and how many there are in all and in the regions.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    """
    params = context.params
    for state, _ in through(context, scans, init(params), step):
        assert state.time_ns is not None
        found = objects(state.time_ns, shown(state.tracks, params))
        found = context.source.named(found, state.memory.classes)
        yield Estimates(context.setup.meta, found, numbers(state.tracks, context.regions))


def objects(time_ns: int, tracks: Tracks) -> Objects:
    """The tracks as objects of one time."""
    return Objects(
        np.array([time_ns], np.int64),
        np.array([0, len(tracks)], np.int64),
        tracks.label,
        NAMES,
        UNITS,
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

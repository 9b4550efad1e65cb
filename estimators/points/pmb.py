"""Track-oriented Poisson multi-Bernoulli filter with marginal associations by belief propagation.

J. L. Williams, "Marginal multi-Bernoulli filters: RFS derivation of MHT, JIPDA and
association-based MeMBer", IEEE Trans. Aerosp. Electron. Syst. 51 (2015) 1664-1687, algorithm TOMB/P
(fig. 6); F. Meyer et al., "Message passing algorithms for scalable multitarget tracking", Proc.
IEEE 106 (2018) 221-259. Targets not detected yet are a Poisson process, all others Bernoullis; of a
scan's associations only the marginals are kept, so that cost is linear in what is near each other.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from ...models.records import Array, Estimates, Objects, Recording, Scan
from ...models.regions import mass, polygons
from .clutter_map import learnt, persistent
from .cuts import Told
from .pmb_filter import Params, State, Tracks, init, predict, update
from .sensing import at_once, count, looks
from .source import Nothing, Source, recognised
from .streams import per_stream
from .targets import settled, within

NAMES, UNITS = ("x", "y", "vx", "vy"), ("m", "m", "m s-1", "m s-1")


@dataclass(frozen=True, slots=True, eq=False)
class Context:
    """What stays: the recording's setup, parameters (in all and by stream), corners of regions.

    ``source`` makes detections of scans that hold none.
    """

    setup: Recording
    params: Params
    sensing: Mapping[str, Params]
    regions: Mapping[str, Array]
    source: Source

    @staticmethod
    def of(setup: Recording, params: Params, source: Source | None = None) -> Context:
        """The context of a recording."""
        params = settled(params, setup)
        sensing = per_stream(params, setup)
        return Context(setup, params, sensing, polygons(params.regions), source or Nothing())


def step(state: State, scans: Iterable[Scan], context: Context) -> State:
    """The state after the ``scans`` of one time, taken one after the other.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    """
    params, together, source = context.params, at_once(scans), context.source
    followed = shown(state.tracks, params)
    state, gone = predict(state, params, together[0].time_ns)
    where = (followed.m @ gone.F.T)[:, :2]
    sight = source.see(together, followed.label, where, state.classes)
    for scan, seen in looks(
        together, sight, context.setup, context.sensing, source.region, within(params)
    ):
        own = context.sensing[scan.stream]
        clutter = seen.clutter + persistent(state.maps, scan.stream, seen, own)
        state = update(state, replace(seen, clutter=clutter), params, own)
        state = replace(state, maps=learnt(state.maps, scan, seen, own))
    followed = shown(state.tracks, params)
    classes = recognised(
        sight, followed.label, followed.m[:, :2], state.tracks.label, state.classes
    )
    return replace(state, classes=classes)


def shown(tracks: Tracks, params: Params) -> Tracks:
    """Those that exist with ``extract_existence``."""
    return tracks.take(np.flatnonzero(tracks.r >= params.extract_existence))


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """:func:`run` on a recording whose scans hold all detections."""
    return run(Context.of(setup, params), scans)


def run(context: Context, scans: Iterable[Scan]) -> Iterator[Estimates]:
    """Yield the targets after each time, and how many there are in all and in the regions.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    """
    params, told = context.params, Told()
    state = init(params)
    for time_ns, group in groupby(context.source.used(scans), key=lambda scan: scan.time_ns):
        together = list(group)
        state = step(state, together, context)
        told.warn(state.cut, time_ns, count(together))
        found = objects(time_ns, shown(state.tracks, params))
        found = context.source.named(found, state.classes)
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

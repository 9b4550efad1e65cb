"""From range-angle maps to detections: fusion, identification, three-step clustering.

E. Favarelli, E. Matricardi, L. Pucci, E. Paolini, W. Xu and A. Giorgetti, "Multi-base station
cooperative sensing with AI-aided tracking", section III. The maps that stations took at one time
become a soft map; a network tells the class of each target that the filter follows, and so its
gate; bright pixels become detections with covariances. Each part is a function that a caller may
replace.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from ...models.classifier import CLASSES, TRAINED, Weights
from ...models.records import Array, Objects, Recording, Scan
from ...models.registry import load
from . import evidence
from .choice import Choice
from .kernels import cnn
from .kernels.compiled import pixels as compiled_pixels
from .kernels.fusion import Pixels
from .kernels.pixels import summary
from .pairs import split
from .params import MAPS, MapParams
from .stations import Station, doubts, fuse, seen

HEADROOM = 10.0
"""How far thresholds may come down to the noise where the reference echo is less."""
SHIPPED = Path(__file__).parent / "weights" / "jsc_cnn.npz"
_log = logging.getLogger(__name__)

Seen = Callable[[int, Sequence[Scan]], Array | None]
"""Time [ns] and scans -> share (ny, nx) of the stations that see the pixels; None: all by all."""
Fuse = Callable[[int, Sequence[Scan]], Array]
"""Time [ns] and the scans of the maps then -> soft map (ny, nx)."""
Identify = Callable[[int, Array, Array], Array]
"""Time [ns], soft map and positions (n, 2) -> probabilities (n, 2) of the classes there."""
Split = Callable[[int, Array, Array, Array], tuple[Array, Array]]
"""Time, soft map, positions (k, 2) and classes (k,) of targets -> both, a pair being two."""
Cluster = Callable[[int, Array, Array, Array, Array], tuple[Array, Array]]
"""Time, soft map, positions (k, 2), gates and rooms (k,) -> detections (n, 2), covariances."""
Classes = Mapping[int, Array]
"""Evidence (3,) of the classes of the targets, by label: see :mod:`.evidence`."""


def files(setup: Recording, params: MapParams) -> dict[str, Path]:
    """The file of weights, where a recording has maps and a network looks at them."""
    unused = params.identify != "cnn" or params.detector != "clusters"
    if unused or MAPS not in {s.kind for s in setup.streams.values()}:
        return {}
    return {"weights": Path(params.weights or SHIPPED)}


def identify(
    weights: Weights,
    pixels: Pixels,
    prior: tuple[float, ...],
    time_ns: int,
    soft: Array,
    where: Array,
) -> Array:
    """Probabilities (n, 2) of the classes of what stands at ``where`` (n, 2), by the network.

    Where the classes have the shares ``prior``, if they are stated.
    """
    p = cnn.probabilities(weights, cnn.windows(soft, where, pixels))
    return evidence.for_shares(p, TRAINED, prior) if prior else p


def cluster(
    params: MapParams,
    pixels: Pixels,
    noise: float,
    time_ns: int,
    soft: Array,
    where: Array,
    gate: Array,
    room: Array,
) -> tuple[Array, Array]:
    """Detections (n, 2) and covariances (n, 2, 2): of the known targets, then of the clusters.

    A bright pixel belongs to the nearest of ``where`` (k, 2), if it is within its ``gate`` (k,);
    those that are left, if bright enough for new ones, go to DBSCAN. A known target with too few
    pixels makes no detection, nor does a cluster that leaves no room for a target beside the
    ``room`` (k,) of a known one. The soft map's ``noise`` is its mean where nothing is.
    """
    row, column, point = pixels.above(soft, params.excision * noise)
    where = np.ascontiguousarray(where, float)
    known = compiled_pixels.nearest(point, where, gate, room)
    n, z, R = summary(point, known, len(where), pixels.cell)
    enough = n >= params.min_pixels
    rest = (known < 0) & (soft[row, column] > params.excision_new * noise)
    mask = np.zeros(soft.shape, bool)
    mask[row[rest], column[rest]] = True
    reach2 = int((params.dbscan_radius / pixels.cell) ** 2 + 1e-6)
    label = compiled_pixels.dbscan(mask, reach2, params.dbscan_points)
    _, z_new, R_new = summary(point[rest], label, label.max(initial=-1) + 1, pixels.cell)
    taken = np.where(room > 0, room + min(params.rooms), 0.0)
    new = compiled_pixels.nearest(z_new, where, taken, room) < 0
    R = params.spread * np.concatenate((R[enough], R_new[new]))
    return np.concatenate((z[enough], z_new[new])), R


@dataclass(frozen=True, slots=True, eq=False)
class Chain:
    """The processing of maps: which are fused, and the parts.

    ``identify`` is None where nobody tells classes, and where there are no maps.
    """

    params: MapParams
    choice: Choice
    fuse: Fuse
    identify: Identify | None
    split: Split
    cluster: Cluster
    seen: Seen

    @staticmethod
    def of(setup: Recording, params: MapParams) -> Chain:
        """The chain for the maps of a recording.

        Raises
        ------
        InputError : fewer streams of maps than are to be fused; weights missing or damaged
        """
        chosen = Choice.of(setup, params)
        used = chosen.used
        pixels = Pixels.of(params.map_region, params.map_cell)
        streams = {name: setup.streams[name] for name in used}
        stations = {
            name: Station.of(setup.sensors[s.nodes[0]], s.model, pixels)
            for name, s in streams.items()
        }
        for text in doubts(streams, stations, params):
            _log.warning("%s", text)
        levels = [station.noise for station in stations.values()]
        noise = max(float(len(used)), sum(levels) / HEADROOM)
        told = None
        if used and params.identify == "cnn":
            weights = load("echoset.readers", "weights")(Path(params.weights or SHIPPED))
            told = partial(identify, weights, pixels, params.class_prior)
        return Chain(
            params,
            chosen,
            partial(fuse, stations, pixels),
            told,
            partial(split, params, pixels, noise, told),
            partial(cluster, params, pixels, noise),
            partial(seen, stations, pixels),
        )

    @property
    def region(self) -> tuple[float, ...]:
        """The soft map: x_min, x_max, y_min, y_max [m]."""
        return self.params.map_region

    @property
    def streams(self) -> frozenset[str]:
        """The streams that are fused."""
        return frozenset(self.choice.used)

    def used(self, scans: Iterable[Scan]) -> Iterator[Scan]:
        """The scans but for the maps that are not fused; those fused at the time of their window.

        Raises
        ------
        InputError : at the end, if a stream that should be fused had no scan
        """
        return self.choice.scans(scans, self.params.fuse_within)

    def see(
        self, scans: Sequence[Scan], label: Array, where: Array, classes: Classes
    ) -> Sight | None:
        """What the maps among the ``scans`` of one time show; None if there are none.

        Followed are targets with ``label`` (k,), predicted at ``where`` (k, 2); ``classes`` is
        what is known of them.
        """
        maps = [scan for scan in scans if scan.stream in self.streams]
        if not maps:
            return None
        time_ns = maps[0].time_ns
        soft = self.fuse(time_ns, maps)
        share = self.seen(time_ns, maps)
        bright = soft if share is None else soft / share
        known: Classes = {}
        if self.identify is not None:
            p, before = self.identify(time_ns, soft, where), _stacked(classes, label)
            now = evidence.read(p, before, self.params.class_memory)
            known = dict(zip(label.tolist(), now, strict=True))
        kind = evidence.likeliest(_stacked(known, label))
        apart = alone(where, np.array(self.params.rooms)[kind], np.lexsort((label, -kind)))
        where, kind = where[apart], kind[apart]
        where, kind = self.split(time_ns, bright, where, kind)
        gate, room = (np.array(sizes)[kind] for sizes in (self.params.gates, self.params.rooms))
        z, R = self.cluster(time_ns, bright, where, gate, room)
        return Sight(time_ns, soft, z, R, known, self.identify)

    def named(self, objects: Objects, classes: Classes) -> Objects:
        """The objects with their classes; of those that no map has shown, as ``class_prior``."""
        if self.identify is None:
            return objects
        p = evidence.probabilities(_stacked(classes, objects.label))
        unseen = ~np.isin(objects.label, list(classes))
        p[unseen] = np.array(self.params.class_prior or TRAINED)
        p /= p.sum(1, keepdims=True)
        return replace(objects, class_names=CLASSES, class_index=p.argmax(1), class_probability=p)


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """What the maps of one time show: the soft map, detections z (n, 2) with R (n, 2, 2).

    ``classes`` are those of the targets that were followed, as ``identify`` tells them.
    """

    time_ns: int
    soft: Array
    z: Array
    R: Array
    classes: Classes
    identify: Identify | None

    def recognise(self, label: Array, where: Array, classes: Classes) -> Classes:
        """``classes`` and those of the targets with ``label`` (k,) that were found at ``where``.

        What was not followed to there is looked at where it is.
        """
        if self.identify is None:
            return {}
        known = {**classes, **self.classes}
        new = ~np.isin(label, list(self.classes))
        if new.any():
            found = evidence.read(self.identify(self.time_ns, self.soft, where[new]))
            known |= zip(label[new].tolist(), found, strict=True)
        return known


def alone(where: Array, room: Array, order: Array) -> Array:
    """Which of the targets at ``where`` (k, 2) are no doubles of one that comes before.

    Of two whose distance is less than the sum of their ``room`` (k,), the later one in the
    ``order`` (k,) of indices is taken for a double of the other.
    """
    apart = np.ones(len(where), bool)
    close = np.hypot(*(where[:, None] - where).T) < room + room[:, None]
    for k, i in enumerate(order):
        if apart[i]:
            later = order[k + 1 :]
            apart[later] &= ~close[i, later]
    return apart


def _stacked(classes: Classes, label: Array) -> Array:
    """The evidence (k, 3) of the targets with ``label`` (k,), zeros where there is none."""
    none = np.zeros(len(CLASSES) + 1)
    known = [classes.get(l, none) for l in label.tolist()]
    return np.array(known).reshape(-1, len(none))

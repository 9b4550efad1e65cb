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
from ...models.errors import InputError
from ...models.poses import pose_at
from ...models.records import Array, Objects, Recording, Scan, Sensor
from ...models.registry import load
from . import evidence
from .kernels import cnn
from .kernels.compiled import fusion as compiled_fusion
from .kernels.compiled import pixels as compiled_pixels
from .kernels.fusion import Pixels, Table, table
from .kernels.pixels import summary
from .pairs import split
from .params import MAPS, MapParams

SHIPPED = Path(__file__).parent / "weights" / "jsc_cnn.npz"
_log = logging.getLogger(__name__)

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


@dataclass(frozen=True, slots=True, eq=False)
class Station:
    """A station's axes, and the table of its map for the pose that it has first."""

    sensor: Sensor
    distance: Array
    azimuth: Array
    position: Array
    rotation: Array
    table: Table

    @staticmethod
    def of(sensor: Sensor, model: Mapping[str, Array], pixels: Pixels) -> Station:
        """The station of a stream with this ``model``."""
        distance, azimuth = (np.asarray(model[f"{a}_axis"], float) for a in ("range", "azimuth"))
        p, R = _plane(sensor, int(sensor.time_ns[0]))
        return Station(sensor, distance, azimuth, p, R, table(pixels, distance, azimuth, p, R))

    def at(self, time_ns: int, pixels: Pixels) -> Table:
        """The table for the pose at a time."""
        p, R = _plane(self.sensor, time_ns)
        if np.array_equal(p, self.position) and np.array_equal(R, self.rotation):
            return self.table
        return table(pixels, self.distance, self.azimuth, p, R)


def _plane(sensor: Sensor, time_ns: int) -> tuple[Array, Array]:
    position, rotation = pose_at(sensor, time_ns)
    return position[:2], rotation[:2, :2]


def fuse(
    stations: Mapping[str, Station], pixels: Pixels, time_ns: int, scans: Sequence[Scan]
) -> Array:
    """The soft map (ny, nx), float32: the sum of the maps in ``scans``, resampled.

    Raises
    ------
    InputError : a map that does not have the shape of its axes
    """
    soft = np.zeros((pixels.ny, pixels.nx), np.float32)
    for scan in scans:
        station, power = stations[scan.stream], scan.scan["map"]
        shape = len(station.distance), len(station.azimuth)
        if power.shape != shape:
            raise InputError(
                f"stream {scan.stream} at {time_ns} ns: map of {power.shape}, axes of {shape}"
            )
        t = station.at(time_ns, pixels)
        compiled_fusion.add(soft, np.ascontiguousarray(power), t.pixel, t.corner, t.u, t.v)
    return soft


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
    """The processing of maps: the ``streams`` that are fused, those ``unused``, and the parts.

    ``identify`` is None where nobody tells classes, and where there are no maps.
    """

    params: MapParams
    streams: frozenset[str]
    unused: frozenset[str]
    fuse: Fuse
    identify: Identify | None
    split: Split
    cluster: Cluster

    @staticmethod
    def of(setup: Recording, params: MapParams) -> Chain:
        """The chain for the maps of a recording.

        Raises
        ------
        InputError : fewer streams of maps than are to be fused; weights missing or damaged
        """
        names = sorted(name for name, s in setup.streams.items() if s.kind == MAPS)
        wanted = len(names) if params.stations is None or not names else params.stations
        if wanted > len(names):
            raise InputError(f"stations is {wanted}, but only {len(names)} streams have maps")
        used, unused = names[:wanted], names[wanted:]
        if unused:
            _log.info("fusing the maps of %s, not of %s", " ".join(used), " ".join(unused))
        pixels = Pixels.of(params.map_region, params.map_cell)
        streams = {name: setup.streams[name] for name in used}
        stations = {
            name: Station.of(setup.sensors[s.nodes[0]], s.model, pixels)
            for name, s in streams.items()
        }
        told = None
        if used and params.identify == "cnn":
            weights = load("echoset.readers", "weights")(Path(params.weights or SHIPPED))
            told = partial(identify, weights, pixels, params.class_prior)
        return Chain(
            params,
            frozenset(used),
            frozenset(unused),
            partial(fuse, stations, pixels),
            told,
            partial(split, params, pixels, float(len(used)), told),
            partial(cluster, params, pixels, float(len(used))),
        )

    @property
    def region(self) -> tuple[float, ...]:
        """The soft map: x_min, x_max, y_min, y_max [m]."""
        return self.params.map_region

    def used(self, scans: Iterable[Scan]) -> Iterator[Scan]:
        """The scans but for the maps that are not fused.

        Raises
        ------
        InputError : at the end, if a stream that should be fused had no scan
        """
        missing = set(self.streams)
        for scan in scans:
            if scan.stream not in self.unused:
                missing.discard(scan.stream)
                yield scan
        if missing:
            raise InputError(f"stream {min(missing)}: has no maps")

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
        known: Classes = {}
        if self.identify is not None:
            p, before = self.identify(time_ns, soft, where), _stacked(classes, label)
            now = evidence.read(p, before, self.params.class_memory)
            known = dict(zip(label.tolist(), now, strict=True))
        kind = evidence.likeliest(_stacked(known, label))
        apart = alone(where, np.array(self.params.rooms)[kind], np.lexsort((label, -kind)))
        where, kind = where[apart], kind[apart]
        where, kind = self.split(time_ns, soft, where, kind)
        gate, room = (np.array(sizes)[kind] for sizes in (self.params.gates, self.params.rooms))
        z, R = self.cluster(time_ns, soft, where, gate, room)
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

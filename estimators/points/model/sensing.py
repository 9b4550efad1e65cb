"""How filters of point targets see detections: positions, or ranges and azimuths, of any radar.

The state is x y vx vy in the map's plane. Every scan becomes a :class:`Look`: detections with
their noise and the density of clutter where they stand, and the pose and view of the sensor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import inf, pi
from typing import Any

import numpy as np

from ....models.errors import InputError
from ....models.geometry.poses import pose_at, velocity_at
from ....models.geometry.regions import area, box, polygon
from ....models.parameters import REQUIRED, parameter, require
from ....models.radar.detection import View, polar
from ....models.records import Array, Recording, Scan, Sensor
from ..source import MADE, Sight
from . import doppler
from .clustering import ClusterParams, clustered
from .doppler import DopplerParams, Rates
from .space import above, ground, in_plane, level

STREAMS = ("position", "range_bearing")
Motion = Callable[[float], tuple[Array, Array]]
"""Time [s] -> transition F (4, 4) and covariance Q (4, 4) of the process noise."""
UNKNOWN = "where the clutter lies is not known: give clutter_region or max_range"


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class SensorParams(ClusterParams, DopplerParams):
    """What is assumed about the sensors; recordings state it about theirs.

    What lies may be taken for clutter that persists.
    """

    TITLE = "sensors"

    p_detect: float = parameter(
        REQUIRED, "1", "probability of detection inside the view", within="[0, 1]"
    )
    clutter_rate: float = parameter(
        REQUIRED, "1", "expected false detections per scan", within="[0, inf)"
    )
    clutter_region: tuple[float, ...] = parameter(
        (),
        "m",
        "x_min, x_max, y_min, y_max of uniform clutter in the map; empty: uniform in range and "
        "azimuth over the view",
    )
    std_position: float = parameter(
        0.0, "m", "noise of a position, where the rows state none", within="[0, inf)"
    )
    std_range: float = parameter(
        0.0, "m", "noise of a range, where the rows state none", within="[0, inf)"
    )
    std_azimuth: float = parameter(
        0.0, "rad", "noise of an azimuth, where the rows state none", within="[0, 1.5708]"
    )
    latency: float = parameter(
        0.0,
        "s",
        "how long before their stamps scans were true: there estimates are, and the sensor's pose",
        within="[0, inf)",
    )
    registration: tuple[float, float] = parameter(
        (0.0, 0.0),
        "m, rad or m",
        "how much too large range and azimuth are, or x and y in the sensor's frame",
    )
    max_range: float = parameter(
        0.0, "m", "end of the view where scans state none; 0: nowhere", within="[0, inf)"
    )
    fov_mass: bool = parameter(
        True, "1", "p_detect times the mass inside the view, not all or nothing by the mean"
    )
    target_height: float = parameter(
        0.0, "m", "height of targets in the map, for sensors that stand above it or are tilted"
    )
    unscented: bool = parameter(False, "1", "unscented, not extended, update of range and azimuth")
    clutter_cell: float = parameter(
        0.0,
        "m",
        "cells of a map of persistent clutter, learnt on the way, as wide as the noise; 0: no map",
        within="[0, inf)",
    )
    clutter_memory: float = parameter(60.0, "s", "time over which it fades", within="(0, inf)")
    sensors: Any = parameter({}, "1", "what differs for single streams: name to parameters")

    def __post_init__(self) -> None:
        if self.clutter_region:
            polygon(self.clutter_region, "clutter_region")
        require(isinstance(self.sensors, Mapping), "sensors", "a mapping", self.sensors)


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """Detections of one time among those of a scan: their look, and the motion until then."""

    look: Look
    F: Array
    Q: Array


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """One scan: detections z (n, 2) with noise R (1 or n, 2, 2) and clutter density (n,).

    Cartesian detections are in the map [m] and their clutter per m^2; of ranges and azimuths z
    is (m, rad) in the sensor's frame and the clutter per m rad. ``spatial`` (n,) is the density of
    one clutter point, in the same measure, NaN where it is not known: uniform in the ``region``, or
    where that is empty in range and azimuth over the view. ``period`` (2,) tells angles;
    ``position`` (2,) and ``rotation`` (2, 2) are the sensor's pose, ``p_detect`` holds in ``view``.
    Where the rows have times of their own, ``parts`` are they one by one. ``rates`` are the Doppler
    of the detections, None where it is not used; densities have the measure of the place alone, but
    for ``clutter``.
    """

    polar: bool
    z: Array
    R: Array
    clutter: Array
    period: Array
    position: Array
    rotation: Array
    view: View
    p_detect: float
    spatial: Array
    region: tuple[float, ...] = ()
    parts: tuple[Part, ...] = ()
    rates: Rates | None = None

    def with_doppler(self, density: Array) -> Array:
        """Densities (n,) of clutter with a place as those of clutter with Doppler as well."""
        if self.rates is None or not self.rates.updates:
            return density
        return density * self.rates.clutter

    def take(self, index: Array) -> Look:
        """The detections ``index``."""
        R = self.R if len(self.R) == 1 else self.R[index]
        some = {name: getattr(self, name)[index] for name in ("z", "clutter", "spatial")}
        parts = tuple(self.parts[i] for i in index) if self.parts else ()
        rates = None if self.rates is None else self.rates.take(index)
        return replace(self, **some, R=R, parts=parts, rates=rates)


def look(params: SensorParams, scan: Scan, polar_rows: bool, sensor: Sensor) -> Look:
    """The ``scan`` of a stream of ranges and azimuths (``polar_rows``) or of positions.

    Raises
    ------
    InputError : the noise of the detections, or the region of the clutter, is not known
    """
    position, turn = pose_at(sensor, scan.time_ns)
    p, rotation = position[:2], level(turn)
    view = View.of(scan.scan, params.max_range or inf)
    rows, down = _registered(params, scan.rows, polar_rows), params.target_height - position[2]
    if polar_rows:
        z, slope = ground(rows, turn, down)
        R = _polar_noise(params, rows)
        if slope is not None:
            R = np.tile(R, (len(z) if len(R) == 1 else 1, 1, 1))
            R[:, 0, 0] *= slope**2
        where = p + cartesian(z) @ rotation.T
    else:
        offset, J = in_plane(rows, turn, down)
        where = z = p + offset
        R = J @ _position_noise(params, rows) @ J.T
    period = np.array([0.0, 2 * pi if polar_rows else 0.0])
    spatial = _spatial(params, polar_rows, z, where, p, view)
    clutter = params.clutter_rate * spatial if params.clutter_rate else np.zeros(len(z))
    if np.isnan(clutter).any():
        raise InputError(UNKNOWN)
    region, p_detect = params.clutter_region, params.p_detect
    moving = velocity_at(sensor, scan.time_ns) if "doppler" in rows else np.zeros(3)
    rates = doppler.rates(params, rows, p, moving, above(rows, turn, down, polar_rows))
    found = Look(
        polar_rows, z, R, clutter, period, p, rotation, view, p_detect, spatial, region, rates=rates
    )
    return replace(found, clutter=found.with_doppler(clutter))


def _registered(
    params: SensorParams, rows: Mapping[str, Array], polar_rows: bool
) -> Mapping[str, Array]:
    """The rows without the offsets of their sensor."""
    if not any(params.registration):
        return rows
    names = ("range", "azimuth") if polar_rows else ("x", "y")
    moved = {k: rows[k] - shift for k, shift in zip(names, params.registration, strict=True)}
    if polar_rows:
        moved["range"] = np.maximum(moved["range"], 0.0)
    return {**rows, **moved}


def at_once(scans: Iterable[Scan]) -> list[Scan]:
    """The scans of one time.

    Raises
    ------
    InputError : two of one stream
    """
    together = list(scans)
    if len({scan.stream for scan in together}) < len(together):
        raise InputError(f"scans at {together[0].time_ns} ns: two of one stream")
    return together


def count(scans: Iterable[Scan]) -> int:
    """How many detections the scans hold."""
    return sum(len(next(iter(scan.rows.values()))) for scan in scans if scan.rows)


def looks(
    scans: Iterable[Scan],
    sight: Sight | None,
    setup: Recording,
    params: Mapping[str, SensorParams],
    region: tuple[float, ...],
    motion: Motion,
) -> Iterator[tuple[Scan, Look]]:
    """What the ``scans`` of one time show with the ``params`` of their streams, one by one.

    What a source has made of some of them is the first, and has no rows; its clutter is uniform
    over ``region`` where no other is stated.

    Raises
    ------
    InputError : the noise of the detections, or the region of the clutter, is not known
    """
    together = list(scans)
    if sight is not None:
        time_ns = together[0].time_ns
        yield Scan(MADE, time_ns, {}, {}), made(params[MADE], sight.z, sight.R, region)
    for scan in together:
        stream = setup.streams[scan.stream]
        if stream.kind in STREAMS:
            polar_rows, sensor = stream.kind == "range_bearing", setup.sensors[stream.nodes[0]]
            own = params[scan.stream]
            if own.cluster == "dbscan":
                noise = (_polar_noise if polar_rows else _position_noise)(own, scan.rows)
                scan = clustered(own, scan, polar_rows, noise)
            yield scan, timed(own, scan, polar_rows, sensor, motion)


def timed(
    params: SensorParams, scan: Scan, polar_rows: bool, sensor: Sensor, motion: Motion
) -> Look:
    """:func:`look`, each row from the pose and of the targets that there were at its own time.

    Raises
    ------
    InputError : the noise of the detections, or the region of the clutter, is not known
    """
    found = look(params, scan, polar_rows, sensor)
    offset = scan.rows.get("time_offset", np.zeros(0))
    if not offset.any():
        return found
    parts = []
    for i, seconds in enumerate(offset.tolist()):
        row = {name: values[i : i + 1] for name, values in scan.rows.items()}
        at = scan.time_ns + round(seconds * 1e9)
        one = look(params, replace(scan, rows=row, time_ns=at), polar_rows, sensor)
        parts.append(Part(one, *motion(seconds)))
    # In the map positions are where the sensor was then; in its frame nothing changes.
    z = np.concatenate([part.look.z for part in parts])
    return replace(found, z=z, parts=tuple(parts))


def made(params: SensorParams, z: Array, R: Array, region: tuple[float, ...]) -> Look:
    """Detections z (n, 2) that a source made in the map, with covariances R (n, 2, 2)."""
    region = params.clutter_region or region
    spatial = np.full(len(z), 1 / area(box(region)))
    zero, clutter, p = np.zeros(2), params.clutter_rate * spatial, params.p_detect
    return Look(False, z, R, clutter, zero, zero, np.eye(2), View(), p, spatial, region)


def spread(look: Look, where: Array) -> Array:
    """Density (n,) [m^-2] of one clutter point of a look at positions (n, 2) in the map."""
    if look.region:
        return np.full(len(where), 1 / area(box(look.region)))
    distance, azimuth = polar((where - look.position) @ look.rotation)
    inside = look.view.contains(distance, azimuth)
    return np.where(inside, 1 / (look.view.area * np.maximum(distance, 1e-9)), 0.0)


def cartesian(z: Array) -> Array:
    """Places (n, 2) of ranges and azimuths (n, 2), about the sensor."""
    return np.asarray(z[:, :1] * np.stack((np.cos(z[:, 1]), np.sin(z[:, 1])), 1))


def _position_noise(params: SensorParams, rows: Mapping[str, Array]) -> Array:
    if "cov_xx" in rows:
        xx, xy, yy = (rows[f"cov_{c}"] for c in ("xx", "xy", "yy"))
        if ((xx <= 0) | (xx * yy - xy**2 <= 0)).any():
            raise InputError("a covariance cov_xx cov_xy cov_yy is not positive definite")
        return np.stack((np.stack((xx, xy), -1), np.stack((xy, yy), -1)), -2)
    return _known("std_position", params.std_position) ** 2 * np.eye(2)[None]


def _polar_noise(params: SensorParams, rows: Mapping[str, Array]) -> Array:
    names = ("std_range", "std_azimuth")
    std = [rows.get(k, np.full(1, getattr(params, k))) for k in names]
    for name, values in zip(names, std, strict=True):
        _known(name, values.min(initial=inf))
    if (std[1] > pi / 2).any():
        raise InputError("std_azimuth is above a quarter of a turn: is it in degrees?")
    n = len(rows["range"]) if any(k in rows for k in names) else 1
    R = np.zeros((n, 2, 2))
    R[:, 0, 0], R[:, 1, 1] = (np.broadcast_to(v**2, n) for v in std)
    return R


def _known(name: str, value: float) -> float:
    if value <= 0:
        raise InputError(f"the noise of the detections is not known: give {name}")
    return value


def _spatial(
    params: SensorParams, polar_rows: bool, z: Array, where: Array, sensor: Array, view: View
) -> Array:
    """Density (n,) of one clutter point at detections, in their own measure; NaN: not known."""
    # An area element in the map is r dr d(azimuth).
    distance = np.hypot(*(where - sensor).T)
    if params.clutter_region:
        # Outside, too: a detection from beyond the region shall not count as a certain target.
        density = np.full(len(z), 1 / area(box(params.clutter_region)))
        return np.asarray(density * distance if polar_rows else density)
    density = np.full(len(z), 1 / view.area if view.bounded else np.nan)
    return density if polar_rows else density / np.maximum(distance, 1e-9)

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
from ..kernels.compiled import gaussians
from ..kernels.compiled.pairs import log_likelihood as of_pairs
from ..kernels.gaussians import innovation
from ..source import MADE, Sight
from . import doppler
from .clustering import ClusterParams, clustered
from .doppler import DopplerParams, Rates

STREAMS = ("position", "range_bearing")
Motion = Callable[[float], tuple[Array, Array]]
"""Time [s] -> transition F (4, 4) and covariance Q (4, 4) of the process noise."""
STEEP = 100.0
"""Most that a range on the ground changes per metre of the range in space."""
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
        where = p + _cartesian(z) @ rotation.T
    else:
        offset, J = _in_plane(rows, turn, down)
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


def level(turn: Array) -> Array:
    """Rotation (2, 2) about the vertical of a sensor with rotation ``turn`` (3, 3), tilted or not.

    Raises
    ------
    InputError : its x axis is vertical
    """
    if turn[2, 2] == 1:
        return np.asarray(turn[:2, :2])
    length = np.hypot(turn[0, 0], turn[1, 0])
    if length < 1e-6:
        raise InputError("a sensor's x axis is vertical: it has no azimuth in the plane")
    c, s = turn[:2, 0] / length
    return np.array([[c, -s], [s, c]])


def ground(rows: Mapping[str, Array], turn: Array, down: float) -> tuple[Array, Array | None]:
    """Ranges and azimuths (n, 2) in the plane, about the sensor's foot, of those in space.

    Also their slopes (n,) over the measured range, None where nothing changes. Without elevation
    it is what takes the detection to targets, which are ``down`` [m] from the sensor (negative for
    below it).
    """
    r, azimuth = rows["range"], rows["azimuth"]
    tilted = turn[2, 2] != 1
    if "elevation" not in rows and not tilted and down == 0:
        return np.stack((r, azimuth), 1), None
    if "elevation" in rows:
        elevation = rows["elevation"]
    else:
        # Height over the sensor is r (A cos el + B sin el) with A and B by the third row of turn.
        A = turn[2, 0] * np.cos(azimuth) + turn[2, 1] * np.sin(azimuth)
        share = down / np.maximum(r * np.hypot(A, turn[2, 2]), 1e-9)
        elevation = np.arctan2(turn[2, 2], A) - np.arccos(np.clip(share, -1.0, 1.0))
    c = np.cos(elevation)
    ray = np.stack((c * np.cos(azimuth), c * np.sin(azimuth), np.sin(elevation)), 1)
    x = r[:, None] * ray @ turn.T
    distance = np.maximum(np.hypot(x[:, 0], x[:, 1]), 1e-9)
    along = x[:, :2] @ level(turn)
    z = np.stack((distance, np.arctan2(along[:, 1], along[:, 0])), 1)
    measured = "elevation" in rows
    return z, distance / np.maximum(r, 1e-9) if measured else np.minimum(r / distance, STEEP)


def above(rows: Mapping[str, Array], turn: Array, down: float, polar_rows: bool) -> Array:
    """Heights (n,) [m] over the sensor, by their elevation or z, else those of targets."""
    if polar_rows and "elevation" in rows:
        r, azimuth, elevation = rows["range"], rows["azimuth"], rows["elevation"]
        c = r * np.cos(elevation)
        x = np.stack((c * np.cos(azimuth), c * np.sin(azimuth), r * np.sin(elevation)), 1)
        return np.asarray(x @ turn[2])
    if not polar_rows and "z" in rows:
        return np.asarray(np.stack((rows["x"], rows["y"], rows["z"]), 1) @ turn[2])
    return np.full(len(rows["range" if polar_rows else "x"]), down)


def _in_plane(rows: Mapping[str, Array], turn: Array, down: float) -> tuple[Array, Array]:
    """Offsets (n, 2) in the map from the sensor, and their Jacobian (2, 2) over x and y."""
    x = np.stack((rows["x"], rows["y"]), 1)
    if "z" in rows:
        return x @ turn[:2, :2].T + rows["z"][:, None] * turn[:2, 2], turn[:2, :2]
    if turn[2, 2] == 1:
        return x @ turn[:2, :2].T, turn[:2, :2]
    z = (down - x @ turn[2, :2]) / turn[2, 2]
    J = turn[:2, :2] - np.outer(turn[:2, 2], turn[2, :2]) / turn[2, 2]
    return x @ turn[:2, :2].T + z[:, None] * turn[:2, 2], J


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


def expected(look: Look, m: Array, P: Array, unscented: bool) -> tuple[Array, Array, Array]:
    """Expected detection z_hat (J, 2), its covariances C (J, 4, 2) with the state and S (J, 2, 2).

    S lacks the noise R of the detection. For ranges and azimuths by linearisation at the mean
    (extended) or by 2 dx sigma points (unscented, kappa = 0; Julier and Uhlmann 2004).
    """
    if not look.polar:
        return m[:, :2].copy(), P[:, :, :2], P[:, :2, :2].copy()
    local = (m[:, :2] - look.position) @ look.rotation
    distance, azimuth = polar(local)
    z_hat = np.stack((distance, azimuth), 1)
    if not unscented:
        r = np.maximum(distance, 1e-9)
        c, s = local.T / r
        H = np.stack((np.stack((c, s), -1), np.stack((-s, c), -1) / r[:, None]), 1)
        H = H @ look.rotation.T
        C = P[:, :, :2] @ H.swapaxes(1, 2)
        return z_hat, C, H @ C[:, :2]
    d = m.shape[1]
    L = np.sqrt(d) * np.linalg.cholesky(P).swapaxes(1, 2)
    sigma = np.concatenate((L, -L), 1)
    spread = (m[:, None, :2] + sigma[..., :2] - look.position) @ look.rotation
    points = np.stack(polar(spread), -1)
    e = points - z_hat[:, None]
    e[..., 1] -= 2 * pi * np.round(e[..., 1] / (2 * pi))
    shift = e.mean(1)
    e -= shift[:, None]
    C = sigma.swapaxes(1, 2) @ e / (2 * d)
    return z_hat + shift, C, e.swapaxes(1, 2) @ e / (2 * d)


def innovations(look: Look, m: Array, P: Array, unscented: bool) -> tuple[Array, Array, Array]:
    """:func:`expected` (J, k, ...) of each detection, k = n where they differ from it.

    They do where they have times of their own or Doppler, which is a third entry. Else k is 1. S
    has the noise R of the detections, and so n entries where that differs.
    """
    if not look.parts:
        return _beside(look, m, P, *expected(look, m, P, unscented))
    found = []
    for part in look.parts:
        m_then = m @ part.F.T
        moved = part.F @ P
        P_then = moved @ part.F.T + part.Q
        z_hat, C, S = innovations(part.look, m_then, P_then, unscented)
        # With H as the regression on the state then: the covariance of the state now.
        H = np.linalg.solve(P_then, C[:, 0])
        found.append((z_hat[:, 0], moved.swapaxes(1, 2) @ H, S[:, 0]))
    z_hat, C, S = (np.stack(columns, 1) for columns in zip(*found, strict=True))
    return z_hat, C, S


def _beside(
    look: Look, m: Array, P: Array, z_hat: Array, C: Array, S: Array
) -> tuple[Array, Array, Array]:
    """What is :func:`expected`, with Doppler, if there is any, in all pairs (J, n, ...)."""
    S = S[:, None] + look.R
    if look.rates is None:
        return z_hat[:, None], C[:, None], S
    J, n = len(m), len(look.z)
    j, i = np.repeat(np.arange(J), n), np.tile(np.arange(n), J)
    v = innovation(look.z[i], z_hat[j], look.period)
    of = S[j, i] if S.shape[1] > 1 else S[j, 0]
    found = doppler.beside(look.rates, i, v, m[j], P[j], z_hat[j], C[j], of)
    z_hat, C, S = (a.reshape(J, n, *a.shape[1:]) for a in found)
    return z_hat, C, S


def log_likelihood(look: Look, z_hat: Array, S: Array, gate: float) -> Array:
    """Log densities (J, n) of the detections, -inf outside the gate."""
    J, n = len(z_hat), len(look.z)
    if z_hat.shape[1] == 1 and look.rates is None:
        return gaussians.log_likelihood(look.z, z_hat[:, 0], S, look.period, gate)
    d = z_hat.shape[2]
    at = np.broadcast_to(z_hat, (J, n, d)).reshape(J * n, d)
    S = np.broadcast_to(S, (J, n, d, d)).reshape(J * n, d, d)
    return pair_likelihood(look, at, S, np.tile(np.arange(n), J), gate).reshape(J, n)


def pair_likelihood(look: Look, z_hat: Array, S: Array, i: Array, gate: float) -> Array:
    """Log densities (k,) of the detections ``i`` (k,), -inf outside the gate, of place or Doppler.

    They are expected at z_hat (k, 2 or 3) with covariance S, noise included.
    """
    place, spread = (np.ascontiguousarray(a) for a in (z_hat[:, :2], S[:, :2, :2]))
    none = np.zeros((1, 2, 2))
    log_l = of_pairs(look.z, place, spread, none, look.period, np.arange(len(i)), i, gate)
    if look.rates is None:
        return log_l
    near = np.flatnonzero(log_l > -np.inf)
    v = innovation(look.z[i[near]], place[near], look.period)
    log_l[near] += doppler.log_density(look.rates, i[near], v, z_hat[near], S[near], gate)
    return log_l


def updated(
    look: Look, m: Array, P: Array, z_hat: Array, C: Array, S: Array, j: Array, i: Array
) -> tuple[Array, Array]:
    """Means (k, dx) and covariances of the Gaussians ``j`` (k,) given detections ``i`` (k,)."""
    if z_hat.shape[1] == S.shape[1] == 1 and look.rates is None:
        K, P = gaussians.gain(P, np.ascontiguousarray(C[:, 0]), S[:, 0])
        return gaussians.correct(m[j], K[j], look.z[i], z_hat[j, 0], look.period), P[j]
    at, of = (i if a.shape[1] > 1 else np.zeros_like(i) for a in (z_hat, S))
    return pair_update(look, m[j], P[j], z_hat[j, at], C[j, at], S[j, of], i)


def pair_update(
    look: Look, m: Array, P: Array, z_hat: Array, C: Array, S: Array, i: Array
) -> tuple[Array, Array]:
    """Means (k, dx) and covariances of Gaussians m, P given the detections ``i`` (k,), one each."""
    place = z_hat[:, :2]
    K, P = gaussians.gain(P, np.ascontiguousarray(C[:, :, :2]), np.ascontiguousarray(S[:, :2, :2]))
    m = gaussians.correct(m, K, look.z[i], np.ascontiguousarray(place), look.period)
    if look.rates is None:
        return m, P
    v = innovation(look.z[i], place, look.period)
    return doppler.corrected(look.rates, i, v, m, P, z_hat, C, S)


def first(look: Look, std_velocity: Array) -> tuple[Array, Array, Array]:
    """Targets m (n, 4), P that nothing but the detections tells of, and a density (n,).

    Velocities are about 0, with deviations ``std_velocity`` (2,). The density is that of their
    Doppler, in the measure that clutter has beside its place.
    """
    if look.parts:
        each = [first(part.look, std_velocity) for part in look.parts]
        m, P, density = (np.concatenate(columns) for columns in zip(*each, strict=True))
        return m, P, density
    where, R = positions(look)
    m, P = np.hstack((where, np.zeros_like(where))), np.zeros((len(where), 4, 4))
    P[:, :2, :2], P[:, 2:, 2:] = R, np.diag(np.square(std_velocity))
    if look.rates is None:
        return m, P, np.ones(len(m))
    density, m, P = doppler.first(look.rates, m, P)
    return m, P, density


def positions(look: Look) -> tuple[Array, Array]:
    """Detections as positions (n, 2) in the map with covariances (n, 2, 2), at their own times."""
    if look.parts:
        each = [positions(part.look) for part in look.parts]
        return np.concatenate([x for x, _ in each]), np.concatenate([R for _, R in each])
    R = np.broadcast_to(look.R, (len(look.z), 2, 2))
    if not look.polar:
        return look.z, R
    r, a = look.z.T
    c, s = np.cos(a), np.sin(a)
    J = look.rotation @ np.stack((np.stack((c, s), -1), np.stack((-s, c), -1) * r[:, None]), -1)
    where: Array = look.position + _cartesian(look.z) @ look.rotation.T
    return where, J @ R @ J.swapaxes(1, 2)


def _cartesian(z: Array) -> Array:
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

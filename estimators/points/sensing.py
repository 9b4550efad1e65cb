"""How filters of point targets see detections: positions, or ranges and azimuths, of any radar.

The state is x y vx vy in the map's plane. Every scan becomes a :class:`Look`: detections with
their noise and the density of clutter where they stand, and the pose and view of the sensor.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import inf, pi
from typing import Any, TypeVar

import numpy as np

from ...models.errors import InputError
from ...models.parameters import REQUIRED, as_dict, parameter, require, resolve
from ...models.poses import pose_at
from ...models.radar.detection import View, polar
from ...models.records import Array, Recording, Scan, Sensor
from ...models.regions import area, box, mass, polygon
from .source import MADE, Sight

STREAMS = ("position", "range_bearing")


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class SensorParams:
    """What is assumed about the sensors; recordings state it about theirs."""

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
        0.0, "rad", "noise of an azimuth, where the rows state none", within="[0, inf)"
    )
    max_range: float = parameter(
        0.0, "m", "end of the view where scans state none; 0: nowhere", within="[0, inf)"
    )
    fov_mass: bool = parameter(
        False, "1", "p_detect times the mass inside the view, not all or nothing by the mean"
    )
    unscented: bool = parameter(False, "1", "unscented, not extended, update of range and azimuth")
    sensors: Any = parameter({}, "1", "what differs for single streams: name to parameters")

    def __post_init__(self) -> None:
        if self.clutter_region:
            polygon(self.clutter_region, "clutter_region")
        require(isinstance(self.sensors, Mapping), "sensors", "a mapping", self.sensors)


P = TypeVar("P", bound=SensorParams)


def per_stream(params: P, setup: Recording) -> dict[str, P]:
    """The parameters as they hold for each stream.

    What ``sensors`` says of a stream wins. Where streams disagree and the common value is but the
    last stream's (so the user said nothing), each keeps its own.
    """
    common = as_dict(params)
    models = {name: s.model for name, s in sorted(setup.streams.items())}
    last = {key: value for model in models.values() for key, value in model.items()}
    found = {}
    for name, model in models.items():
        own = {k: v for k, v in model.items() if k in common and _equal(common[k], last[k])}
        said = params.sensors.get(name, {})
        require(isinstance(said, Mapping), f"sensors.{name}", "a mapping", said)
        found[name] = resolve(
            type(params), ("", common), (f"{name}: model", own), (f"sensors.{name}", said)
        )
    return found


def _equal(a: Any, b: Any) -> bool:
    return bool(np.array_equal(np.asarray(a), np.asarray(b)))


@dataclass(frozen=True, slots=True, eq=False)
class Look:
    """One scan: detections z (n, 2) with noise R (1 or n, 2, 2) and clutter density (n,).

    Cartesian detections are in the map [m] and their clutter per m^2; of ranges and azimuths z
    is (m, rad) in the sensor's frame and the clutter per m rad. ``period`` (2,) tells angles;
    ``position`` (2,) and ``rotation`` (2, 2) are the sensor's pose, ``p_detect`` holds in ``view``.
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


def look(params: SensorParams, scan: Scan, polar_rows: bool, sensor: Sensor) -> Look:
    """The ``scan`` of a stream of ranges and azimuths (``polar_rows``) or of positions.

    Raises
    ------
    InputError : the noise of the detections, or the region of the clutter, is not known
    """
    position, turn = pose_at(sensor, scan.time_ns)
    p, rotation = position[:2], turn[:2, :2]
    view = View.of(scan.scan, params.max_range or inf)
    rows = scan.rows
    if polar_rows:
        z = np.stack((rows["range"], rows["azimuth"]), 1)
        R = _polar_noise(params, rows)
        where = p + _cartesian(z) @ rotation.T
    else:
        where = z = p + np.stack((rows["x"], rows["y"]), 1) @ rotation.T
        R = rotation @ _position_noise(params, rows) @ rotation.T
    period = np.array([0.0, 2 * pi if polar_rows else 0.0])
    clutter = _clutter(params, polar_rows, z, where, p, view)
    return Look(polar_rows, z, R, clutter, period, p, rotation, view, params.p_detect)


def looks(
    scans: Iterable[Scan],
    sight: Sight | None,
    setup: Recording,
    params: Mapping[str, SensorParams],
    region: tuple[float, ...],
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
            yield scan, look(params[scan.stream], scan, polar_rows, sensor)


def made(params: SensorParams, z: Array, R: Array, region: tuple[float, ...]) -> Look:
    """Detections z (n, 2) that a source made in the map, with covariances R (n, 2, 2)."""
    clutter = np.full(len(z), params.clutter_rate / area(box(params.clutter_region or region)))
    zero = np.zeros(2)
    return Look(False, z, R, clutter, zero, zero, np.eye(2), View(), params.p_detect)


def expected(look: Look, m: Array, P: Array, unscented: bool) -> tuple[Array, Array, Array]:
    """Expected detection z_hat (J, 2), its covariances C (J, 4, 2) with the state and S (J, 2, 2).

    S lacks the noise R of the detection. For ranges and azimuths by linearisation at the mean
    (extended) or by 2 dx sigma points (unscented, kappa = 0; Julier and Uhlmann 2004).
    """
    if not look.polar:
        return m[:, :2], P[:, :, :2], P[:, :2, :2]
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


def detection_probability(look: Look, m: Array, P: Array, fov_mass: bool) -> Array:
    """Probability (J,) that a target with this mean and covariance is detected."""
    if look.view == View():
        return np.full(len(m), look.p_detect)
    local = (m[:, :2] - look.position) @ look.rotation
    if fov_mass and look.view.bounded:
        spread = look.rotation.T @ P[:, :2, :2] @ look.rotation
        inside = mass(local, spread, look.view.corners())
    else:
        inside = look.view.contains(*polar(local))
    return np.asarray(look.p_detect * inside)


def positions(look: Look) -> tuple[Array, Array]:
    """Detections as positions (n, 2) in the map with covariances (n, 2, 2)."""
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
    std = [rows.get(k, np.full(1, getattr(params, k))) for k in ("std_range", "std_azimuth")]
    for name, values in zip(("std_range", "std_azimuth"), std, strict=True):
        _known(name, values.min(initial=inf))
    R = np.zeros((max(map(len, std)), 2, 2))
    R[:, 0, 0], R[:, 1, 1] = std[0] ** 2, std[1] ** 2
    return R


def _known(name: str, value: float) -> float:
    if value <= 0:
        raise InputError(f"the noise of the detections is not known: give {name}")
    return value


def _clutter(
    params: SensorParams, polar_rows: bool, z: Array, where: Array, sensor: Array, view: View
) -> Array:
    """Expected density (n,) of clutter at detections, in their own measure."""
    rate = params.clutter_rate
    if rate == 0:
        return np.zeros(len(z))
    # An area element in the map is r dr d(azimuth).
    distance = np.hypot(*(where - sensor).T)
    if params.clutter_region:
        # Outside, too: a detection from beyond the region shall not count as a certain target.
        density = np.full(len(z), rate / area(box(params.clutter_region)))
        return np.asarray(density * distance if polar_rows else density)
    if not view.bounded:
        raise InputError("where the clutter lies is not known: give clutter_region or max_range")
    density = np.full(len(z), rate / view.area)
    return density if polar_rows else density / np.maximum(distance, 1e-9)


__all__ = [
    "STREAMS", "Look", "SensorParams", "detection_probability", "expected", "look", "looks",
    "per_stream", "positions",
]  # fmt: skip

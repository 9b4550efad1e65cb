"""Base stations watch pedestrians and vehicles at a crossing with their OFDM waveform.

The scene of E. Favarelli et al., "Multi-base station cooperative sensing with AI-aided tracking",
section IV-B; what the paper leaves open is marked as a choice. Every station makes a range-angle
map in every scan; targets stand still while it is made. A scatterer's cross section is exponential
(Swerling I), drawn for every scan and station, its phase uniform. The recording states the site
plan, places on lanes and crosswalks where targets may be, for estimators as births.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ..models.geometry.poses import yaw_quaternion
from ..models.parameters import parameter, require
from ..models.radar.multibeam import BaseStation, Echoes, path_gain, reference_echo, space
from ..models.radar.reflectors import Reflectors, pedestrian, vehicle, visibility
from ..models.records import Array, Meta, Objects, Recording, Sensor, Stream, Truth
from . import spectral, waveform
from .traffic import Line, Walker, draw

SUMMARY = "base stations that sense by OFDM: range-angle maps of pedestrians and vehicles"
CLASSES = ("pedestrian", "vehicle")
SLACK = 0.05
"""Share of the scan's symbols that may not fit into dt: the paper's own need 50.95 ms of 50."""
ENGINES = {"spectral": spectral.range_angle_map, "waveform": waveform.range_angle_map}


@dataclass(frozen=True, slots=True)
class Params(BaseStation):
    """Stations, waveform, scene and engine."""

    scans: int = parameter(200, "1", "number of scans", within="[1, inf)")
    dt: float = parameter(
        0.05, "s", "time T_scan between scans; scan k, from 1, is at k dt", within="(0, inf)"
    )
    station_radius: float = parameter(
        50.0, "m", "distance of the stations from the origin", within="(0, inf)"
    )
    stations: tuple[tuple[float, float, float], ...] = parameter(
        (),
        "m, m, rad",
        "x, y and yaw of stations S0, S1, ..., yaw from the x axis to where the array faces; "
        "empty: on their circle",
    )
    station_height: float = parameter(
        0.0, "m", "height of the stations over what reflects", within="[0, inf)"
    )
    station_azimuths: tuple[float, ...] = parameter(
        tuple(np.pi / 3 * k for k in (0, 2, 4, 1, 3, 5)),
        "rad",
        "where stations S0, S1, ... stand on their circle, facing its centre; order is a choice: "
        "the first so many surround the area",
    )
    stagger: float = parameter(
        0.0,
        "s",
        "each station takes its maps so much later than the one before; the truth is that of the "
        "mean time",
        within="[0, inf)",
    )
    engine: str = parameter("spectral", "1", "spectral: the map by its law; waveform: by symbols")
    noisy: bool = parameter(True, "1", "with receiver noise")
    pedestrians: int = parameter(4, "1", "number of pedestrians", within="[0, inf)")
    vehicles: int = parameter(4, "1", "number of vehicles", within="[0, inf)")
    lanes: Any = parameter({}, "m", "lanes by name: x0, y0, x1, y1 in the direction of travel")
    crosswalks: Any = parameter({}, "m", "crosswalks by name: x0, y0, x1, y1")
    area: tuple[float, float, float, float] = parameter(
        (-20.0, 20.0, -20.0, 20.0),
        "m",
        "x_min, x_max, y_min, y_max of what is watched: the soft map of estimators",
    )
    margin: float = parameter(
        1.0, "m", "centres stay this far inside the area, choice", within="[0, inf)"
    )
    clearance: float = parameter(
        1.0,
        "m",
        "least gap between the bodies of two objects, rectangles along their headings, choice",
        within="[0, inf)",
    )
    vehicle_speed: tuple[float, float] = parameter((1.0, 3.5), "m s-1", "range, choice")
    pedestrian_speed: tuple[float, float] = parameter((0.5, 1.5), "m s-1", "range, choice")
    vehicle_turn: tuple[float, float] = parameter((5.0, 8.0), "m", "range of radii, choice")
    pedestrian_turn: tuple[float, float] = parameter((1.0, 2.0), "m", "range of radii, choice")
    vehicle_length: float = parameter(4.5, "m", "length of a vehicle, choice", within="(0, inf)")
    vehicle_width: float = parameter(1.8, "m", "width of a vehicle, choice", within="(0, inf)")
    vehicle_spread: tuple[float, float] = parameter(
        (0.0, 0.0),
        "1",
        "standard deviations of the log length and log width of each vehicle",
        within="[0, inf)",
    )
    pedestrian_radius: float = parameter(
        0.25, "m", "half the width of a pedestrian, choice", within="(0, inf)"
    )
    rcs_pedestrian: float = parameter(
        1.0, "m2", "mean radar cross section (table I)", within="[0, inf)"
    )
    rcs_surface: float = parameter(20.0, "m2", "of each surface of a vehicle", within="[0, inf)")
    rcs_wheelhouse: float = parameter(
        0.0, "m2", "of each wheelhouse, as table I prints it", within="[0, inf)"
    )
    rcs_corner: float = parameter(5.0, "m2", "of each corner", within="[0, inf)")
    surface_visibility: tuple[float, float] = parameter(
        (0.05, 0.2),
        "rad",
        "off its normal a surface is seen whole up to, not at all beyond, choice",
    )
    wheelhouse_visibility: tuple[float, float] = parameter((0.8, 1.2), "rad", "likewise, choice")
    corner_visibility: tuple[float, float] = parameter((1.7, 2.35), "rad", "likewise, choice")
    birth_spacing: float = parameter(
        4.0, "m", "spacing of births on lanes and crosswalks, choice", within="(0, inf)"
    )
    birth_weight: float = parameter(
        0.005, "1", "expected targets a scan at each, choice", within="[0, inf)"
    )
    birth_variance: float = parameter(
        0.1, "m2, m2 s-2", "variance of a birth's state entries", within="(0, inf)"
    )
    recovery_variance: float = parameter(
        5.0, "m2, m2 s-2", "that of the recovery at the centre", within="(0, inf)"
    )

    def __post_init__(self) -> None:
        BaseStation.__post_init__(self)
        for name in ("vehicle_speed", "pedestrian_speed", "vehicle_turn", "pedestrian_turn"):
            low, high = getattr(self, name)
            require(0 < low <= high, name, "positive and increasing", (low, high))
        for name in ("surface_visibility", "wheelhouse_visibility", "corner_visibility"):
            low, high = getattr(self, name)
            require(0 <= low <= high, name, "increasing, at least 0", (low, high))
        on_circle = bool(self.station_azimuths) or bool(self.stations)
        require(on_circle, "station_azimuths", "one or more", ())
        x0, x1, y0, y1 = self.area
        room = min(x1 - x0, y1 - y0) > 2 * self.margin
        require(
            room, "area", f"x_min < x_max, y_min < y_max, wider than {2 * self.margin:g}", self.area
        )
        needed = self.scan_time * (1 - SLACK)
        rule = f"at least {needed:.4g} s, in which {len(self.azimuth_axis)} directions are scanned"
        require(self.dt >= needed, "dt", rule, self.dt)
        require(self.engine in ENGINES, "engine", " or ".join(ENGINES), self.engine)
        for name, needed in (("lanes", self.vehicles), ("crosswalks", self.pedestrians)):
            lines = getattr(self, name)
            ok = isinstance(lines, dict) and all(_is_line(line) for line in lines.values())
            require(ok, name, "names with x0, y0, x1, y1 of two points each", lines)
            require(bool(lines) or not needed, name, "one or more for those who use them", lines)

    @property
    def time_ns(self) -> Array:
        """Times of the scans (scans,)."""
        time: Array = np.rint(np.arange(1, self.scans + 1) * self.dt * 1e9).astype(np.int64)
        return time

    @property
    def poses(self) -> Array:
        """x, y, z [m] and yaw [rad] of the stations (S, 4)."""
        if self.stations:
            x, y, yaw = np.array(self.stations).T
        else:
            azimuth = np.array(self.station_azimuths)
            x, y = self.station_radius * np.array([np.cos(azimuth), np.sin(azimuth)])
            yaw = azimuth + np.pi
        return np.stack((x, y, np.full(len(x), self.station_height), yaw), 1)

    @property
    def halves(self) -> Array:
        """Half the length and width (2, 2) [m] of a pedestrian and of a vehicle."""
        r = self.pedestrian_radius
        return np.array([[r, r], [self.vehicle_length / 2, self.vehicle_width / 2]])

    @property
    def bodies(self) -> list[Reflectors]:
        """Reflectors of a pedestrian and of a vehicle."""
        car = vehicle(
            self.vehicle_length,
            self.vehicle_width,
            (self.rcs_surface, self.rcs_wheelhouse, self.rcs_corner),
            self.surface_visibility,
            self.wheelhouse_visibility,
            self.corner_visibility,
        )
        return [pedestrian(self.rcs_pedestrian), car]


def _is_line(ends: object) -> bool:
    try:
        a = np.asarray(ends, float)
    except (TypeError, ValueError):
        return False
    return a.shape == (4,) and bool(np.isfinite(a).all()) and bool((a[:2] != a[2:]).any())


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """Classes (n,), states x y vx vy (n, scans, 4) and headings (n, scans) of targets.

    ``scale`` (n, 2) is their length and width over those stated.
    """

    kind: Array
    state: Array
    heading: Array
    scale: Array


def simulate(params: Params, rng: np.random.Generator, name: str) -> Recording:
    """A recording of the scene with its truth, called ``name``."""
    return recorded(params, _targets(params, rng), rng, name)


def recorded(params: Params, targets: Targets, rng: np.random.Generator, name: str) -> Recording:
    """What the stations see of ``targets``, with these as the truth."""
    none = np.zeros(params.scans + 1, np.int64)
    later = np.arange(len(params.poses)) * round(params.stagger * 1e9)
    sensors, streams = {}, {}
    for q, (pose, lag) in enumerate(zip(params.poses, later.tolist(), strict=True)):
        node, where, yaw = f"S{q}", pose[:3], pose[3:]
        still = Sensor.static("radar", where)
        sensors[node] = Sensor("radar", still.time_ns, still.position, yaw_quaternion(yaw))
        maps = np.empty((params.scans, len(params.range_axis), len(params.azimuth_axis)), "f4")
        state = _after(targets.state, lag)
        for k in range(params.scans):
            there = replace(targets, state=state[:, k], heading=targets.heading[:, k])
            seen = echoes(params, there, where, float(yaw[0]), rng)
            user = rng.uniform(-params.aperture, params.aperture)
            maps[k] = ENGINES[params.engine](params, seen, user, params.noisy, rng)
        model, time_ns = _model(params, where[:2], float(yaw[0])), params.time_ns + lag
        streams[node] = Stream("range_angle_map", (node,), model, time_ns, none, {"map": maps}, {})
    mean = int(later.sum()) // len(later)
    truth = _truth(params, replace(targets, state=_after(targets.state, mean)), mean)
    return Recording(Meta(name), sensors, streams, Truth(truth))


def _after(state: Array, lag: int) -> Array:
    """States (n, T, 4) by ``lag`` [ns] later, straight on."""
    later = state.copy()
    later[..., :2] += state[..., 2:] * (lag / 1e9)
    return later


def _model(params: Params, where: Array, facing: float) -> dict[str, Any]:
    """What the stream of a station states: waveform, axes, power, site plan."""
    return {
        "range_axis": params.range_axis,
        "azimuth_axis": params.azimuth_axis,
        "reference_echo": reference_echo(params, seen_from(params, where, facing)),
        "noise_power": 1.0,
        "map_region": list(params.area),
        "birth_components": births(params),
        **{key: getattr(params, key) for key in BaseStation.__match_args__},
    }


def seen_from(params: Params, where: Array, facing: float) -> float:
    """Distance [m] from a station to the middle of what it sees of the area, or of all of it."""
    x0, x1, y0, y1 = params.area
    share = (np.arange(64) + 0.5) / 64
    points = np.stack(np.meshgrid(x0 + (x1 - x0) * share, y0 + (y1 - y0) * share), -1).reshape(
        -1, 2
    )
    d = points - where
    off = np.arctan2(d[:, 1], d[:, 0]) - facing
    off -= 2 * np.pi * np.round(off / (2 * np.pi))
    seen = (np.abs(off) <= params.aperture) & (np.hypot(*d.T) <= params.max_range)
    middle = points[seen].mean(0) if seen.any() else points.mean(0)
    return float(np.hypot(*(middle - where)))


def births(params: Params) -> Array:
    """Places where targets may be (B, 9): weight, x y vx vy, their standard deviations."""
    std = np.full(4, np.sqrt(params.birth_variance))
    rows = []
    for lines, speed in (
        (params.lanes, np.mean(params.vehicle_speed)),
        (params.crosswalks, 0.0),
    ):
        for line in map(Line.of, lines.values()):
            for p in line.points(params.birth_spacing):
                rows.append(np.concatenate(([params.birth_weight], p, speed * line.u, std)))
    wide = np.full(4, np.sqrt(params.recovery_variance))
    x0, x1, y0, y1 = params.area
    centre = (x0 + x1) / 2, (y0 + y1) / 2, 0.0, 0.0
    rows.append(np.concatenate(([params.birth_weight], centre, wide)))
    return np.array(rows)


def echoes(
    params: Params, targets: Targets, where: Array, facing: float, rng: np.random.Generator
) -> Echoes:
    """The echoes of targets at a station, at ``where`` (3,) facing ``facing``, in a scan.

    Their states are (n, 4) and headings (n,).
    """
    if not len(targets.kind):
        none = np.zeros(0)
        return Echoes(none, none, none, none.astype(complex))
    position, velocity, rcs = [], [], []
    columns = targets.kind, targets.state, targets.heading, targets.scale
    for kind, x, h, scale in zip(*columns, strict=True):
        body = params.bodies[kind]
        c, s = np.cos(h), np.sin(h)
        sight = np.arctan2(*(where[:2] - x[:2])[::-1]) - h
        position.append(x[:2] + scale * body.position @ np.array([[c, s], [-s, c]]))
        velocity.append(np.tile(x[2:], (len(body.rcs), 1)))
        rcs.append(body.rcs * visibility(body, sight))
    p, v, mean = np.concatenate(position), np.concatenate(velocity), np.concatenate(rcs)
    swerling = mean * rng.exponential(size=len(mean))
    phase = np.exp(2j * np.pi * rng.random(len(mean)))
    seen = mean > 0
    d = p - where[:2]
    distance, azimuth = space(d, facing, where[2])
    speed = (d * v).sum(1) / distance
    beta = path_gain(params, distance, swerling) * phase
    front = seen & (np.abs(azimuth) < np.pi / 2)
    return Echoes(distance[front], azimuth[front], speed[front], beta[front])


def _targets(params: Params, rng: np.random.Generator) -> Targets:
    """Targets that keep to their lines."""
    kinds = np.repeat([0, 1], [params.pedestrians, params.vehicles])
    scale = np.ones((len(kinds), 2))
    if any(params.vehicle_spread):
        spread = rng.normal(size=(params.vehicles, 2)) * params.vehicle_spread
        scale[params.pedestrians :] = np.exp(spread)
    ways = [
        partial(Walker, params.crosswalks, params.pedestrian_speed, params.pedestrian_turn),
        partial(Walker, params.lanes, params.vehicle_speed, params.vehicle_turn),
    ]
    halves = params.halves[kinds] * scale
    order = np.argsort(-kinds, kind="stable")
    t = params.time_ns / 1e9
    if not len(kinds):
        return Targets(kinds, np.zeros((0, len(t), 4)), np.zeros((0, len(t))), scale)
    x0, x1, y0, y1 = params.area
    m = params.margin
    inside = x0 + m, x1 - m, y0 + m, y1 - m
    walkers = [ways[kinds[i]](tuple(halves[i].tolist())) for i in order]
    state, heading = draw(walkers, t, inside, params.clearance, rng)
    back = np.argsort(order)
    return Targets(kinds, state[back], heading[back], scale)


def _truth(params: Params, targets: Targets, lag: int) -> Objects:
    """The targets as truth, at times that come by ``lag`` [ns] later than those of the scans."""
    n, T = targets.state.shape[:2]
    return Objects(
        params.time_ns + lag,
        np.arange(T + 1, dtype=np.int64) * n,
        np.tile(np.arange(n, dtype=np.int64), T),
        ("x", "y", "vx", "vy"),
        ("m", "m", "m s-1", "m s-1"),
        targets.state.swapaxes(0, 1).reshape(n * T, 4),
        class_names=CLASSES,
        class_index=np.tile(targets.kind, T).astype(np.int64),
        extent_kind="rectangle",
        semi_axes=np.tile(params.halves[targets.kind] * targets.scale, (T, 1)),
        rotation=targets.heading.T.reshape(n * T),
    )

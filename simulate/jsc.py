"""Base stations watch pedestrians and vehicles at a crossing with their OFDM waveform.

The scene of E. Favarelli et al., "Multi-base station cooperative sensing with AI-aided tracking",
section IV-B; what the paper leaves open is marked as a choice. Every station makes a range-angle
map in every scan; targets stand still while it is made. A scatterer's cross section is exponential
(Swerling I), drawn for every scan and station, its phase uniform. The recording states the site
plan, places on lanes and crosswalks where targets may be, for estimators as births.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..models.parameters import parameter, require
from ..models.poses import yaw_quaternion
from ..models.radar.multibeam import BaseStation, Echoes, path_gain
from ..models.radar.reflectors import Reflectors, pedestrian, vehicle, visibility
from ..models.records import Array, Meta, Objects, Recording, Sensor, Stream, Truth
from . import spectral, waveform
from .traffic import Line, Walker, draw

SUMMARY = "base stations that sense by OFDM: range-angle maps of pedestrians and vehicles"
CLASSES = ("pedestrian", "vehicle")
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
    station_azimuths: tuple[float, ...] = parameter(
        tuple(np.pi / 3 * k for k in (0, 2, 4, 1, 3, 5)),
        "rad",
        "where stations S0, S1, ... stand on their circle, facing its centre; order is a choice: "
        "the first so many surround the area",
    )
    engine: str = parameter("spectral", "1", "spectral: the map by its law; waveform: by symbols")
    noisy: bool = parameter(True, "1", "with receiver noise")
    pedestrians: int = parameter(4, "1", "number of pedestrians", within="[0, inf)")
    vehicles: int = parameter(4, "1", "number of vehicles", within="[0, inf)")
    lanes: Any = parameter({}, "m", "lanes by name: x0, y0, x1, y1 in the direction of travel")
    crosswalks: Any = parameter({}, "m", "crosswalks by name: x0, y0, x1, y1")
    half_width: float = parameter(
        19.0, "m", "centres stay within this of both axes, choice", within="(0, inf)"
    )
    clearance: float = parameter(
        1.0, "m", "least gap between two objects, choice", within="[0, inf)"
    )
    vehicle_speed: tuple[float, float] = parameter((1.0, 3.5), "m s-1", "range, choice")
    pedestrian_speed: tuple[float, float] = parameter((0.5, 1.5), "m s-1", "range, choice")
    vehicle_turn: tuple[float, float] = parameter((5.0, 8.0), "m", "range of radii, choice")
    pedestrian_turn: tuple[float, float] = parameter((1.0, 2.0), "m", "range of radii, choice")
    vehicle_length: float = parameter(4.5, "m", "length of a vehicle, choice", within="(0, inf)")
    vehicle_width: float = parameter(1.8, "m", "width of a vehicle, choice", within="(0, inf)")
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
        require(bool(self.station_azimuths), "station_azimuths", "one or more", ())
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


def simulate(params: Params, rng: np.random.Generator, name: str) -> Recording:
    """A recording of the scene with its truth, called ``name``."""
    kinds, state, heading = _targets(params, rng)
    model: dict[str, Any] = {
        "range_axis": params.range_axis,
        "azimuth_axis": params.azimuth_axis,
        "birth_components": births(params),
        **{key: getattr(params, key) for key in BaseStation.__match_args__},
    }
    time_ns, none = params.time_ns, np.zeros(params.scans + 1, np.int64)
    sensors, streams = {}, {}
    for q, azimuth in enumerate(params.station_azimuths):
        node = f"S{q}"
        where = params.station_radius * np.array([np.cos(azimuth), np.sin(azimuth)])
        facing = azimuth + np.pi
        still = Sensor.static("radar", where)
        sensors[node] = Sensor(
            "radar", still.time_ns, still.position, yaw_quaternion(np.array([facing]))
        )
        maps = np.empty((params.scans, len(params.range_axis), len(params.azimuth_axis)), "f4")
        for k in range(params.scans):
            seen = echoes(params, kinds, state[:, k], heading[:, k], where, facing, rng)
            user = rng.uniform(-params.aperture, params.aperture)
            maps[k] = ENGINES[params.engine](params, seen, user, params.noisy, rng)
        streams[node] = Stream("range_angle_map", (node,), model, time_ns, none, {"map": maps}, {})
    return Recording(Meta(name), sensors, streams, Truth(_truth(params, kinds, state, heading)))


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
    rows.append(np.concatenate(([params.birth_weight], np.zeros(4), wide)))
    return np.array(rows)


def echoes(
    params: Params,
    kinds: Array,
    state: Array,
    heading: Array,
    where: Array,
    facing: float,
    rng: np.random.Generator,
) -> Echoes:
    """The echoes of targets (n, 4) at a station at ``where`` facing ``facing``, in one scan."""
    position, velocity, rcs = [], [], []
    for kind, x, h in zip(kinds, state, heading, strict=True):
        body = params.bodies[kind]
        c, s = np.cos(h), np.sin(h)
        sight = np.arctan2(*(where - x[:2])[::-1]) - h
        position.append(x[:2] + body.position @ np.array([[c, s], [-s, c]]))
        velocity.append(np.tile(x[2:], (len(body.rcs), 1)))
        rcs.append(body.rcs * visibility(body, sight))
    p, v, mean = np.concatenate(position), np.concatenate(velocity), np.concatenate(rcs)
    swerling = mean * rng.exponential(size=len(mean))
    phase = np.exp(2j * np.pi * rng.random(len(mean)))
    seen = mean > 0
    d = p - where
    distance = np.hypot(*d.T)
    azimuth = np.arctan2(d[:, 1], d[:, 0]) - facing
    azimuth -= 2 * np.pi * np.round(azimuth / (2 * np.pi))
    speed = (d * v).sum(1) / distance
    beta = path_gain(params, distance, swerling) * phase
    front = seen & (np.abs(azimuth) < np.pi / 2)
    return Echoes(distance[front], azimuth[front], speed[front], beta[front])


def _targets(params: Params, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Classes (n,), states (n, scans, 4) and headings (n, scans)."""
    kinds = np.repeat([0, 1], [params.pedestrians, params.vehicles])
    half_diagonal = np.hypot(params.vehicle_length, params.vehicle_width) / 2
    walkers = [
        Walker(
            params.crosswalks,
            params.pedestrian_speed,
            params.pedestrian_turn,
            params.pedestrian_radius,
        ),
        Walker(params.lanes, params.vehicle_speed, params.vehicle_turn, half_diagonal),
    ]
    order = np.argsort(-kinds, kind="stable")
    t = params.time_ns / 1e9
    if not len(kinds):
        return kinds, np.zeros((0, len(t), 4)), np.zeros((0, len(t)))
    state, heading = draw(
        [walkers[kinds[i]] for i in order], t, params.half_width, params.clearance, rng
    )
    back = np.argsort(order)
    return kinds, state[back], heading[back]


def _truth(params: Params, kinds: Array, state: Array, heading: Array) -> Objects:
    n, T = state.shape[:2]
    axes = np.array(
        [
            [params.pedestrian_radius, params.pedestrian_radius],
            [params.vehicle_length / 2, params.vehicle_width / 2],
        ]
    )
    return Objects(
        params.time_ns,
        np.arange(T + 1, dtype=np.int64) * n,
        np.tile(np.arange(n, dtype=np.int64), T),
        ("x", "y", "vx", "vy"),
        ("m", "m", "m s-1", "m s-1"),
        state.swapaxes(0, 1).reshape(n * T, 4),
        class_names=CLASSES,
        class_index=np.tile(kinds, T).astype(np.int64),
        extent_kind="rectangle",
        semi_axes=np.tile(axes[kinds], (T, 1)),
        rotation=heading.T.reshape(n * T),
    )

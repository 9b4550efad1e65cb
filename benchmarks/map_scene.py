"""Range-angle maps of base stations about a square, drawn analytically, and a classifier for them.

Blobs of the width of a beam and a range bin stand where scatterers do; noise is exponential. No
physics: what the chain makes of the maps can be told from what was drawn.
"""

from __future__ import annotations

import numpy as np

from echoset.models.classifier import SHAPES, Weights
from echoset.models.geometry.poses import yaw_quaternion
from echoset.models.records import Array, Meta, Recording, Sensor, Stream

RANGE, AZIMUTH = np.arange(218) * 0.39, np.deg2rad(np.arange(-60, 60.1, 2.4))
SCAN = 50_000_000
"""Time from scan to scan [ns]."""
PEDESTRIAN = np.array([[0.0, 0.0]])
VEHICLE = np.array([[2.2, 0.9], [2.2, -0.9], [-2.2, 0.9], [-2.2, -0.9], [0.0, 0.9], [0.0, -0.9]])
POWER = 5000.0


def station(k: int, count: int) -> Sensor:
    """The ``k``-th of ``count`` stations on a circle of 50 m, which looks at the middle."""
    angle = 2 * np.pi * k / count
    p = 50.0 * np.array([[np.cos(angle), np.sin(angle), 0.0]])
    quaternion = yaw_quaternion(np.array([angle + np.pi]))
    return Sensor("radar", np.zeros(1, np.int64), p, quaternion)


def power(sensor: Sensor, points: Array, rng: np.random.Generator) -> Array:
    """The map (n_range, n_azimuth) of scatterers at ``points`` (n, 2), float32."""
    p = sensor.position[0, :2]
    yaw = 2 * np.arctan2(sensor.quaternion[0, 2], sensor.quaternion[0, 3])
    v = points - p
    r, a = np.hypot(*v.T), np.arctan2(v[:, 1], v[:, 0]) - yaw
    a -= 2 * np.pi * np.round(a / (2 * np.pi))
    along = np.exp(-0.5 * ((RANGE - r[:, None]) / 0.25) ** 2)
    across = np.exp(-0.5 * ((AZIMUTH - a[:, None]) / np.deg2rad(1.0)) ** 2)
    noise = rng.exponential(size=(len(RANGE), len(AZIMUTH)))
    return (noise + POWER * along.T @ across).astype(np.float32)


def recording(
    tracks: Array, shapes: list[Array], count: int, rng: np.random.Generator, births: Array
) -> Recording:
    """Maps of ``count`` stations s0, s1, ... of targets at ``tracks`` (scans, targets, 2)."""
    time_ns = np.arange(len(tracks), dtype=np.int64) * SCAN
    none = np.zeros(len(tracks) + 1, np.int64)
    sensors = {f"s{k}": station(k, count) for k in range(count)}
    model = {"range_axis": RANGE, "azimuth_axis": AZIMUTH, "birth_components": births}
    streams = {}
    for name, sensor in sensors.items():
        maps = [
            power(sensor, np.vstack([x + s for x, s in zip(where, shapes, strict=True)]), rng)
            for where in tracks
        ]
        scan = {"map": np.stack(maps)}
        streams[name] = Stream("range_angle_map", (name,), model, time_ns, none, scan, {})
    return Recording(Meta("maps"), sensors, streams)


def classifier(area: float = 20.0, power: float = 400.0) -> Weights:
    """Weights by hand: a vehicle has more than ``area`` [m^2] of pixels above ``power``.

    The first filter passes the middle pixel, as far as it is above the threshold; its maxima over
    2 x 2 pixels are counted by their excess, about half a decade each. It suits three stations.
    """
    a = {name: np.zeros(shape, np.float32) for name, shape in SHAPES.items()}
    a["conv_weight"][0, 0, 2, 2] = 1.0
    a["conv_bias"][0] = -np.log10(1 + power)
    count = a["fc_weight"].shape[1] // len(a["conv_bias"])
    a["fc_weight"][1, :count] = 0.2 * 0.04 / 0.5
    a["fc_bias"][1] = -0.2 * area
    return Weights(**{k: v for k, v in a.items() if k not in ("mean", "std")})

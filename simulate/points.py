"""Point targets seen by one radar: detections lost at random, noisy, and among clutter.

Shared by the scenarios that differ in how targets move: ``crossing``, ``meeting``, ``many`` and
``moving-platform``. Step k, from 1, is at k dt. Detections of a scan stand in random order.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from math import pi

import numpy as np

from ..models.geometry.poses import yaw_quaternion
from ..models.parameters import parameter, require
from ..models.radar.detection import View, polar
from ..models.records import Array, Meta, Objects, Recording, Sensor, Stream, Truth


@dataclass(frozen=True, slots=True)
class Scans:
    """How many scans there are, and what they find."""

    steps: int = parameter(100, "1", "number of scans", within="[1, inf)")
    dt: float = parameter(1.0, "s", "time between scans; scan k is at k dt", within="(0, inf)")
    p_detect: float = parameter(0.95, "1", "probability that a target is detected", within="[0, 1]")
    clutter_rate: float = parameter(20.0, "1", "expected false alarms per scan", within="[0, inf)")

    @property
    def time_ns(self) -> Array:
        """Times of the scans (steps,)."""
        time: Array = np.rint(np.arange(1, self.steps + 1) * self.dt * 1e9).astype(np.int64)
        return time


@dataclass(frozen=True, slots=True)
class Positions(Scans):
    """Scans of positions from a radar at rest at the origin."""

    clutter_region: tuple[float, float, float, float] = parameter(
        (-600.0, 600.0, -600.0, 600.0), "m", "x_min, x_max, y_min, y_max of the false alarms"
    )
    std_position: float = parameter(5.0, "m", "standard deviation of x and of y", within="[0, inf)")

    def __post_init__(self) -> None:
        x_min, x_max, y_min, y_max = self.clutter_region
        ok = x_min < x_max and y_min < y_max
        require(ok, "clutter_region", "x_min < x_max and y_min < y_max", self.clutter_region)


@dataclass(frozen=True, slots=True)
class Bearings(Scans):
    """Scans of ranges and bearings in the sector that a radar looks at."""

    std_range: float = parameter(3.0, "m", "standard deviation of the range", within="[0, inf)")
    std_azimuth: float = parameter(
        0.01, "rad", "standard deviation of the azimuth", within="[0, inf)"
    )
    max_range: float = parameter(800.0, "m", "the farthest the radar sees", within="(0, inf)")
    opening_angle: float = parameter(2 * pi, "rad", "angle of the sector about the sensor's x axis")

    def __post_init__(self) -> None:
        angle = self.opening_angle
        require(0 < angle <= 2 * pi, "opening_angle", "in (0, 2 pi]", angle)


def positions(
    params: Positions, targets: Objects, rng: np.random.Generator, name: str
) -> Recording:
    """The recording of ``targets``, whose times are those of the scans, by their positions."""
    step, row = _detected(params, targets, rng)
    z = targets.state[row, :2] + params.std_position * rng.normal(size=(len(row), 2))
    false = _clutter(params, rng)
    x_min, x_max, y_min, y_max = params.clutter_region
    z_false = rng.uniform((x_min, y_min), (x_max, y_max), (len(false), 2))
    x, y = np.vstack((z, z_false)).T
    origin = _origin(targets.label[row], len(false))
    index, offset = _shuffled(np.concatenate((step, false)), params.steps, rng)
    rows = {key: v[index] for key, v in {"x": x, "y": y, "origin_id": origin}.items()}
    model = {k: getattr(params, k) for k in ("p_detect", "clutter_rate", "std_position")}
    model["clutter_region"] = list(params.clutter_region)
    stream = Stream("position", ("radar",), model, targets.time_ns, offset, {}, rows)
    sensors = {"radar": Sensor.static("radar", np.zeros(2))}
    return Recording(Meta(name), sensors, {"radar": stream}, Truth(targets))


def bearings(
    params: Bearings, targets: Objects, pose: Array, rng: np.random.Generator, name: str
) -> Recording:
    """The recording of ``targets`` from ``pose`` (steps, 3): x, y [m] and yaw [rad] at each scan.

    A target is seen if it and what is measured of it are in the sector; clutter is uniform over
    the sector in range and azimuth.
    """
    step, row = _detected(params, targets, rng)
    half = params.opening_angle / 2
    view = View(-half, half, 0.0, params.max_range)
    r, bearing = polar(targets.state[row, :2] - pose[step, :2])
    azimuth = bearing - pose[step, 2]
    noise = rng.normal(size=(2, len(row)))
    z = np.stack((r + params.std_range * noise[0], azimuth + params.std_azimuth * noise[1]))
    seen = view.contains(r, azimuth) & view.contains(*z)
    z[1] = (z[1] + pi) % (2 * pi) - pi
    false = _clutter(params, rng)
    z_false = rng.uniform((0.0, -half), (params.max_range, half), (len(false), 2))
    measured = np.vstack((z.T[seen], z_false))
    origin = _origin(targets.label[row[seen]], len(false))
    index, offset = _shuffled(np.concatenate((step[seen], false)), params.steps, rng)
    columns = {"range": measured[:, 0], "azimuth": measured[:, 1], "origin_id": origin}
    rows = {key: v[index] for key, v in columns.items()}
    names = ("p_detect", "clutter_rate", "std_range", "std_azimuth", "max_range")
    model = {key: getattr(params, key) for key in names}
    scan = {f"view_{k}": np.full(params.steps, v) for k, v in asdict(view).items()}
    stream = Stream("range_bearing", ("radar",), model, targets.time_ns, offset, scan, rows)
    position = np.column_stack((pose[:, :2], np.zeros(params.steps)))
    radar = Sensor("radar", targets.time_ns, position, yaw_quaternion(pose[:, 2]))
    return Recording(Meta(name), {"radar": radar}, {"radar": stream}, Truth(targets))


def _detected(params: Scans, targets: Objects, rng: np.random.Generator) -> tuple[Array, Array]:
    """Steps and rows of the targets that are not missed."""
    row = np.flatnonzero(rng.random(len(targets.label)) < params.p_detect)
    step = np.repeat(np.arange(params.steps), np.diff(targets.row_offset))
    return step[row], row


def _clutter(params: Scans, rng: np.random.Generator) -> Array:
    """The step of each false alarm."""
    return np.repeat(np.arange(params.steps), rng.poisson(params.clutter_rate, params.steps))


def _origin(label: Array, false: int) -> Array:
    return np.concatenate((label, np.full(false, -1))).astype(np.int32)


def _shuffled(step: Array, steps: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Order of detections by step, random within it, and the offsets of the steps."""
    order = np.lexsort((rng.random(len(step)), step))
    return order, np.searchsorted(step[order], np.arange(steps + 1)).astype(np.int64)

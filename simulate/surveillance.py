"""Groups of targets cross a scene from west to east under a radar that sees a part at a time.

The scene of M. Andrecki et al., "Sensor management with regional statistics for the PHD filter",
section IV. The radar looks into one of its views at each step; who chooses is not said here. All
random numbers are drawn beforehand and do not depend on the views, so that runs with other choices
but the same generator share their targets, misses, noise and clutter.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, radians

import numpy as np

from ..models.geometry.poses import pose_at, yaw_quaternion
from ..models.motion import constant_velocity
from ..models.parameters import parameter, require
from ..models.radar.detection import View, polar
from ..models.records import Array, Objects, Sensor

GROUPS = ("single", "waves")


@dataclass(frozen=True, slots=True)
class Params:
    """Scene, groups of targets, and radar."""

    steps: int = parameter(250, "1", "number of scans", within="[1, inf)")
    dt: float = parameter(1.0, "s", "time between scans; scan k is at k dt", within="(0, inf)")
    scene: tuple[float, float, float, float] = parameter(
        (0.0, 1000.0, 0.0, 400.0), "m", "x_min, x_max, y_min, y_max; who leaves it is gone"
    )
    groups: str = parameter("single", "1", "one group, or waves at random intervals", within=GROUPS)
    mean_size: float = parameter(15.0, "1", "mean number of targets in a group", within="[0, inf)")
    first_step: int = parameter(
        10, "1", "step at which the first group appears, from 1", within="[1, inf)"
    )
    interval: tuple[float, float] = parameter(
        (40.0, 90.0), "s", "least and greatest time between waves"
    )
    birth_y: tuple[float, float] = parameter((100.0, 300.0), "m", "part of the west edge")
    speed: float = parameter(5.0, "m s-1", "mean speed to the east", within="(0, inf)")
    speed_spread: float = parameter(
        0.1, "1", "greatest relative deviation of a target's speed", within="[0, inf)"
    )
    std_acceleration: float = parameter(
        0.01, "m s-2", "white acceleration, constant over a step", within="[0, inf)"
    )
    radar: tuple[float, float] = parameter((500.0, 700.0), "m", "position; it faces south")
    views: tuple[tuple[float, float], ...] = parameter(
        ((-45.0, -18.4), (-14.0, 14.0), (18.4, 45.0)),
        "deg",
        "first and last azimuth of each view, anticlockwise from south",
    )
    view_range: tuple[float, float] = parameter((300.0, 730.0), "m", "ranges of the views")
    p_detect: float = parameter(0.6, "1", "probability of detection in the view", within="[0, 1]")
    clutter_rate: float = parameter(
        1.0,
        "1",
        "expected false alarms per scan, uniform in range and azimuth over the view",
        within="[0, inf)",
    )
    std_range: float = parameter(12.0, "m", "standard deviation of the range", within="(0, inf)")
    std_azimuth: float = parameter(
        radians(2.86), "rad", "standard deviation of the azimuth", within="(0, inf)"
    )

    def __post_init__(self) -> None:
        x_min, x_max, y_min, y_max = self.scene
        require(x_min < x_max and y_min < y_max, "scene", "a box", self.scene)
        low, high = self.birth_y
        require(y_min <= low <= high <= y_max, "birth_y", "a part of the edge", self.birth_y)
        near, far = self.view_range
        require(0 <= near < far, "view_range", "0 <= nearest < farthest", self.view_range)
        shortest, longest = self.interval
        require(0 < shortest <= longest, "interval", "0 < least <= greatest", self.interval)
        ok = len(self.views) > 0 and all(a < b <= a + 360 for a, b in self.views)
        require(ok, "views", "one or more pairs first < last", self.views)

    @property
    def time_ns(self) -> Array:
        """Times of the scans (steps,)."""
        return np.asarray(np.rint(np.arange(1, self.steps + 1) * self.dt * 1e9), np.int64)

    def view(self, index: int) -> View:
        """The view ``index``."""
        first, last = self.views[index]
        return View(radians(first), radians(last), *self.view_range)

    def sensor(self) -> Sensor:
        """The radar, whose x axis points south."""
        position = np.array([[*self.radar, 0.0]])
        return Sensor("radar", np.zeros(1, np.int64), position, yaw_quaternion(np.array([-pi / 2])))


def targets(params: Params, rng: np.random.Generator) -> Objects:
    """The targets at every scan."""
    x_min, x_max, y_min, y_max = params.scene
    low, high = np.array([x_min, y_min]), np.array([x_max, y_max])
    F, G = constant_velocity(params.dt)
    starts = _starts(params, rng)
    x, label = np.zeros((0, 4)), np.zeros(0, np.int64)
    states, labels, used = [], [], 0
    for k in range(1, params.steps + 1):
        x = x @ F.T + params.std_acceleration * rng.normal(size=(len(x), 2)) @ G.T
        stays = ((low <= x[:, :2]) & (x[:, :2] <= high)).all(1)
        size = rng.poisson(params.mean_size) if k in starts else 0
        speed = params.speed * (1 + params.speed_spread * rng.uniform(-1, 1, size))
        y = rng.uniform(*params.birth_y, size)
        new = np.column_stack((np.full(size, x_min), y, speed, np.zeros(size)))
        x = np.vstack((x[stays], new))
        label = np.concatenate((label[stays], used + np.arange(size)))
        used += size
        states.append(x)
        labels.append(label)
    return Objects(
        params.time_ns,
        np.cumsum([0, *map(len, labels)]),
        np.concatenate(labels),
        ("x", "y", "vx", "vy"),
        ("m", "m", "m s-1", "m s-1"),
        np.vstack(states),
    )


def _starts(params: Params, rng: np.random.Generator) -> set[int]:
    """Steps at which groups appear."""
    at, found = float(params.first_step), []
    while at <= params.steps:
        found.append(round(at))
        if params.groups == "single":
            break
        at += rng.uniform(*params.interval) / params.dt
    return set(found)


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """Targets and all the random numbers of their detections, whichever view is chosen.

    For each row of ``objects``: ``chance`` (m,) uniform, ``noise`` (m, 2) normal. The false alarms
    ``clutter`` (c, 2) are uniform in the unit square; those of scan k are the rows
    ``clutter_offset[k]:clutter_offset[k + 1]``. ``order`` (m + c,) shuffles the detections.
    """

    objects: Objects
    chance: Array
    noise: Array
    clutter: Array
    clutter_offset: Array
    order: Array


def world(params: Params, rng: np.random.Generator) -> World:
    """Targets and the random numbers of what could be seen of them."""
    objects = targets(params, rng)
    m = len(objects.label)
    count = rng.poisson(params.clutter_rate, params.steps)
    c = int(count.sum())
    offset = np.concatenate(([0], np.cumsum(count)))
    chance, noise = rng.random(m), rng.normal(size=(m, 2))
    return World(objects, chance, noise, rng.random((c, 2)), offset, rng.random(m + c))


def detections(params: Params, world: World, k: int, index: int) -> dict[str, Array]:
    """Columns of the detections of scan ``k``, from 0, in view ``index``."""
    o, view = world.objects, params.view(index)
    seen = np.arange(o.row_offset[k], o.row_offset[k + 1])
    position, rotation = pose_at(params.sensor(), 0)
    local = (o.state[seen, :2] - position[:2]) @ rotation[:2, :2]
    true = np.stack(polar(local), 1)
    hit = view.contains(*true.T) & (world.chance[seen] < params.p_detect)
    row = seen[hit]
    z = true[hit] + world.noise[row] * (params.std_range, params.std_azimuth)
    false = np.arange(world.clutter_offset[k], world.clutter_offset[k + 1])
    span = (view.range_max - view.range_min, view.width)
    z_false = (view.range_min, view.azimuth_min) + world.clutter[false] * span
    key = np.concatenate((world.order[row], world.order[len(o.label) + false]))
    origin = np.concatenate((o.label[row], np.full(len(false), -1))).astype(np.int32)
    order = np.argsort(key, kind="stable")
    distance, azimuth = np.vstack((z, z_false))[order].T
    return {"range": distance, "azimuth": azimuth, "origin_id": origin[order]}

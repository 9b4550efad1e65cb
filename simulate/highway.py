"""Cars on the lanes of both carriageways, seen by a radar on a bridge that looks along the road.

Lanes lie along x, and the cars of one have one speed but for a little noise. The radar measures the
Doppler of every detection; that of clutter is anything.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..models.parameters import parameter, require
from ..models.records import Array, Recording
from . import points
from .targets import objects, step_noise

SUMMARY = "cars on a highway seen along the road, among clutter; range, bearing and Doppler"


@dataclass(frozen=True, slots=True)
class Params(points.Bearings):
    """Scans, road and cars."""

    dt: float = parameter(0.2, "s", "time between scans; scan k is at k dt", within="(0, inf)")
    p_detect: float = parameter(0.9, "1", "probability that a car is detected", within="[0, 1]")
    std_range: float = parameter(1.0, "m", "standard deviation of the range", within="[0, inf)")
    std_azimuth: float = parameter(
        0.02, "rad", "standard deviation of the azimuth", within="[0, inf)"
    )
    max_range: float = parameter(250.0, "m", "the farthest the radar sees", within="(0, inf)")
    opening_angle: float = parameter(2.0, "rad", "angle of the sector about the x axis")
    std_doppler: float = parameter(
        0.2, "m s-1", "standard deviation of the Doppler", within="(0, inf)"
    )
    doppler_max: float = parameter(
        60.0, "m s-1", "Doppler is measured modulo twice that", within="(0, inf)"
    )
    road: tuple[float, float] = parameter(
        (20.0, 240.0), "m", "x where cars come into view, and where they leave it"
    )
    lanes: tuple[float, ...] = parameter((-11.0, -7.5, -4.0), "m", "y of lanes that lead to +x")
    oncoming: tuple[float, ...] = parameter((4.0, 7.5, 11.0), "m", "y of lanes that lead to -x")
    speeds: tuple[float, float] = parameter(
        (22.0, 38.0), "m s-1", "least and greatest of the lanes", within="[0, inf)"
    )
    gap: float = parameter(
        60.0, "m", "mean gap of cars, the least is half of it", within="(0, inf)"
    )
    noise_density: float = parameter(
        0.1, "m2 s-3", "power spectral density of the acceleration along x", within="[0, inf)"
    )

    def __post_init__(self) -> None:
        points.Bearings.__post_init__(self)
        for name in ("road", "speeds"):
            low, high = getattr(self, name)
            require(low <= high, name, "least and greatest", (low, high))


def simulate(params: Params, rng: np.random.Generator, name: str) -> Recording:
    """A recording of the scene with its truth, called ``name``."""
    n = params.steps
    lanes = [*((y, 1.0) for y in params.lanes), *((y, -1.0) for y in params.oncoming)]
    x = np.concatenate([np.zeros((0, 4)), *(_lane(params, y, way, rng) for y, way in lanes)])
    state = np.zeros((n, len(x), 4))
    for k in range(n):
        if k:
            noise = step_noise(params.dt, params.noise_density, len(x), rng) * [1.0, 0.0, 1.0, 0.0]
            x = x + noise + params.dt * np.hstack((x[:, 2:], np.zeros((len(x), 2))))
        state[k] = x
    low, high = params.road
    targets = objects(params.time_ns, (state[:, :, 0] >= low) & (state[:, :, 0] <= high), state)
    found = points.bearings(params, targets, np.zeros((n, 3)), rng, name)
    return _with_doppler(params, found, state, rng)


def _lane(params: Params, y: float, way: float, rng: np.random.Generator) -> Array:
    """States (N, 4) at the start of the cars of a lane that come into view, of one speed."""
    speed, least = way * rng.uniform(*params.speeds), params.gap / 2
    low, high = params.road
    way_back = -speed * params.steps * params.dt
    low, high = low + min(way_back, 0.0) - least, high + max(way_back, 0.0) + least
    x = low + np.cumsum(least + rng.exponential(least, int((high - low) / least)))
    x = x[x < high]
    zero = np.zeros(len(x))
    return np.column_stack((x, zero + y, zero + speed, zero))


def _with_doppler(
    params: Params, recording: Recording, state: Array, rng: np.random.Generator
) -> Recording:
    """The recording with the Doppler of its detections; ``state`` (steps, N, 4) by label."""
    stream, limit = recording.streams["radar"], params.doppler_max
    origin = stream.rows["origin_id"]
    step = np.repeat(np.arange(len(stream)), np.diff(stream.row_offset))
    rate, true = rng.uniform(-limit, limit, len(origin)), origin >= 0
    p, v = np.split(state[step[true], origin[true]], 2, axis=1)
    rate[true] = (p * v).sum(1) / np.hypot(*p.T) + params.std_doppler * rng.normal(size=len(p))
    rows = {**stream.rows, "doppler": (rate + limit) % (2 * limit) - limit}
    model = {**stream.model, "std_doppler": params.std_doppler, "doppler_max": limit}
    return replace(recording, streams={"radar": replace(stream, model=model, rows=rows)})

"""An extended object with a UWB device among anchors: active and passive link events.

The scene of Zhu et al., "Multi-Sensor Fusion of Active and Passive Measurements for Extended
Object Tracking", section V-A. In every step each anchor listens to the device (active links) and
to every anchor, itself included (passive links). A link event holds ranges and amplitudes of the
direct path (active only), of paths over the scatterers that face the receiver, and of clutter. A
blocked active link has no event.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from math import pi, sqrt

import numpy as np
from scipy.interpolate import CubicSpline

from ..models.columns import ACTIVE, PASSIVE
from ..models.parameters import parameter, require
from ..models.records import Array, Meta, Objects, Recording, Sensor, Stream, Truth
from ..models.scatter import sector
from ..models.uwb import at_height, device_position, distance, free_space_amplitude, range_std

SUMMARY = "UWB network around an extended object with a device: active and passive ranges"
LABEL = 0
SENSOR_MODEL = (
    "mean_scatter",
    "mean_clutter",
    "max_range",
    "rms_bandwidth",
    "amplitude_threshold",
    "opening_angle",
    "snr_db",
    "width",
)
"""Parameters that a recording states about its sensors."""


@dataclass(frozen=True, slots=True)
class Params:
    """Scene, object and network."""

    steps: int = parameter(180, "1", "number of time steps", within="[1, inf)")
    dt: float = parameter(0.1, "s", "time between steps; step k is at k dt", within="(0, inf)")
    anchors: tuple[tuple[float, ...], ...] = parameter(
        ((4.0, 4.5), (0.0, 0.5), (6.5, 0.0)),
        "m",
        "positions of the anchors A1, A2, ...: x, y, or x, y, height above the floor",
    )
    device_height: float | None = parameter(
        None, "m", "height of device and object, where anchors have heights", within="[0, inf)"
    )
    path: tuple[tuple[float, float], ...] = parameter(
        ((0.6, 1.2), (1.8, 2.6), (3.2, 3.4), (4.4, 2.6), (4.6, 1.4), (5.4, 0.8), (6.4, 1.6)),
        "m",
        "knots of the cubic spline that the object's centre follows",
    )
    bias_distance: float = parameter(
        0.32, "m", "distance of the device from the centre", within="[0, inf)"
    )
    bias_angle: float = parameter(-pi / 3, "rad", "angle of the device about the centre")
    semi_axes: tuple[float, float] = parameter(
        (0.3, 0.2), "m", "object's semi-axes along x and y", within="(0, inf)"
    )
    width: float = parameter(0.1, "m", "depth of the scattering sector", within="(0, inf)")
    opening_angle: float = parameter(
        2 * pi / 3, "rad", "opening angle of the scattering sector", within="(0, 6.283185307179587]"
    )
    mean_scatter: float = parameter(
        5.0, "1", "mean number of scatter paths per link event", within="[0, inf)"
    )
    mean_clutter: float = parameter(
        5.0, "1", "mean number of false detections per link event", within="[0, inf)"
    )
    max_range: float = parameter(
        20.0, "m", "longest path length; clutter is uniform up to it", within="(0, inf)"
    )
    snr_db: float = parameter(30.0, "dB", "signal-to-noise ratio of a path of one metre")
    rms_bandwidth: float = parameter(
        500e6 / sqrt(12), "Hz", "root mean squared bandwidth", within="(0, inf)"
    )
    amplitude_threshold: float = parameter(
        1.0, "1", "lowest normalised amplitude detected", within="[0, inf)"
    )
    blocked: tuple[tuple[int, int, int], ...] = parameter(
        (), "1", "blocked active links: first step, last step, anchor; all counted from 1"
    )

    def __post_init__(self) -> None:
        require(len(self.anchors) >= 1, "anchors", "at least one position", self.anchors)
        axes = {len(anchor) for anchor in self.anchors}
        require(axes <= {2, 3}, "anchors", "positions of two or three numbers", self.anchors)
        require(len(axes) == 1, "anchors", "all with a height, or none", self.anchors)
        told = (axes == {3}) == (self.device_height is not None)
        require(told, "device_height", "told where anchors have heights", self.device_height)
        moves = len(self.path) >= 2 and all(a != b for a, b in pairwise(self.path))
        require(moves, "path", "two or more points, each unlike the one before", self.path)
        for first, last, anchor in self.blocked:
            ok = 1 <= first <= last and 1 <= anchor <= len(self.anchors)
            require(ok, "blocked", "first step <= last step and an anchor", (first, last, anchor))


def simulate(params: Params, rng: np.random.Generator, name: str) -> Recording:
    """A recording of the scene with its truth, called ``name``."""
    J = len(params.anchors)
    nodes = (*(f"A{j + 1}" for j in range(J)), "D")
    anchors = [Sensor.static("anchor", np.array(a)) for a in params.anchors]
    sensors = dict(zip(nodes, (*anchors, Sensor.device(LABEL)), strict=True))
    x = trajectory(params)
    objects, device = _truth(params, x)

    step, mode, tx, rx = _events(params.steps, J)
    blocked = np.zeros((params.steps + 1, J), bool)
    for first, last, anchor in params.blocked:
        blocked[first : last + 1, anchor - 1] = True
    gone = (mode == ACTIVE) & blocked[step, rx]
    time_ns = np.rint(step * params.dt * 1e9).astype(np.int64)
    truth = Truth(objects, time_ns[gone], tx[gone], rx[gone])
    step, mode, tx, rx, time_ns = (c[~gone] for c in (step, mode, tx, rx, time_ns))

    event, rows = _detections(params, x[step - 1, :2], device[step - 1], mode, tx, rx, rng)
    offset = np.searchsorted(event, np.arange(len(step) + 1)).astype(np.int64)
    model = {key: getattr(params, key) for key in SENSOR_MODEL} | {"mean_los": 1.0}
    if params.device_height is not None:
        model["device_height"] = params.device_height
    scan = {"mode": mode, "tx": tx, "rx": rx}
    uwb = Stream("uwb", nodes, model, time_ns, offset, scan, rows)
    return Recording(Meta(name), sensors, {"uwb": uwb}, truth)


def trajectory(params: Params) -> Array:
    """States x y vx vy (steps, 4) of the centre: the spline walked at constant rate of its chord.

    The first step is at the first knot and the last step at the last.
    """
    knots = np.array(params.path)
    chord = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(knots, axis=0).T))))
    spline = CubicSpline(chord, knots)
    at = np.linspace(0.0, chord[-1], params.steps)
    rate = chord[-1] / (params.dt * max(params.steps - 1, 1))
    return np.hstack((spline(at), rate * spline(at, 1)))


def _truth(params: Params, x: Array) -> tuple[Objects, Array]:
    n = params.steps
    device = device_position(
        x[:, :2], np.full(n, params.bias_distance), np.full(n, params.bias_angle)
    )
    time_ns = np.rint(np.arange(1, n + 1) * params.dt * 1e9).astype(np.int64)
    objects = Objects(
        time_ns,
        np.arange(n + 1, dtype=np.int64),
        np.full(n, LABEL, np.int64),
        ("x", "y", "vx", "vy", "device_x", "device_y"),
        ("m", "m", "m s-1", "m s-1", "m", "m"),
        np.hstack((x, device)),
        extent_kind="ellipse",
        semi_axes=np.tile(params.semi_axes, (n, 1)),
        rotation=np.zeros(n),
    )
    return objects, device


def _events(steps: int, J: int) -> tuple[Array, Array, Array, Array]:
    """Step from 1, mode, transmitter and receiver of all events, in order."""
    active = [(ACTIVE, j, J) for j in range(J)]
    passive = [(PASSIVE, j, i) for j in range(J) for i in range(J)]
    mode, rx, tx = np.array(active + passive).T
    step = np.repeat(np.arange(1, steps + 1), len(mode))
    u1, i4 = np.uint8, np.int32
    columns = (np.tile(mode, steps).astype(u1), np.tile(tx, steps).astype(i4))
    return step, *columns, np.tile(rx, steps).astype(i4)


def _detections(
    params: Params,
    centre: Array,
    device: Array,
    mode: Array,
    tx: Array,
    rx: Array,
    rng: np.random.Generator,
) -> tuple[Array, dict[str, Array]]:
    """Event index, in order, and columns of what is detected; centre and device (events, 2)."""
    n = len(mode)
    anchors = np.array(params.anchors)
    if params.device_height is not None:
        device = at_height(device, params.device_height)
    a_rx = anchors[rx]
    a_tx = np.where((mode == ACTIVE)[:, None], device, anchors[np.minimum(tx, len(anchors) - 1)])

    los = np.flatnonzero(mode == ACTIVE)
    hit = np.repeat(np.arange(n), rng.poisson(params.mean_scatter, n))
    u, s = rng.random((2, len(hit)))
    axes = np.array(params.semi_axes)
    q = sector(u, s, centre[hit], a_rx[hit, :2], axes, params.width, params.opening_angle)
    if params.device_height is not None:
        q = at_height(q, params.device_height)
    path = np.concatenate(
        (distance(device[los], a_rx[los]), distance(a_tx[hit], q) + distance(q, a_rx[hit]))
    )
    amplitude = free_space_amplitude(path, params.snr_db)
    noise = rng.normal(size=(3, len(path)))
    measured = path + range_std(amplitude, params.rms_bandwidth) * noise[0]
    received = np.hypot(amplitude + noise[1] * sqrt(0.5), noise[2] * sqrt(0.5))

    false = np.repeat(np.arange(n), rng.poisson(params.mean_clutter, n))
    k = len(false)
    threshold = params.amplitude_threshold
    event = np.concatenate((los, hit, false))
    rows = {
        "distance": np.concatenate((measured, rng.uniform(0.0, params.max_range, k))),
        "amplitude": np.concatenate((received, np.sqrt(threshold**2 + rng.exponential(size=k)))),
        "origin_id": np.repeat(np.array([LABEL, -1], np.int32), (len(path), k)),
        "origin_los": np.repeat(np.array([1, 0], np.uint8), (len(los), len(hit) + k)),
        "origin_x": np.concatenate((device[los, 0], q[:, 0], np.full(k, np.nan))),
        "origin_y": np.concatenate((device[los, 1], q[:, 1], np.full(k, np.nan))),
    }
    d = rows["distance"]
    detected = (rows["amplitude"] >= threshold) & (d >= 0) & (d <= params.max_range)
    seen = np.flatnonzero(detected)
    seen = seen[np.lexsort((rng.random(len(seen)), event[seen]))]
    return event[seen], {key: values[seen] for key, values in rows.items()}

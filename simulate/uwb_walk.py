"""A robot walks a grid of streets among eight anchors, with odometry and ranges of ill repute.

The kind of scene on which batch and window estimators of positions are compared: a step of one
metre a second, ranges to all anchors at every step, and noise that is not Gaussian. It is
*heavy-tailed* (one range in five has much wider noise), *multimodal* (one in five takes a longer
path) or *skewed* (one in five has an exponential delay). Odometry tells velocity and turn rate;
the robot turns on the spot after each step. Ranges can also be told as differences (TDOA).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from ..models.columns import ACTIVE, TDOA
from ..models.parameters import parameter
from ..models.records import Array, Meta, Objects, Recording, Sensor, Stream, Truth

SUMMARY = "robot on a grid among anchors: odometry, ranges or differences with noise not Gaussian"
TURNS = (0.0, pi / 2, -pi / 2, pi)
"""Turns at a corner, equally probable."""
NOISES = ("gaussian", "heavy-tailed", "multimodal", "skewed")


@dataclass(frozen=True, slots=True)
class Params:
    """Walk, anchors, ranges and odometry."""

    steps: int = parameter(3500, "1", "number of positions, one a step", within="[2, inf)")
    dt: float = parameter(1.0, "s", "time between steps", within="(0, inf)")
    step: float = parameter(1.0, "m", "length of a step", within="(0, inf)")
    block: int = parameter(4, "1", "steps from corner to corner", within="[1, inf)")
    size: float = parameter(40.0, "m", "half the side of the town", within="(0, inf)")
    anchors: int = parameter(8, "1", "anchors, on a ring about the town", within="[1, inf)")
    ring: float = parameter(60.0, "m", "radius of the ring", within="(0, inf)")
    noise: str = parameter("heavy-tailed", "", "noise of the ranges", within=NOISES)
    sigma: float = parameter(0.5, "m", "standard deviation of its core", within="(0, inf)")
    share: float = parameter(0.2, "1", "share of ranges with the other noise", within="[0, 1]")
    wide: float = parameter(
        2.5, "m", "heavy-tailed: standard deviation of the other noise", within="(0, inf)"
    )
    longer: float = parameter(3.0, "m", "multimodal: how much longer the other path is")
    delay: float = parameter(
        3.0, "m", "skewed: mean of the exponential delay of the others", within="(0, inf)"
    )
    velocity_std: float = parameter(
        0.025, "m s-1", "noise of the odometry's velocity, per axis", within="[0, inf)"
    )
    turn_rate_std: float = parameter(
        0.02, "rad s-1", "noise of the odometry's turn rate", within="[0, inf)"
    )
    differences: bool = parameter(False, "", "differences to the first anchor in place of ranges")


def simulate(params: Params, rng: np.random.Generator, name: str) -> Recording:
    """A recording of the walk with its truth, called ``name``."""
    p, heading = walk(params, rng)
    angle = 2 * pi * (np.arange(params.anchors) + 0.5) / params.anchors
    places = params.ring * np.stack((np.cos(angle), np.sin(angle)), 1)
    time_ns = np.rint(np.arange(params.steps) * params.dt * 1e9).astype(np.int64)
    nodes = ("robot", *(f"A{j + 1}" for j in range(params.anchors)))
    sensors = {"robot": Sensor.device(0)}
    sensors |= {n: Sensor.static("anchor", a) for n, a in zip(nodes[1:], places, strict=True)}
    streams = {
        "odometry": _odometry(params, p, heading, time_ns, rng),
        "uwb": _ranges(params, p, places, nodes, time_ns, rng),
    }
    n = params.steps
    v = np.gradient(p, params.dt, axis=0)
    objects = Objects(
        time_ns,
        np.arange(n + 1, dtype=np.int64),
        np.zeros(n, np.int64),
        ("x", "y", "vx", "vy", "heading", "device_x", "device_y"),
        ("m", "m", "m s-1", "m s-1", "rad", "m", "m"),
        np.column_stack((p, v, np.angle(np.exp(1j * heading)), p)),
    )
    return Recording(Meta(name), sensors, streams, Truth(objects))


def walk(params: Params, rng: np.random.Generator) -> tuple[Array, Array]:
    """Positions (n, 2) [m] and headings (n,) [rad]; a corner that leads out of town is turned from.

    A heading is that with which the next step is made.
    """
    p, heading = np.zeros((params.steps, 2)), np.zeros(params.steps)
    towards = 0.0
    for k in range(params.steps):
        if k % params.block == 0:
            ways = [towards + turn for turn in TURNS]
            ends = [p[k] + params.block * params.step * _unit(way) for way in ways]
            inside = [w for w, e in zip(ways, ends, strict=True) if np.abs(e).max() <= params.size]
            towards = float(rng.choice(inside or [towards + pi]))
        heading[k] = towards
        if k + 1 < params.steps:
            p[k + 1] = p[k] + params.step * _unit(towards)
    return p, heading


def _unit(heading: float) -> Array:
    return np.array([np.cos(heading), np.sin(heading)])


def _odometry(
    params: Params, p: Array, heading: Array, time_ns: Array, rng: np.random.Generator
) -> Stream:
    """Each event tells of the step before it, in the frame in which that was made."""
    n = params.steps - 1
    turn = np.angle(np.exp(1j * np.diff(heading)))
    velocity = np.full(n, params.step / params.dt)
    noise = rng.normal(size=(3, n))
    scan = {
        "velocity_x": velocity + params.velocity_std * noise[0],
        "velocity_y": params.velocity_std * noise[1],
        "turn_rate": turn / params.dt + params.turn_rate_std * noise[2],
    }
    model = {
        "turn": "after",
        "velocity_std": max(params.velocity_std, 1e-3),
        "turn_rate_std": max(params.turn_rate_std, 1e-3),
    }
    return Stream("odometry", ("robot",), model, time_ns[1:], np.zeros(n + 1, np.int64), scan, {})


def _ranges(
    params: Params,
    p: Array,
    places: Array,
    nodes: tuple[str, ...],
    time_ns: Array,
    rng: np.random.Generator,
) -> Stream:
    n, J = params.steps, params.anchors
    d = np.linalg.norm(p[:, None] - places, axis=2)
    z = d + errors(params, (n, J), rng)
    model: dict[str, object] = {"mean_los": 1.0, "range_bias_std": 0.0}
    if not params.differences:
        rx = np.tile(np.arange(1, J + 1, dtype=np.int32), n)
        scan: dict[str, Array] = {
            "mode": np.full(n * J, ACTIVE, np.uint8),
            "tx": np.zeros(n * J, np.int32),
            "rx": rx,
        }
        rows = {"distance": z.clip(0).ravel(), "std": np.full(n * J, params.sigma)}
        offset = np.arange(n * J + 1, dtype=np.int64)
        return Stream("uwb", nodes, model, np.repeat(time_ns, J), offset, scan, rows)
    m = n * (J - 1)
    scan = {
        "mode": np.full(m, TDOA, np.uint8),
        "tx": np.zeros(m, np.int32),
        "rx": np.tile(np.arange(2, J + 1, dtype=np.int32), n),
        "reference": np.ones(m, np.int32),
    }
    rows = {
        "distance": (z[:, 1:] - z[:, :1]).ravel(),
        "std": np.full(m, np.sqrt(2) * params.sigma),
    }
    offset = np.arange(m + 1, dtype=np.int64)
    return Stream("uwb", nodes, model, np.repeat(time_ns, J - 1), offset, scan, rows)


def errors(params: Params, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
    """Errors of ranges [m]; all noises draw the same numbers."""
    core, other = rng.normal(size=(2, *shape))
    hit, delay = rng.random(shape) < params.share, rng.exponential(size=shape)
    e = params.sigma * core
    if params.noise == "heavy-tailed":
        e = np.where(hit, params.wide * other, e)
    elif params.noise == "multimodal":
        e = e + np.where(hit, params.longer, 0.0)
    elif params.noise == "skewed":
        e = e + np.where(hit, params.delay * delay, 0.0)
    return np.asarray(e)

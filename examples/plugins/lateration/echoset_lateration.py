"""Lateration: the straight line on which a device's last ranges fit best, by least squares.

Without memory, clutter or a body that scatters, it shows what a filter adds. At every time at which
ranges come in, position and velocity are fitted to those of the last ``window`` seconds; residuals
well above ``scale`` count less (soft L1 loss, Triggs et al., Bundle adjustment: a modern synthesis,
2000, section 3).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from scipy.optimize import least_squares

from echoset.models.columns import ACTIVE
from echoset.models.errors import EstimatorError, InputError
from echoset.models.parameters import parameter, require
from echoset.models.records import Array, Estimates, Meta, Objects, Recording, Scan

SUMMARY = "line that fits the last active ranges of a device best, by robust least squares"
STREAMS = ("uwb",)
PRESETS = {"walking": {"window": 2.0, "speed_std": 1.5}}


@dataclass(frozen=True, slots=True)
class Params:
    """Which ranges are fitted, and how well they are trusted."""

    window: float = parameter(1.0, "s", "ranges of the last so many seconds are fitted")
    scale: float = parameter(0.3, "m", "residual beyond which a range loses weight")
    sigma: float = parameter(0.1, "m", "standard deviation of ranges that state none")
    speed_std: float = parameter(1.0, "m s-1", "standard deviation of the velocity, per axis")

    def __post_init__(self) -> None:
        for name in ("window", "scale", "sigma", "speed_std"):
            require(getattr(self, name) > 0, name, "positive", getattr(self, name))


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """Yield the device's position at each time that has ranges.

    Raises
    ------
    InputError : there are not three anchors, or several devices
    EstimatorError : the fit fails
    """
    anchors = _anchors(setup)
    known = np.array(list(anchors.values()))
    recent: deque[tuple[Array, ...]] = deque()
    guess = np.append(known.mean(0), (0.0, 0.0))
    for time_ns, events in groupby(scans, key=lambda scan: scan.time_ns):
        for event in events:
            d, receiver = event.rows["distance"], int(event.scan["rx"])
            if event.scan["mode"] == ACTIVE and len(d):
                anchor = np.tile(anchors[event.stream, receiver], (len(d), 1))
                std = event.rows.get("std", np.full(len(d), params.sigma))
                recent.append((np.full(len(d), time_ns), anchor, d, std))
        while recent and recent[0][0][0] < time_ns - params.window * 1e9:
            recent.popleft()
        if len({tuple(a) for _, anchor, *_ in recent for a in anchor.tolist()}) < 3:
            continue
        t, a, d, s = (np.concatenate(part) for part in zip(*recent, strict=True))
        guess, covariance = _fit(guess, (t - time_ns) * 1e-9, a, d, s, params)
        if not (np.isfinite(guess).all() and np.isfinite(covariance).all()):
            raise EstimatorError(f"at {time_ns * 1e-9:g} s: the fit is not finite")
        objects = Objects(
            np.array([time_ns]),
            np.array([0, 1]),
            np.zeros(1, np.int64),
            ("device_x", "device_y", "vx", "vy"),
            ("m", "m", "m s-1", "m s-1"),
            guess[None],
            covariance=covariance[None],
        )
        yield Estimates(Meta(""), objects, {"ranges": np.array([len(d)])})


def _anchors(setup: Recording) -> dict[tuple[str, int], Array]:
    """Positions (2,) of the anchors by stream and index among its nodes."""
    found = {}
    for name, stream in setup.streams.items():
        kinds = [setup.sensors[node].kind for node in stream.nodes]
        if kinds.count("device") > 1:
            raise InputError(f"streams/{name}: several devices, lateration takes one")
        for i, node in enumerate(stream.nodes):
            if kinds[i] == "anchor":
                found[name, i] = setup.sensors[node].position[0, :2]
    if len(found) < 3:
        raise InputError(f"{len(found)} anchors, lateration needs three")
    return found


def _fit(
    guess: Array, age: Array, anchors: Array, distance: Array, std: Array, params: Params
) -> tuple[Array, Array]:
    """State (4,) and its covariance (4, 4), from a guess; ``age`` (m,) [s] is at most 0."""

    def residuals(x: Array) -> Array:
        place = x[:2] + age[:, None] * x[2:]
        fit = (np.linalg.norm(place - anchors, axis=1) - distance) / std
        return np.concatenate((fit, x[2:] / params.speed_std))

    threshold = params.scale / float(np.median(std))
    fit = least_squares(residuals, guess, loss="soft_l1", f_scale=threshold)
    covariance = np.linalg.pinv(fit.jac.T @ fit.jac)
    return fit.x, (covariance + covariance.T) / 2

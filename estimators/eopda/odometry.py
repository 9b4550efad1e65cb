"""Odometry between two times: how far the body has moved and turned, and how sure that is.

An event of odometry tells the velocity in the body's frame and the turn rate of the time since the
event before it. Events between two times are summed up in the frame of the body at the first: that
is all a filter or a batch needs of them, however often the wheels are read.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import cos, inf, sin
from typing import NamedTuple

import numpy as np

from ...models.errors import InputError
from ...models.parameters import parameter
from ...models.records import Array, Recording, Scan

LONGEST = 5.0
"""An event tells of at most so many usual intervals before it."""
FEW = 20
"""Intervals that tell the usual one."""


@dataclass(frozen=True, slots=True)
class Odometry:
    """How well odometry is known where its events do not tell it themselves."""

    TITLE = "odometry"
    STREAMS = ("odometry",)
    velocity_std: float = parameter(
        0.02, "m s-1", "standard deviation of a velocity of odometry, per axis", within="(0, inf)"
    )
    turn_rate_std: float = parameter(
        0.02, "rad s-1", "standard deviation of a turn rate of odometry", within="(0, inf)"
    )
    heading_std: float = parameter(
        0.05, "rad", "standard deviation of a heading of odometry", within="(0, inf)"
    )
    heading_walk: float = parameter(
        1.0, "rad s-1/2", "random walk of a heading while no odometry tells it", within="(0, inf)"
    )
    turn: str = parameter(
        "during",
        "",
        "whether the body turns during the motion of an event of odometry, or after it",
        within=("during", "after"),
    )


class Increment(NamedTuple):
    """Motion over an interval, in the body's frame at its start.

    ``displacement`` (2,) [m], ``turn`` [rad] and the ``covariance`` (3, 3) of these; ``covered`` is
    the share of the interval of which odometry tells. ``heading`` [rad] is an absolute one at the
    end with its ``heading_variance``, infinite where none is told.
    """

    displacement: Array
    turn: float
    covariance: Array
    covered: float
    heading: float
    heading_variance: float


class Reading(NamedTuple):
    """One event of odometry: velocity (2,), turn rate and heading, NaN where not told; variances
    (4,)."""

    time_ns: int
    velocity: Array
    turn_rate: float
    heading: float
    variance: Array


def reading(scan: Scan, params: Odometry) -> Reading:
    """The event of a scan; ``params`` tells what the scan does not."""
    told = scan.scan
    names = ("velocity_x", "velocity_y", "turn_rate", "heading")
    std = (params.velocity_std, params.velocity_std, params.turn_rate_std, params.heading_std)
    own = [float(told.get(f"std_{name}", s)) for name, s in zip(names, std, strict=True)]
    value = [float(told.get(name, np.nan)) for name in names]
    return Reading(scan.time_ns, np.array(value[:2]), value[2], value[3], np.square(np.array(own)))


def odometry_of(setup: Recording, device: str | None) -> str | None:
    """The name of the stream of odometry of the ``device``, or of the only one; None without.

    Raises
    ------
    InputError : there are several
    """
    names = sorted(
        name
        for name, stream in setup.streams.items()
        if stream.kind == "odometry" and device in (None, stream.nodes[0])
    )
    if len(names) > 1:
        raise InputError(f"{setup.meta.name}: needs one stream of odometry, has {' '.join(names)}")
    return names[0] if names else None


@dataclass(slots=True, eq=False)
class Odometer:
    """Sums up readings, which come in order of time, between one time asked for and the next."""

    params: Odometry
    _readings: list[Reading] = field(default_factory=list)
    _begun: int | None = None
    _intervals: list[int] = field(default_factory=list)
    _last: int | None = None
    _headings: list[Reading] = field(default_factory=list)

    def take(self, scans: Iterable[Scan]) -> None:
        """Note the next events."""
        for scan in scans:
            self.note(reading(scan, self.params))

    def note(self, one: Reading) -> None:
        """Note the next event."""
        if np.isfinite(one.heading):
            self._headings.append(one)
        if not (np.isfinite(one.velocity).all() and np.isfinite(one.turn_rate)):
            return
        if self._last is not None and one.time_ns > self._last and len(self._intervals) < FEW:
            self._intervals.append(one.time_ns - self._last)
        self._last = one.time_ns
        self._readings.append(one)

    @property
    def seen(self) -> float:
        """The time [ns] up to which readings were noted."""
        return -inf if self._last is None else float(self._last)

    def until(self, time_ns: int) -> Increment:
        """The motion from the time asked for before up to ``time_ns``."""
        begun = time_ns if self._begun is None else self._begun
        self._begun = time_ns
        x, C, heading, covered = np.zeros(2), np.zeros((3, 3)), 0.0, 0
        usual = float(np.median(self._intervals)) if self._intervals else 0.0
        used = 0
        before: int | None = None
        for number, one in enumerate(self._readings):
            start = one.time_ns - int(usual) if before is None else before
            start = max(start, one.time_ns - int(LONGEST * usual))
            before = one.time_ns
            low, high = max(start, begun), min(one.time_ns, time_ns)
            if high > low:
                ends = high == one.time_ns
                step = self._step(one, (high - low) * 1e-9, (one.time_ns - start) * 1e-9, ends)
                x, heading, C = _after(x, heading, C, *step)
                covered += high - low
            if one.time_ns <= time_ns:
                used = number
        # the last that is over stays, to tell when the next begins
        self._readings = self._readings[used:]
        told, variance = self._heading(begun, time_ns, heading)
        whole = max(time_ns - begun, 1)
        return Increment(x, heading, C, covered / whole, told, variance)

    def _step(
        self, one: Reading, dt: float, length: float, ends: bool
    ) -> tuple[Array, float, float, Array]:
        """Displacement, turn before and behind it, and variances of a part of a reading."""
        variance = one.variance[:3] * length * dt
        d = one.velocity * dt
        if self.params.turn == "after":
            return d, 0.0, one.turn_rate * length if ends else 0.0, variance
        half = one.turn_rate * dt / 2
        return d * float(np.sinc(half / np.pi)), half, half, variance

    def _heading(self, begun: int, time_ns: int, turn: float) -> tuple[float, float]:
        """The last absolute heading of the interval, brought to its end in proportion."""
        found = [one for one in self._headings if begun <= one.time_ns <= time_ns]
        self._headings = [one for one in self._headings if one.time_ns > time_ns]
        if not found:
            return np.nan, inf
        one = found[-1]
        rest = (time_ns - one.time_ns) / max(time_ns - begun, 1)
        return one.heading + turn * rest, float(one.variance[3])


def _after(
    x: Array, heading: float, C: Array, d: Array, first: float, then: float, variance: Array
) -> tuple[Array, float, Array]:
    """One more displacement ``d`` (2,), at the heading in its middle, after what was summed up."""
    middle = heading + first
    c, s = cos(middle), sin(middle)
    R = np.array([[c, -s], [s, c]])
    moved = R @ d
    F = np.eye(3)
    F[:2, 2] = -moved[1], moved[0]
    G = np.zeros((3, 3))
    G[:2, :2], G[2, 2] = R, 1.0
    return x + moved, middle + then, F @ C @ F.T + (G * variance) @ G.T

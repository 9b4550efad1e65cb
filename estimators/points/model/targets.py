"""What filters of point targets assume about the targets: motion, survival and births."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from math import ceil
from typing import TypeVar

import numpy as np

from ....models.errors import InputError
from ....models.geometry.regions import box, contains, polygon
from ....models.motion import (
    backwards,
    constant_acceleration,
    constant_velocity,
    coordinated_turn,
    random_walk,
    white_acceleration,
)
from ....models.parameters import parameter, require
from ....models.records import Array, Recording
from ..kernels import births
from ..kernels.compiled import gaussians
from ..kernels.gaussians import moments
from .measurement import first
from .sensing import STREAMS, Look, Motion

NAMES = ("x", "y", "vx", "vy", "ax", "ay")
UNITS = ("m", "m", "m s-1", "m s-1", "m s-2", "m s-2")
"""Of the state, whose acceleration is there with ``ca`` alone."""
SECOND = 1.0
"""Step [s] of what is assumed per step, where several streams have no step in common."""
MOST = 1000
"""What limits that grow with the scan grow to."""
VAGUE = 1e6
"""Deviation [m] of a position, beyond which nothing is known of a target and it is given up."""
_AGES, _GROUPS = 400, 6
BIRTHS = ("detections", "edge", "components")


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class TargetParams:
    """How targets move; p_survive and births hold for a step, or for ``time_unit``."""

    TITLE = "targets"

    motion: str = parameter(
        "cv",
        "1",
        "cv: nearly constant velocity; ca: nearly constant acceleration; ct: cv turning at "
        "turn_rate; random-walk: x and y alone, by diffusion, for what stands",
        within=("cv", "ca", "ct", "random-walk"),
    )
    jerk_density: float = parameter(
        0.1, "m2 s-5", "of ca: white jerk in continuous time", within="(0, inf)"
    )
    birth_std_acceleration: float = parameter(
        1.0, "m s-2", "of ca: spread of the acceleration", within="(0, inf)"
    )
    turn_rate: float = parameter(0.0, "rad s-1", "of ct: anticlockwise")
    std_acceleration: float = parameter(
        1.0, "m s-2", "white acceleration, constant over a step", within="[0, inf)"
    )
    acceleration_density: float | None = parameter(
        None,
        "m2 s-3",
        "white acceleration in continuous time, whose noise does not depend on the rate of scans, "
        "in place of std_acceleration; null: 0 with one stream, with several the square of "
        "std_acceleration times 1 s",
        within="[0, inf)",
    )
    diffusion: float = parameter(
        0.0, "s-1", "variance that every state entry gains per second", within="[0, inf)"
    )
    p_survive: float = parameter(
        0.99, "1", "probability that a target survives a step", within="[0, 1]"
    )
    scene: tuple[float, ...] = parameter(
        (), "m", "x_min, x_max, y_min, y_max outside which no target survives; empty: everywhere"
    )
    time_unit: float | None = parameter(
        None,
        "s",
        "time of a step; 0: from one scan to the next; null: 0 with one stream, 1 s with several",
        within="[0, inf)",
    )
    birth: str = parameter("detections", "1", "where targets appear", within=BIRTHS)
    birth_rate: float = parameter(
        0.1, "1", "expected new targets per step (not for components)", within="[0, inf)"
    )
    birth_components: tuple[tuple[float, ...], ...] = parameter(
        (), "1, m, m s-1", "weight, x y vx vy and their four standard deviations, for each"
    )
    birth_edge: tuple[float, ...] = parameter((), "m", "x0, y0, x1, y1 of the edge")
    birth_count: int = parameter(10, "1", "components along the edge", within="[1, inf)")
    max_births: int | None = parameter(
        None,
        "1",
        "detections of a time at which targets may appear; null: all, up to 1000",
        within="[1, inf)",
    )
    birth_std_across: float = parameter(
        5.0, "m", "spread at right angles to the edge", within="(0, inf)"
    )
    birth_velocity: tuple[float, float] = parameter((0.0, 0.0), "m s-1", "mean at the edge")
    birth_std_velocity: tuple[float, float] = parameter(
        (5.0, 5.0), "m s-1", "spread of velocity", within="(0, inf)"
    )

    @property
    def width(self) -> int:
        """Entries of the state."""
        return 6 if self.motion == "ca" else 4

    def __post_init__(self) -> None:
        if self.scene:
            polygon(self.scene, "scene")
        for c in self.birth_components:
            ok = len(c) == 9 and c[0] >= 0 and min(c[5:]) > 0
            require(ok, "birth_components", "weight, four means, four deviations > 0", c)
        if self.birth == "edge":
            e = self.birth_edge
            require(len(e) == 4 and e[:2] != e[2:], "birth_edge", "two points x0, y0, x1, y1", e)


P = TypeVar("P", bound=TargetParams)


def settled(params: P, setup: Recording) -> P:
    """The parameters with what is null chosen for the streams of a recording.

    Several streams share no step: what holds for a step then holds for a second.
    """
    kinds = [s.kind for s in setup.streams.values()]
    looks = sum(kind in STREAMS for kind in kinds) + any(kind not in STREAMS for kind in kinds)
    unit, density = params.time_unit, params.acceleration_density
    if unit is None:
        unit = SECOND if looks > 1 else 0.0
    if density is None:
        density = params.std_acceleration**2 * SECOND if looks > 1 else 0.0
    return replace(params, time_unit=unit, acceleration_density=density)


def limit(given: int | None, detections: int, each: int, least: int) -> int:
    """A limit as ``given``, or as it grows with the ``detections`` of a scan."""
    return min(max(least, each * detections), MOST) if given is None else given


@dataclass(frozen=True, slots=True, eq=False)
class Interval:
    """From one time to the next: ``dt`` [s], in how many ``steps``, and how targets move.

    F (4, 4) is the transition and Q (4, 4) the covariance of the process noise.
    """

    dt: float
    steps: float
    F: Array
    Q: Array

    def survival(self, params: TargetParams, m: Array) -> Array:
        """Probability (J,) that targets at the means m (J, 4) survive."""
        p = np.full(len(m), params.p_survive**self.steps)
        if params.scene:
            p = np.where(contains(box(params.scene), m[:, :2]), p, 0.0)
        return p

    def predict(self, m: Array, P: Array) -> tuple[Array, Array, Array]:
        """Means and covariances after the motion, and (J,) whether anything is known still."""
        m, P = gaussians.predict(m, P, self.F, self.Q)
        return m, P, np.trace(P[:, :2, :2], axis1=1, axis2=2) < VAGUE**2


def elapse(params: TargetParams, last_ns: int | None, time_ns: int) -> Interval:
    """The interval since ``last_ns``; None: the first scan, which counts for one step.

    Raises
    ------
    InputError : the time goes back
    """
    dt = 0.0 if last_ns is None else (time_ns - last_ns) / 1e9
    if dt < 0:
        raise InputError(f"scan at {time_ns} ns: out of order")
    steps = dt / params.time_unit if params.time_unit and last_ns is not None else 1.0
    return Interval(dt, steps, *transition(params, dt))


def transition(params: TargetParams, dt: float) -> tuple[Array, Array]:
    """Transition F (4, 4) and covariance Q (4, 4) of the process noise over ``dt`` [s]."""
    if params.motion == "random-walk":
        return random_walk(dt, params.diffusion)
    if params.motion == "ca":
        F, Q = constant_acceleration(dt, params.jerk_density)
        return F, Q + params.diffusion * dt * np.eye(6)
    density, rate = params.acceleration_density or 0.0, 0.0
    if params.motion == "ct":
        rate = params.turn_rate
    return _transition(params.std_acceleration, density, params.diffusion, rate, dt)


def within(params: TargetParams) -> Motion:
    """The motion from the time of a scan to that of one of its rows, before or after."""

    def motion(dt: float) -> tuple[Array, Array]:
        F, Q = transition(params, abs(dt))
        if dt >= 0 or params.motion == "random-walk":
            return F, Q
        back = backwards(F)
        return back, back @ Q @ back.T

    return motion


@lru_cache(maxsize=16)
def _transition(
    std_acceleration: float, density: float, diffusion: float, turn_rate: float, dt: float
) -> tuple[Array, Array]:
    F, G = constant_velocity(dt)
    if turn_rate:
        F = coordinated_turn(dt, turn_rate)
    Q = density * white_acceleration(dt) if density else std_acceleration**2 * G @ G.T
    return F, Q + diffusion * dt * np.eye(4)


def appeared(p_survive: float, start: float, stop: float) -> float:
    """Targets of one birth a step that are ``start`` to ``stop`` steps old, and alive."""
    if p_survive == 1:
        return stop - start
    return float((p_survive**start - p_survive**stop) / (1 - p_survive))


def widened(params: TargetParams, m: Array, P: Array) -> tuple[Array, Array]:
    """Means (n, 4) and covariances with the acceleration, where the state has it: about 0."""
    if params.width == m.shape[1]:
        return m, P
    wide = np.zeros((len(m), 6, 6))
    wide[:, :4, :4] = P
    wide[:, 4, 4] = wide[:, 5, 5] = params.birth_std_acceleration**2
    return np.hstack((m, np.zeros((len(m), 2)))), wide


def started(params: TargetParams, look: Look) -> tuple[Array, Array, Array]:
    """:func:`.measurement.first`: targets that nothing but the detections of a look tells of."""
    m, P, density = first(look, np.array(params.birth_std_velocity))
    return *widened(params, m, P), density


def newborn(params: TargetParams, interval: Interval) -> births.Components:
    """Components of targets that appeared in an interval, but for those at detections.

    Over n steps b (1 - p^n) / (1 - p) of b a step are alive, spread by how they moved since.
    """
    if params.birth == "components":
        w, m, P = births.static(np.array(params.birth_components))
    elif params.birth == "edge":
        w, m, P = births.along_edge(
            params.birth_rate,
            np.array(params.birth_edge),
            params.birth_count,
            params.birth_std_across,
            np.array(params.birth_velocity),
            np.array(params.birth_std_velocity),
        )
    else:
        return births.none(params.width)
    m, P = widened(params, m, P)
    n = interval.steps
    if n <= 1 or not len(w):
        return w * appeared(params.p_survive, 0.0, n), m, P
    return _aged(params, w, m, P, interval)


def _aged(
    params: TargetParams, w: Array, m: Array, P: Array, interval: Interval
) -> births.Components:
    """Components of births over more than one step: a few, which unite those of near ages."""
    n, unit = interval.steps, interval.dt / interval.steps
    whole = ceil(n) <= _AGES
    edges = np.append(np.arange(ceil(n)), n) if whole else np.linspace(0.0, n, _AGES + 1)
    alive = np.array([appeared(params.p_survive, a, b) for a, b in pairwise(edges.tolist())])
    ages = edges[:-1] if whole else (edges[:-1] + edges[1:] - 1) / 2
    moved = [gaussians.predict(m, P, *transition(params, a * unit)) for a in ages.tolist()]
    m_all, P_all = (np.stack(columns, axis=1) for columns in zip(*moved, strict=True))
    share = np.cumsum(alive) / alive.sum()
    group = np.minimum((share * _GROUPS * (1 - 1e-12)).astype(int), _GROUPS - 1)
    found = births.none(params.width)
    for g in np.unique(group):
        at = group == g
        parts = [
            moments(alive[at], m_b[at], P_b[at]) for m_b, P_b in zip(m_all, P_all, strict=True)
        ]
        total, mean, spread = zip(*parts, strict=True)
        found = births.join(found, (w * np.array(total), np.array(mean), np.array(spread)))
    return found


def born(
    params: TargetParams, looks: Sequence[Look], novelty: Sequence[Array], interval: Interval
) -> tuple[births.Components, float]:
    """Components that may have appeared at the detections of a time, and the weight that is cut.

    ``novelty`` (n,) tells of each look how probably no known target made the detections. All looks
    share what appeared in the ``interval``.
    """
    if params.birth != "detections" or not looks:
        return births.none(params.width), 0.0
    rate = params.birth_rate * appeared(params.p_survive, 0.0, interval.steps)
    new = np.clip(np.concatenate(novelty), 0.0, 1.0)
    each = [started(params, look) for look in looks]
    m, P = (np.concatenate([one[k] for one in each]) for k in (0, 1))
    most = limit(params.max_births, len(new), 1, 1)
    found = births.at_detections(rate, m, P, new, most)
    return found, max(float(births.shares(rate, new).sum() - found[0].sum()), 0.0)

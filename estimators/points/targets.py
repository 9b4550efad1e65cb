"""What filters of point targets assume about the targets: motion, survival and births."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ...models.errors import InputError
from ...models.motion import constant_velocity
from ...models.parameters import parameter, require
from ...models.records import Array
from ...models.regions import box, contains, polygon
from .kernels import births

BIRTHS = ("detections", "edge", "components")


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class TargetParams:
    """Near constant velocity; p_survive and births hold for a step, or for ``time_unit``.

    What lies may be taken for clutter that persists.
    """

    TITLE = "targets"

    std_acceleration: float = parameter(
        1.0, "m s-2", "white acceleration, constant over a step", within="[0, inf)"
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
    time_unit: float = parameter(
        0.0, "s", "time of a step; 0: from one scan to the next", within="[0, inf)"
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
    max_births: int = parameter(
        200, "1", "detections of a scan at which targets may appear", within="[1, inf)"
    )
    birth_std_across: float = parameter(
        5.0, "m", "spread at right angles to the edge", within="(0, inf)"
    )
    birth_velocity: tuple[float, float] = parameter((0.0, 0.0), "m s-1", "mean at the edge")
    birth_std_velocity: tuple[float, float] = parameter(
        (5.0, 5.0), "m s-1", "spread of velocity", within="(0, inf)"
    )
    clutter_cell: float = parameter(
        0.0,
        "m",
        "cells of a map of persistent clutter, learnt on the way, as wide as the noise; 0: no map",
        within="[0, inf)",
    )
    clutter_memory: float = parameter(60.0, "s", "time over which it fades", within="(0, inf)")

    def __post_init__(self) -> None:
        if self.scene:
            polygon(self.scene, "scene")
        for c in self.birth_components:
            ok = len(c) == 9 and c[0] >= 0 and min(c[5:]) > 0
            require(ok, "birth_components", "weight, four means, four deviations > 0", c)
        if self.birth == "edge":
            e = self.birth_edge
            require(len(e) == 4 and e[:2] != e[2:], "birth_edge", "two points x0, y0, x1, y1", e)


def transition(params: TargetParams, dt: float) -> tuple[Array, Array]:
    """Transition F (4, 4) and covariance Q (4, 4) of the process noise over ``dt`` [s]."""
    return _transition(params.std_acceleration, params.diffusion, dt)


@lru_cache(maxsize=16)
def _transition(std_acceleration: float, diffusion: float, dt: float) -> tuple[Array, Array]:
    F, G = constant_velocity(dt)
    return F, std_acceleration**2 * G @ G.T + diffusion * dt * np.eye(4)


def steps(params: TargetParams, dt: float) -> float:
    """How many steps the time ``dt`` [s] between scans counts for."""
    return dt / params.time_unit if params.time_unit else 1.0


def survival(params: TargetParams, m: Array, dt: float) -> Array:
    """Probability (J,) that targets at the means m (J, 4) survive ``dt`` [s]."""
    p = np.full(len(m), params.p_survive ** steps(params, dt))
    if params.scene:
        p = np.where(contains(box(params.scene), m[:, :2]), p, 0.0)
    return p


def newborn(params: TargetParams, count: float) -> births.Components:
    """Components of targets that appeared in ``count`` steps, but for those at detections."""
    if params.birth == "components":
        w, m, P = births.static(np.array(params.birth_components))
        return w * count, m, P
    if params.birth == "edge":
        return births.along_edge(
            params.birth_rate * count,
            np.array(params.birth_edge),
            params.birth_count,
            params.birth_std_across,
            np.array(params.birth_velocity),
            np.array(params.birth_std_velocity),
        )
    return births.none()


def elapse(
    params: TargetParams, last_ns: int | None, time_ns: int
) -> tuple[float, float, Array, Array]:
    """Time [s] since ``last_ns``, in how many steps of births, and F, Q; None: the first scan.

    Raises
    ------
    InputError : the time goes back
    """
    dt = 0.0 if last_ns is None else (time_ns - last_ns) / 1e9
    if dt < 0:
        raise InputError(f"scan at {time_ns} ns: out of order")
    return dt, 1.0 if last_ns is None else steps(params, dt), *transition(params, dt)

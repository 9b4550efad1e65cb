"""Targets that change how they move: an interacting multiple model in one state.

Beside nearly constant velocity a target can turn, at rates that are given, or shake more. It begins
a manoeuvre and ends it as a Markov chain in time. H. A. P. Blom and Y. Bar-Shalom, "The interacting
multiple model algorithm for systems with Markovian switching coefficients", IEEE Trans. Autom.
Control 33 (1988) 780-783. All modes share the state x y vx vy.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import expm

from ...models.motion import coordinated_turn, white_acceleration
from ...models.parameters import parameter, require
from ...models.records import Array
from .kernels.modes import Modes, Way
from .model.targets import VAGUE, Interval


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class ModeParams:
    """How targets may move otherwise than with nearly constant velocity."""

    TITLE = "manoeuvres"

    motion: str = parameter(
        "cv",
        "1",
        "cv: nearly constant velocity; ca: nearly constant acceleration; ct: cv turning at "
        "turn_rate; random-walk: x and y alone, by diffusion, for what stands; imm: cv and "
        "manoeuvres, as an interacting multiple model",
        within=("cv", "ca", "ct", "random-walk", "imm"),
    )
    manoeuvres: tuple[tuple[float, ...], ...] = parameter(
        ((0.15, 0.1), (-0.15, 0.1), (0.0, 10.0)),
        "rad s-1, m2 s-3",
        "of imm: turn rate and density of white acceleration of each",
    )
    manoeuvre_rate: float = parameter(
        0.02, "s-1", "of imm: rate at which a target begins one", within="(0, inf)"
    )
    manoeuvre_time: float = parameter(10.0, "s", "of imm: mean length of one", within="(0, inf)")

    def __post_init__(self) -> None:
        for one in self.manoeuvres:
            ok = len(one) == 2 and one[1] >= 0
            require(ok, "manoeuvres", "turn rate and density >= 0", one)

    @property
    def modes(self) -> int:
        """Number of modes, 1 without manoeuvres."""
        return 1 + len(self.manoeuvres) if self.motion == "imm" else 1


def initial(params: ModeParams) -> Array:
    """Probabilities (M,) of the modes of a target of which nothing is known."""
    n = params.modes - 1
    busy = params.manoeuvre_rate * params.manoeuvre_time
    busy = busy / (1 + busy) if n else 0.0
    return np.array([1 - busy, *[busy / max(n, 1)] * n])


def transitions(params: ModeParams, dt: float) -> tuple[Array, Array, Array]:
    """Of the manoeuvres over ``dt`` [s]: F (M - 1, 4, 4) and Q; and of all modes Pi (M, M).

    Pi (i, j) is the probability that mode i becomes mode j.
    """
    return _transitions(params.manoeuvres, params.manoeuvre_rate, params.manoeuvre_time, dt)


@lru_cache(maxsize=16)
def _transitions(
    manoeuvres: tuple[tuple[float, float], ...], rate: float, time: float, dt: float
) -> tuple[Array, Array, Array]:
    n = len(manoeuvres)
    F = np.array([coordinated_turn(dt, turn) for turn, _ in manoeuvres]).reshape(n, 4, 4)
    Q = np.array([density * white_acceleration(dt) for _, density in manoeuvres])
    change = np.zeros((n + 1, n + 1))
    if n:
        change[0, 1:], change[1:, 0] = rate / n, 1 / time
    change -= np.diag(change.sum(1))
    return F, Q.reshape(n, 4, 4), expm(change * dt)


def moved(
    m: Array, P: Array, modes: Modes | None, params: ModeParams, gone: Interval
) -> tuple[Array, Array, Modes | None, Way | None, Array]:
    """Moments m (T, dx), P (T, dx, dx) and ``modes`` of targets after an interval.

    Then how those with modes came there, and whether (T,) anything is known of them still.
    """
    if modes is None:
        m, P, known = gone.predict(m, P)
        return m, P, None, None, known
    F, Q, Pi = transitions(params, gone.dt)
    F, Q = np.concatenate((gone.F[None], F)), np.concatenate((gone.Q[None], Q))
    modes, cross = modes.predict(F, Q, Pi)
    m, P = modes.together()
    way = Way(m, P, np.linalg.solve(P, cross.swapaxes(1, 2)).swapaxes(1, 2))
    return m, P, modes, way, np.trace(P[:, :2, :2], axis1=1, axis2=2) < VAGUE**2

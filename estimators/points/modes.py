"""Targets that change how they move: an interacting multiple model in one state.

Beside nearly constant velocity a target can turn, at rates that are given, or shake more. It begins
a manoeuvre and ends it as a Markov chain in time. H. A. P. Blom and Y. Bar-Shalom, "The interacting
multiple model algorithm for systems with Markovian switching coefficients", IEEE Trans. Autom.
Control 33 (1988) 780-783. All modes share the state x y vx vy; each has its own Gaussian.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import expm

from ...models.motion import coordinated_turn, white_acceleration
from ...models.parameters import parameter, require
from ...models.records import Array
from .kernels.compiled.pairs import matched


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


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """M modes of T targets: w (T, M), which add up to 1, m (T, M, dx), P (T, M, dx, dx)."""

    w: Array
    m: Array
    P: Array

    @staticmethod
    def of(w: Array, m: Array, P: Array) -> Modes:
        """Targets m (T, dx), P (T, dx, dx) of which only the probabilities w (M,) are known."""
        T, M = len(m), len(w)
        many = np.repeat(m[:, None], M, axis=1), np.repeat(P[:, None], M, axis=1)
        return Modes(np.tile(w, (T, 1)), *many)

    def take(self, index: Array) -> Modes:
        """Those of the targets ``index``."""
        return Modes(self.w[index], self.m[index], self.P[index])

    def join(self, other: Modes) -> Modes:
        """Those of both."""
        pairs = ((self.w, other.w), (self.m, other.m), (self.P, other.P))
        return Modes(*(np.concatenate(pair) for pair in pairs))

    def flat(self) -> tuple[Array, Array, Array]:
        """The same as w (T M,), m (T M, dx), P (T M, dx, dx), target by target."""
        dx = self.m.shape[2]
        return self.w.ravel(), self.m.reshape(-1, dx), self.P.reshape(-1, dx, dx)

    def like(self, w: Array, m: Array, P: Array) -> Modes:
        """Others of the same shape from what is :meth:`flat`."""
        return Modes(w.reshape(self.w.shape), m.reshape(self.m.shape), P.reshape(self.P.shape))

    def together(self) -> tuple[Array, Array]:
        """Moments m (T, dx), P (T, dx, dx) of the targets."""
        T, M = self.w.shape
        _, m, P = matched(np.repeat(np.arange(T), M), *self.flat(), T)
        return m, P

    def predict(self, F: Array, Q: Array, Pi: Array) -> tuple[Modes, Array]:
        """The modes after a step, and the covariance (T, dx, dx) of states before and after.

        F, Q (M, dx, dx) move what has become each mode, as Pi (M, M) says.
        """
        joint = self.w[:, :, None] * Pi
        w = joint.sum(1)
        share = joint / np.where(w > 0, w, 1.0)[:, None]
        mean = np.einsum("tij,tia->tja", share, self.m)
        v = self.m[:, :, None] - mean[:, None]
        spread = np.einsum("tij,tiab->tjab", share, self.P)
        spread += np.einsum("tij,tija,tijb->tjab", share, v, v)
        moved = Modes(w, np.einsum("jab,tjb->tja", F, mean), F @ spread @ F.swapaxes(1, 2) + Q)
        before, after = self.together()[0], moved.together()[0]
        u, e = mean - before[:, None], moved.m - after[:, None]
        cross = np.einsum("tj,tjab,jcb->tac", w, spread, F)
        return moved, cross + np.einsum("tj,tja,tjb->tab", w, u, e)


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """How T targets by label (T,), rising, came: predicted m (T, dx), P (T, dx, dx), and back.

    The ``gain`` (T, dx, dx) is the covariance of a target's states before and after, times the
    inverse of P: what is learnt of the state after tells so much of the one before.
    """

    label: Array
    m: Array
    P: Array
    gain: Array

"""The prior of a trajectory: how the unknowns of a time lead to those of the next.

Without odometry acceleration is white: positions and velocities of neighbouring times are tied by
its covariance. Where odometry tells of an interval, it ties positions and heading, and the velocity
only follows. Errors of ranges walk. The cost is half a sum of squares, whose Hessian is a chain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....models.motion import STEP
from ....models.records import Array
from .chain import Chain
from .gather import Data
from .params import Params

STATIC = 1e-4
"""Random walk [s-1/2] of what does not change, which keeps the chain regular."""
SHORTEST = 1e-6
"""Intervals count as at least so long [s]."""
LEAST = 1e-6
"""Least variances of an increment of odometry [m^2, rad^2]."""


@dataclass(frozen=True, slots=True)
class Layout:
    """Where the unknowns of a time stand, after x y vx vy; -1 for what is not estimated."""

    size: int
    heading: int
    height: int
    scale: int
    bias: int
    shared: int

    @staticmethod
    def of(data: Data, params: Params, height_known: bool) -> Layout:
        """The layout for these data."""
        size, found = 4, {}
        wanted = {
            "heading": bool(data.increments) or bool(data.offset.any()),
            "height": not height_known,
            "scale": params.range_scale_std > 0,
        }
        for name, is_wanted in wanted.items():
            found[name] = size if is_wanted else -1
            size += is_wanted
        bias = size if params.range_bias_std > 0 else -1
        size += data.anchors if bias >= 0 else 0
        shared = size if data.shared.any() else -1
        return Layout(size + (shared >= 0), **found, bias=bias, shared=shared)

    @property
    def biases(self) -> slice:
        """Where the offsets of the anchors stand."""
        return slice(self.bias, self.size - (self.shared >= 0))


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """What odometry tells of the intervals that begin ``at`` (m,).

    ``motion`` (m, 3) is displacement and turn in the frame at their start, with ``information``
    (m, 3, 3); headings ``value`` (h,) are told at the times ``when`` (h,).
    """

    at: Array
    motion: Array
    information: Array
    when: Array
    value: Array
    certain: Array


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The first state ``mean`` (d,) with information ``first`` (d, d), transitions ``F`` and
    ``W`` (n - 1, d, d), the information of what they add, and ``dt`` (n - 1,) [s]."""

    layout: Layout
    mean: Array
    first: Array
    F: Array
    W: Array
    dt: Array
    way: Way

    @staticmethod
    def of(
        data: Data,
        params: Params,
        layout: Layout,
        centre: Array,
        reach: float,
        height: tuple[float, float],
    ) -> Motion:
        """The prior for these data: at first within ``reach`` [m] of ``centre`` (2,)."""
        L, d = layout, layout.size
        mean, P = np.zeros(d), np.eye(d)
        mean[:2] = centre
        P[:2, :2] *= reach**2
        P[2:4, 2:4] *= params.speed_std**2
        walk = np.full(d, STATIC)
        if L.heading >= 0:
            P[L.heading, L.heading], walk[L.heading] = 1e4, params.heading_walk
        if L.height >= 0:
            mean[L.height], P[L.height, L.height] = height[0], height[1] ** 2
            walk[L.height] = max(params.height_walk, STATIC)
        if L.scale >= 0:
            P[L.scale, L.scale] = params.range_scale_std**2
        if L.bias >= 0:
            own, I = L.biases, np.eye(data.anchors)
            spread = params.range_bias_spread**2 * I
            P[own, own] = params.range_bias_std**2 + spread + STATIC**2 * I
            walk[own] = max(params.range_bias_walk, STATIC)
        dt = np.maximum(data.seconds, SHORTEST)
        F, W = np.tile(np.eye(d), (len(dt), 1, 1)), np.zeros((len(dt), d, d))
        k, q = np.arange(4, d), params.acceleration_std**2 * STEP
        W[:, k, k] = 1 / (walk[4:] ** 2 * dt[:, None])
        if L.shared >= 0:
            # new at each time, and as certain as it is told there
            noise = np.full(len(data.time_ns), float(data.shared.max()))
            noise[data.step] = np.where(data.shared > 0, data.shared, noise[data.step])
            P[L.shared, L.shared] = noise[0] ** 2
            F[:, L.shared, L.shared] = 0.0
            W[:, L.shared, L.shared] = noise[1:] ** -2.0
        for j in (0, 1):
            F[:, j, j + 2] = dt
            W[:, j, j], W[:, j + 2, j + 2] = 12 / (q * dt**3), 4 / (q * dt)
            W[:, j, j + 2] = W[:, j + 2, j] = -6 / (q * dt**2)
        way = _way(data, params, dt)
        if len(way.at):
            # the velocity follows the way that odometry tells, and does not bend it
            i, v = way.at, np.array([2, 3])
            W[i[:, None], :4, :4] = 0.0
            W[i[:, None], v, v] = 1 / (q * dt[i, None])
            F[i[:, None], v, v] = 0.0
            W[i, L.heading, L.heading] = 0.0
        return Motion(layout, mean, np.linalg.inv(P), F, W, dt, way)

    def cost(self, x: Array) -> float:
        """The cost [nats] of a trajectory (n, d)."""
        e = x[0] - self.mean
        total = 0.5 * e @ self.first @ e
        e = self._errors(x)
        total += 0.5 * np.einsum("ni,nij,nj->", e, self.W, e, optimize=True)
        if self.layout.heading >= 0:
            e, _ = self._way_errors(x)
            total += 0.5 * np.einsum("ni,nij,nj->", e, self.way.information, e, optimize=True)
            total += 0.5 * (self.way.certain * self._heading_errors(x) ** 2).sum()
        return float(total)

    def normal(self, x: Array) -> tuple[Chain, Array]:
        """Gauss-Newton Hessian and downhill slope (n, d)."""
        n, d = x.shape
        A, slope = np.zeros((n, d, d)), np.zeros((n, d))
        A[0] += self.first
        slope[0] -= self.first @ (x[0] - self.mean)
        WF = self.W @ self.F
        We = np.einsum("nij,nj->ni", self.W, self._errors(x))
        A[1:] += self.W
        A[:-1] += self.F.swapaxes(1, 2) @ WF
        U = -WF.swapaxes(1, 2)
        slope[1:] -= We
        slope[:-1] += np.einsum("nji,nj->ni", self.F, We)
        if self.layout.heading >= 0:
            self._add_way(x, A, U, slope, We)
        return Chain(A, U), slope

    def log_determinant(self, x: Array) -> float:
        """Of the information that the prior has of a trajectory."""
        W = self.W.copy()
        if len(self.way.at):
            own = np.array([0, 1, self.layout.heading])
            W[self.way.at[:, None, None], own[:, None], own] += self.way.information
        return float(np.linalg.slogdet(self.first)[1] + np.linalg.slogdet(W)[1].sum())

    def _errors(self, x: Array) -> Array:
        """What the chain adds to F x, (n - 1, d)."""
        e = x[1:] - np.einsum("nij,nj->ni", self.F, x[:-1])
        i = self.way.at
        e[i, 2:4] = x[i + 1, 2:4] - (x[i + 1, :2] - x[i, :2]) / self.dt[i, None]
        return np.asarray(e)

    def _way_errors(self, x: Array) -> tuple[Array, Array]:
        """Errors (m, 3) of what odometry tells, and their gradients (m, 3, 6) in x y heading at
        both ends."""
        i, h = self.way.at, self.layout.heading
        c, s = np.cos(x[i, h]), np.sin(x[i, h])
        u = x[i + 1, :2] - x[i, :2]
        e = np.empty((len(i), 3))
        e[:, 0], e[:, 1] = c * u[:, 0] + s * u[:, 1], c * u[:, 1] - s * u[:, 0]
        e[:, 2] = x[i + 1, h] - x[i, h]
        G = np.zeros((len(i), 3, 6))
        G[:, 0, 2], G[:, 1, 2] = e[:, 1], -e[:, 0]
        for k, sign in ((0, -1.0), (3, 1.0)):
            G[:, 0, k], G[:, 0, k + 1] = sign * c, sign * s
            G[:, 1, k], G[:, 1, k + 1] = -sign * s, sign * c
            G[:, 2, k + 2] = sign
        return e - self.way.motion, G

    def _heading_errors(self, x: Array) -> Array:
        e = x[self.way.when, self.layout.heading] - self.way.value
        return np.asarray((e + np.pi) % (2 * np.pi) - np.pi)

    def _add_way(self, x: Array, A: Array, U: Array, slope: Array, We: Array) -> None:
        """Add what odometry tells, and velocities that follow the way."""
        i, h = self.way.at, self.layout.heading
        w, t, push = self.W[i, 2, 2], self.dt[i], We[i, 2:4]
        for j in (0, 1):
            # of v' - (p' - p) / dt the part in v' is there already
            A[i + 1, j, j] += w / t**2
            A[i + 1, j, j + 2] -= w / t
            A[i + 1, j + 2, j] -= w / t
            A[i, j, j] += w / t**2
            U[i, j, j + 2] += w / t
            U[i, j, j] -= w / t**2
        slope[i + 1, :2] += push / t[:, None]
        slope[i, :2] -= push / t[:, None]
        e, G = self._way_errors(x)
        C = self.way.information
        B = G.swapaxes(1, 2) @ C @ G
        g = -np.einsum("nji,njk,nk->ni", G, C, e)
        own = np.array([0, 1, h])
        at, rows = i[:, None, None], own[:, None]
        A[at, rows, own] += B[:, :3, :3]
        A[at + 1, rows, own] += B[:, 3:, 3:]
        U[at, rows, own] += B[:, :3, 3:]
        slope[i[:, None], own] += g[:, :3]
        slope[i[:, None] + 1, own] += g[:, 3:]
        A[self.way.when, h, h] += self.way.certain
        slope[self.way.when, h] -= self.way.certain * self._heading_errors(x)


def _way(data: Data, params: Params, dt: Array) -> Way:
    increments = data.increments
    at = np.array([k for k, one in enumerate(increments[1:]) if one.covered > 0.5], np.int64)
    own = [increments[k + 1] for k in at]
    motion = np.array([[*one.displacement, one.turn] for one in own]).reshape(-1, 3)
    C = np.array([one.covariance for one in own]).reshape(-1, 3, 3) + LEAST * np.eye(3)
    # what no odometry covers of an interval is as uncertain as without it
    rest = dt[at] * np.array([1 - one.covered for one in own])
    for j in (0, 1):
        C[:, j, j] += (rest * params.speed_std) ** 2
    C[:, 2, 2] += rest * params.heading_walk**2
    when = np.array([k for k, one in enumerate(increments) if np.isfinite(one.heading)], np.int64)
    value = np.array([increments[k].heading for k in when])
    certain = 1 / np.maximum([increments[k].heading_variance for k in when], LEAST)
    return Way(at, motion, np.linalg.inv(C), when, value, np.asarray(certain))

"""Particles, what is believed before the first range, and what a carrying object looks like."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri

from ...models.motion import constant_velocity, motion_noise
from ...models.records import Array
from ...models.uwb import device_position
from .links import NO_LINKS, Links, Network
from .odometry import Increment
from .params import Params, Ranges

_log = logging.getLogger(__name__)


class Event(NamedTuple):
    """Links of one time [ns], with the anchors' positions (J, 3) at that time.

    ``moved`` is what odometry tells of the time since the event before; ``differences`` are of
    distances to two anchors.
    """

    time_ns: int
    anchors: Array
    active: Links
    passive: Links
    moved: Increment | None = None
    differences: Links = NO_LINKS


@dataclass(frozen=True, slots=True)
class Target:
    """What a carrying object looks like to the links.

    ``extent`` names its variables [m]; ``prior`` (low, high) and ``walk`` give, for each, the
    uniform prior and the random walk per 0.1 s. ``log_likelihood(state, anchors, links, excess,
    params)`` is (N,), with ``excess`` as :func:`excess` gives it. ``axes`` are the rows of
    ``extent`` that are semi-axes of the shape ``kind``.
    """

    extent: tuple[str, ...]
    prior: Callable[[Any], Array]
    walk: Callable[[Any], Array]
    log_likelihood: Callable[[State, Array, Links, tuple[Array, Array], Any], Array]
    kind: str = ""
    axes: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Particles ``y`` (dx, N), one variable a row, and their weights ``w`` (N,).

    The rows are x y vx vy b_rho b_phi, the extent, and the height of device and object. ``mean``
    (N, D) and ``covariance`` (N, D, D) are what ranges have too much, see
    :mod:`.kernels.range_error`. The offset of the device has not moved for ``hidden`` [s]: no line
    of sight has shown it since, and its random walk is drawn when one does. Where odometry tells,
    ``heading`` (N,) [rad] is that of the body; otherwise it is empty.
    """

    y: Array
    w: Array
    mean: Array
    covariance: Array
    hidden: float = 0.0
    heading: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def device(self) -> Array:
        """Positions of the device (2, N), eq. (3)."""
        if not self.y[4].any():
            return self.y[:2]
        return np.ascontiguousarray(device_position(self.y[:2].T, self.y[4], self.y[5]).T)


class Step(NamedTuple):
    """The state at a time [ns], and how likely its ranges were.

    ``evidence`` [nats] is their log predictive density, ``gain`` the same above that of clutter
    alone; ``anew`` whether the device was sought anew, and ``lost`` since when [ns] it had been
    lost then. Ranges up to ``until`` [ns] are in the state; ``moved`` is that of the event.
    """

    time_ns: int
    state: State
    evidence: float
    gain: float
    anew: bool
    until: int
    moved: Increment | None = None
    lost: int | None = None


@dataclass(frozen=True, slots=True)
class Height:
    """Gaussian belief of the device's height [m], cut off at ``low`` and ``high``; std may be inf.

    A height with ``std`` 0 is known.
    """

    mean: float
    std: float
    low: float
    high: float

    @property
    def is_known(self) -> bool:
        """Whether there is nothing to estimate."""
        return self.std == 0.0

    def draw(self, n: int, rng: np.random.Generator) -> Array:
        """``n`` draws."""
        if np.isinf(self.std):
            return rng.uniform(self.low, self.high, n)
        return np.asarray(self.mean + self.std * ndtri(rng.uniform(*self._ends(), n)))

    def _ends(self) -> tuple[float, float]:
        """Cumulative probability of the Gaussian at both ends."""
        low, high = (ndtr((end - self.mean) / self.std) for end in (self.low, self.high))
        return float(low), float(high)

    def fold(self, h: Array) -> Array:
        """Heights reflected at both ends."""
        h = self.low + np.abs(h - self.low)
        return np.asarray(np.where(h > self.high, np.maximum(2 * self.high - h, self.low), h))

    def log_density(self, h: Array) -> Array:
        """Log density [1/m], minus infinity outside."""
        inside = (h >= self.low) & (h <= self.high)
        if np.isinf(self.std):
            return np.where(inside, -np.log(self.high - self.low), -np.inf)
        low, high = self._ends()
        peak = -np.log(np.sqrt(2 * np.pi) * self.std * (high - low))
        return np.where(inside, peak - 0.5 * ((h - self.mean) / self.std) ** 2, -np.inf)


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """What is believed of a device before the ranges of a start.

    Its height; the errors of ranges, ``mean`` (D,) and ``covariance`` (D, D); and position and
    velocity, ``motion`` a Gaussian (4,), (4, 4), or None: anywhere in reach of an anchor. Offset
    and extent are ``carried`` as mean and standard deviation (2 + E,), or uniform. Where there is
    an ``alternative`` (D, D) to the covariance, both are equally likely.
    """

    height: Height
    mean: Array
    covariance: Array
    motion: tuple[Array, Array] | None = None
    carried: tuple[Array, Array] | None = None
    alternative: Array | None = None


def belief(net: Network, params: Params) -> Belief:
    """What parameters and anchors say before the first range."""
    J = len(net.sensors)
    D = 1 + J if params.is_biased else 0
    P, alternative = np.zeros((D, D)), None
    if D:
        P[0, 0] = params.range_scale_std**2
        if params.range_bias_std > 0:
            P[1:, 1:] = params.range_bias_std**2 + params.range_bias_spread**2 * np.eye(J)
        if params.range_error == "either":
            alternative = P.copy()
            alternative[1:, 1:] = params.range_bias_spread**2 * np.eye(J)
            P[0, 0] = 0.0
    return Belief(first_height(net, params), np.zeros(D), P, alternative=alternative)


def first_height(net: Network, params: Ranges) -> Height:
    """What parameters and anchors say of the height before the first range."""
    told, std = params.device_height, params.device_height_std
    z = np.concatenate([s.position[:, 2] for s in net.sensors])
    low = min(0.0, float(z.min()))
    if told is not None:
        return Height(told, std, min(low, told), np.inf)
    if net.has_heights:
        high = max(0.0, float(z.max()))
        return Height((low + high) / 2, np.inf, low, high)
    return Height(0.0, std, 0.0, np.inf)


def moments(state: State, dt: float, params: Params) -> tuple[Array, Array]:
    """Mean (4,) and covariance (4, 4) of the device's motion after ``dt`` [s].

    A velocity that has become wider than at first has been forgotten: it is as at first.
    """
    x = np.vstack((state.device, state.y[2:4]))
    mean = x @ state.w
    d = x - mean[:, None]
    F, _ = constant_velocity(dt)
    P = F @ ((state.w * d) @ d.T) @ F.T + motion_noise(params.acceleration_std, dt)
    mean = F @ mean
    most = params.speed_std**2
    if P[2:, 2:].trace() > 2 * most:
        P[:2, 2:] = P[2:, :2] = 0.0
        P[2:, 2:], mean[2:] = most * np.eye(2), 0.0
    return mean, P + 1e-9 * np.eye(4)

"""Particle filter for a device that an object carries among UWB anchors.

The filter of Zhu et al., "Multi-Sensor Fusion of Active and Passive Measurements for Extended
Object Tracking": each particle carries all variables, ``y = (p, v, b_rho, b_phi, extent)`` and a
constant range bias. What the object looks like to the links is a :class:`Target`; the modules
``eopda_geo``, ``eopda_ideal`` and ``ap_pda`` say it.

A step is: predict motion and extent; weigh by the passive links, which see only the object;
resample; turn the device about the object by a proposal that looks at its lines of sight; weigh by
the active links; extract; resample. The first step samples its posterior by tempering, from a prior
that knows the anchors' bounding box and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import pi, sqrt
from typing import Any

import numpy as np
from scipy.special import ndtr

from ...models.errors import EstimatorError
from ...models.motion import constant_velocity
from ...models.records import Array, Estimates, Meta, Objects, Recording, Scan
from ...models.uwb import device_position
from .kernels.compiled.bias_proposal import propose_bias
from .links import Links, Network, link_steps, network
from .params import Params
from .resampling import effective_sample_size, normalise, systematic
from .tempering import temper

STEP = 0.1
"""Time [s] to which the standard deviations of the random walks refer."""
GUARD = 4.0
"""Weight of ranges that are not the line of sight in the proposal, in units of clutter."""
SHRINKAGE = 0.1
"""Kernel width that keeps the constant range bias alive, see :func:`reduce`."""


@dataclass(frozen=True, slots=True)
class Target:
    """What a carrying object looks like to the links.

    ``extent`` names its variables [m]; ``prior`` (low, high) and ``walk`` give, for each, the
    uniform prior and the random walk per 0.1 s. ``log_likelihood(y, device, anchors, links,
    params)`` is (N,) for particles ``y`` and devices (2, N). ``axes`` are the rows of ``extent``
    that are semi-axes of the shape ``kind``.
    """

    extent: tuple[str, ...]
    prior: Callable[[Any], Array]
    walk: Callable[[Any], Array]
    log_likelihood: Callable[[Array, Array, Array, Links, Any], Array]
    kind: str = ""
    axes: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Particles ``y`` (dx, N), one variable a row, and their weights ``w`` (N,).

    The rows are x y vx vy b_rho b_phi, the extent, and the range bias.
    """

    y: Array
    w: Array

    @property
    def device(self) -> Array:
        """Positions of the device (2, N), eq. (3)."""
        return np.ascontiguousarray(device_position(self.y[:2].T, self.y[4], self.y[5]).T)


def init(
    net: Network, target: Target, links: Sequence[Links], params: Params, rng: np.random.Generator
) -> State:
    """Draws from the posterior of the first links."""
    low, high = (params.area[:2], params.area[2:]) if params.area else _box(net, params)
    low, high = np.asarray(low), np.asarray(high)
    b_low, b_high = params.bias_prior if params.has_object else (0.0, 0.0)
    e_low, e_high = target.prior(params)

    def prior(x: Array) -> State:
        u = ndtr(x)
        y = np.empty_like(x)
        y[:2] = low[:, None] + (high - low)[:, None] * u[:2]
        y[2:4] = params.speed_std * x[2:4]
        y[4] = b_low + (b_high - b_low) * u[4]
        y[5] = 2 * pi * u[5]
        y[6:-1] = e_low[:, None] + (e_high - e_low)[:, None] * u[6:-1]
        y[-1] = params.range_bias + params.range_bias_std * x[-1]
        return State(y, np.full(y.shape[1], 1 / y.shape[1]))

    def log_likelihood(x: Array) -> Array:
        state = prior(x)
        parts = [_log_likelihood(state, net, target, part, params) for part in links]
        return np.asarray(sum(parts))

    return prior(temper(log_likelihood, 7 + len(target.extent), params.particles, rng))


def predict(
    state: State, dt: float, target: Target, params: Params, rng: np.random.Generator
) -> State:
    """Move centre and extent over ``dt`` [s]; the bias waits for :func:`turn`."""
    F, G = constant_velocity(dt)
    y = state.y.copy()
    n, walk = y.shape[1], sqrt(dt / STEP)
    acceleration = params.acceleration_std / walk if dt > 0 else 0.0
    y[:4] = F @ y[:4] + G @ (acceleration * rng.normal(size=(2, n)))
    noise = rng.normal(size=(len(target.extent), n))
    y[6:-1] = np.abs(y[6:-1] + walk * target.walk(params)[:, None] * noise)
    return replace(state, y=y)


def turn(
    state: State, net: Network, links: Links, dt: float, params: Params, rng: np.random.Generator
) -> State:
    """Move the bias over ``dt`` [s] by its random walk, with an eye on the lines of sight.

    See :mod:`echoset.estimators.eopda.kernels.bias_proposal`; without links it is the random walk.
    """
    if not params.has_object:
        return state
    n, walk = state.y.shape[1], sqrt(dt / STEP)
    tries = 1 if links.empty else params.candidates
    length = np.abs(state.y[4] + walk * params.bias_distance_std * rng.normal(size=(tries, n)))
    angle = state.y[5] + walk * params.bias_angle_std * rng.normal(size=(tries, n))
    centre, shift = state.y[:2], state.y[-1]
    floor, pick = GUARD * params.clutter, rng.random(n)
    y = state.y.copy()
    y[4], y[5], correction = propose_bias(
        centre, shift, length, angle, pick, net.anchors, *links[1:], floor, params.los
    )
    return State(y, _weights(state.w, correction))


def update(state: State, net: Network, target: Target, links: Links, params: Params) -> State:
    """Weigh the particles by the ranges of ``links``."""
    return replace(state, w=_weights(state.w, _log_likelihood(state, net, target, links, params)))


def reduce(state: State, params: Params, rng: np.random.Generator) -> State:
    """Resample where less than half of the particles are effective.

    A constant range bias is drawn from a kernel about the survivors that keeps mean and variance.
    Liu and West, "Combined parameter and state estimation", Sequential Monte Carlo Methods (2001).
    """
    n = len(state.w)
    if effective_sample_size(state.w) >= n / 2:
        return state
    y = state.y[:, systematic(state.w, rng.random(), n)]
    if params.range_bias_std > 0:
        mean, std = y[-1].mean(), y[-1].std()
        y[-1] = mean + sqrt(1 - SHRINKAGE**2) * (y[-1] - mean)
        y[-1] += SHRINKAGE * std * rng.normal(size=n)
    return State(y, np.full(n, 1 / n))


def extract(state: State, time_ns: int, target: Target, params: Params) -> Estimates:
    """Mean and covariance of the particles; b_phi is averaged on the circle.

    Bias and extent are left out where there is no object, the range bias where it is fixed.
    """
    names = ["x", "y", "vx", "vy"]
    units = ["m", "m", "m s-1", "m s-1"]
    rows = list(range(4))
    if params.has_object:
        names += ["b_rho", "b_phi", *target.extent]
        units += ["m", "rad", *("m" for _ in target.extent)]
        rows = list(range(len(state.y) - 1))
    if params.range_bias_std > 0:
        names, units, rows = [*names, "range_bias"], [*units, "m"], [*rows, len(state.y) - 1]
    y, w = np.vstack((state.y[rows], state.device)), state.w
    mean = y @ w
    d = y - mean[:, None]
    if params.has_object:
        mean[5] = np.arctan2(np.sin(y[5]) @ w, np.cos(y[5]) @ w)
        d[5] = np.remainder(y[5] - mean[5] + pi, 2 * pi) - pi
    kind = target.kind if params.has_object else ""
    covariance = (w * d) @ d.T
    if not np.isfinite(covariance).all():
        raise EstimatorError("the estimate is not finite")
    axes = mean[[6 + k for k in target.axes]][None] if kind else None
    objects = Objects(
        np.array([time_ns], np.int64),
        np.array([0, 1], np.int64),
        np.zeros(1, np.int64),
        (*names, "device_x", "device_y"),
        (*units, "m", "m"),
        mean[None],
        covariance=(covariance + covariance.T)[None] / 2,
        existence=np.ones(1),
        extent_kind=kind,
        semi_axes=axes,
        rotation=None if axes is None else np.zeros(1),
    )
    steps = {
        "cardinality_mean": np.ones(1),
        "cardinality_variance": np.zeros(1),
        "effective_sample_size": np.array([effective_sample_size(w)]),
    }
    return Estimates(Meta(""), objects, steps)


@dataclass(frozen=True, slots=True)
class DeviceFilter:
    """An estimator: the filter for a ``target``, with or without the passive links."""

    SUMMARY: str
    Params: type[Any]
    target: Target
    passive: bool = True
    STREAMS: tuple[str, ...] = ("uwb",)
    PRESETS: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def estimate(
        self, setup: Recording, scans: Iterable[Scan], params: Any, rng: np.random.Generator
    ) -> Iterator[Estimates]:
        """Yield the estimate of each time at which the network has a link event."""
        net = network(
            setup,
            params.device,
            params.rms_bandwidth,
            params.amplitude_threshold,
            params.sigma,
        )
        state, last = None, 0
        for time_ns, links in link_steps(net, scans):
            try:
                state = self._step(state, net, (time_ns - last) * 1e-9, links, params, rng)
                yield extract(state, time_ns, self.target, params)
                state = reduce(state, params, rng)
            except EstimatorError as error:
                raise EstimatorError(
                    f"{setup.meta.name}: at {time_ns * 1e-9:g} s: {error}"
                ) from None
            last = time_ns

    def _step(
        self,
        state: State | None,
        net: Network,
        dt: float,
        links: tuple[Links, Links],
        params: Any,
        rng: np.random.Generator,
    ) -> State:
        active, passive = links
        target = self.target
        if state is None:
            return init(net, target, links if self.passive else (active,), params, rng)
        state = predict(state, dt, target, params, rng)
        if self.passive and not passive.empty:
            state = update(state, net, target, passive, params)
            state = state if active.empty else reduce(state, params, rng)
        state = turn(state, net, active, dt, params, rng)
        return state if active.empty else update(state, net, target, active, params)


def _box(net: Network, params: Params) -> tuple[Array, Array]:
    """The anchors' bounding box; where it has no width, as far as an echo could reach."""
    low, high = net.anchors.min(0), net.anchors.max(0)
    flat = (high <= low) * params.max_range / 2
    return low - flat, high + flat


def _log_likelihood(
    state: State, net: Network, target: Target, links: Links, params: Params
) -> Array:
    return target.log_likelihood(state.y, state.device, net.anchors, links, params)


def _weights(w: Array, log_factor: Array) -> Array:
    with np.errstate(divide="ignore"):
        return normalise(np.log(w) + log_factor)

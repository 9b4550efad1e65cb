"""Where the device is, from nothing but a few ranges: the start, and any start anew.

The events of a window, of a second at most, are explained by one motion at constant velocity. Its
prior is uniform wherever an anchor could hear the device (or what was known before a pause). It is
proposed from a mixture of the modes of the ranges' likelihood (:mod:`.modes`), of rings about the
anchors, and of the prior itself; what comes out is weighed by prior, likelihood and proposal and
tempered. So one anchor gives a ring, two or collinear ones two modes, and three a point.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np
from scipy.special import logsumexp, ndtr, ndtri

from ....models.motion import STEP
from ....models.records import Array
from ....models.uwb import Region
from ..links import Links
from ..params import Params
from ..state import Belief, Event, State, Target
from ..weighing import weigh_active, weigh_differences, weigh_object
from .modes import Modes, Ranges, modes
from .tempering import temper

SPAN = 1.0
"""Longest time [s] from which a start is made."""
SHARES = (0.6, 0.25, 0.15)
"""Shares of modes, rings and prior in the proposal."""
WIDER = 2.0
"""Factor of the covariances of modes in the proposal."""
MARGIN = 1.25
"""Reach of an anchor in units of the largest range."""


def start(
    events: Sequence[Event],
    target: Target,
    params: Params,
    before: Belief,
    rng: np.random.Generator,
) -> tuple[list[State], float]:
    """The state at each event, given all of them, and the log-likelihood of all.

    Raises
    ------
    EstimatorError : nothing that was believed explains the ranges
    """
    problem = _Problem(events, target, params, before)
    x = problem.propose(params.particles, rng)
    swing = problem.swing if params.has_object and before.carried is None else None
    x, log_z = temper(problem.log_posterior, problem.log_proposal, x, rng, swing)
    # neighbours stay neighbours when resampled, so that modes of equal weight do not drift
    x = x[:, np.lexsort((x[1], x[0]))]
    _, last = problem.weigh(x)
    states = []
    for event in events:
        age = (events[-1].time_ns - event.time_ns) * 1e-9
        y = last.y.copy()
        y[:2] -= age * y[2:4]
        q = params.acceleration_std**2 * STEP
        y[:2] += np.sqrt(q * age**3 / 3) * rng.normal(size=(2, x.shape[1]))
        states.append(replace(last, y=y))
    return states, log_z


@dataclass(slots=True, eq=False)
class _Problem:
    """Coordinates x: position and velocity of the device at the last event, its height unless
    known; offset and extent as standard normal variables, and one whose sign chooses between
    alternatives."""

    events: Sequence[Event]
    target: Target
    params: Params
    before: Belief
    region: Region
    area: float
    circles: Ranges
    modes: Modes

    def __init__(
        self, events: Sequence[Event], target: Target, params: Params, before: Belief
    ) -> None:
        self.events, self.target, self.params, self.before = events, target, params, before
        z = np.concatenate([e.active.z for e in events] + [e.passive.z for e in events])
        assert params.max_range is not None
        farthest = max(float(z.max(initial=0.0)), 1e-3)
        reach = params.max_range if not len(z) else MARGIN * farthest
        if farthest <= params.max_range:
            # a device that has gone farther than was guessed from the first ranges is not cut off
            reach = min(reach, params.max_range)
        corners = np.concatenate([e.anchors[:, :2] for e in events])
        self.region = Region(np.unique(corners, axis=0), reach, params.area)
        self.area = self.region.area()
        ranges = _ranges(events, params, before)
        self.circles = Ranges(*(column[ranges.are_ranges] for column in ranges))
        h = before.height
        wide = h.std if np.isfinite(h.std) else (h.high - h.low) / 2
        height = (h.mean, wide) if np.isfinite(h.std) else (h.low, wide)
        self.modes = modes(ranges, params.clutter, params.speed_std, height, reach)

    @property
    def motion(self) -> int:
        """Number of coordinates of motion and height."""
        return 4 if self.before.height.is_known else 5

    def propose(self, n: int, rng: np.random.Generator) -> Array:
        """Draws (dimension, n) of the proposal."""
        shares = self._shares()
        kind = np.searchsorted(np.cumsum(shares), rng.random(n) * sum(shares))
        x = np.concatenate((self._prior_motion(n, rng), rng.normal(size=(self._others(), n))))
        rows = self.motion
        if shares[0]:
            k = rng.choice(len(self.modes.share), n, p=self.modes.share)
            root = np.linalg.cholesky(WIDER * self.modes.covariance[:, :rows, :rows])
            draw = np.einsum("nij,jn->in", root[k], rng.normal(size=(rows, n)))
            x[:rows] = np.where(kind == 0, self.modes.mean[k, :rows].T + draw, x[:rows])
        if shares[1]:
            m = rng.integers(0, len(self.circles.z), n)
            radius, std = self._rings()
            r = np.abs(radius[m] + std[m] * rng.normal(size=n))
            angle = 2 * pi * rng.random(n)
            ring = self.circles.anchor[m, :2].T + r * np.stack((np.cos(angle), np.sin(angle)))
            x[:2] = np.where(kind == 1, ring, x[:2])
        return x

    def log_proposal(self, x: Array) -> Array:
        """Log density (n,) of the proposal."""
        shares, rows = self._shares(), self.motion
        height = self._log_height(x)
        prior = self._log_prior_motion(x) + height
        parts = [np.log(shares[2]) + prior]
        if shares[0]:
            d = x[:rows].T - self.modes.mean[:, None, :rows]
            P = WIDER * self.modes.covariance[:, :rows, :rows]
            square = (d * np.linalg.solve(P, d.swapaxes(1, 2)).swapaxes(1, 2)).sum(-1)
            peak = -0.5 * (rows * np.log(2 * pi) + np.linalg.slogdet(P)[1])
            peak += np.log(self.modes.share) + np.log(shares[0])
            parts.append(logsumexp(peak[:, None] - square / 2, axis=0))
        if shares[1]:
            radius, std = self._rings()
            r = np.linalg.norm(x[:2].T - self.circles.anchor[:, None, :2], axis=-1)
            t = (r - radius[:, None]) / std[:, None]
            near = -0.5 * t**2 - np.log((2 * pi) ** 1.5 * std[:, None] * np.maximum(r, 1e-9))
            ring = logsumexp(near, axis=0) - np.log(len(radius)) + np.log(shares[1])
            parts.append(ring + self._log_velocity(x) + height)
        return np.asarray(logsumexp(parts, axis=0) - 0.5 * (x[rows:] ** 2).sum(0))

    def swing(self, x: Array, rng: np.random.Generator) -> tuple[Array, Array]:
        """The device anywhere else about a centre that stays, and the log Jacobian (n,).

        A device on the wrong side of its object, whose place the reflections tell, is a mode of its
        own, with less room about the right one.
        """
        y, row = x.copy(), self.motion + 1
        share = (ndtr(x[row]) + rng.random(x.shape[1])) % 1.0
        y[row] = ndtri(np.clip(share, 1e-12, 1 - 1e-12))
        offsets = []
        for own in (x, y):
            d, angle = self._offset_and_extent(
                own[self.motion : self.motion + 2 + len(self.target.extent)]
            )[:2]
            offsets.append(d * np.stack((np.cos(angle), np.sin(angle))))
        y[:2] += offsets[1] - offsets[0]
        return y, (y[row] ** 2 - x[row] ** 2) / 2

    def log_posterior(self, x: Array) -> Array:
        """Log of prior times likelihood (n,)."""
        prior = self._log_prior_motion(x) + self._log_height(x)
        prior = prior - 0.5 * (x[self.motion :] ** 2).sum(0)
        likely, _ = self.weigh(x)
        return np.asarray(prior + likely)

    def weigh(self, x: Array) -> tuple[Array, State]:
        """Log-likelihood (n,) of all events, and the state at the last."""
        state, now = self.state(x), self.events[-1].time_ns
        total = np.zeros(x.shape[1])
        for event in self.events:
            age = (now - event.time_ns) * 1e-9
            y = state.y.copy()
            y[:2] -= age * y[2:4]
            moved = replace(state, y=y)
            if not event.passive.empty:
                links = _blurred(event.passive, age, self.params)
                total += weigh_object(moved, event.anchors, links, self.target, self.params)
            if not event.active.empty:
                links = _blurred(event.active, age, self.params)
                own, moved = weigh_active(moved, event.anchors, links, self.target, self.params)
                total += own
                state = replace(state, mean=moved.mean, covariance=moved.covariance)
            if not event.differences.empty:
                links = _blurred(event.differences, age, self.params)
                moved = replace(moved, mean=state.mean, covariance=state.covariance)
                own, moved = weigh_differences(moved, event.anchors, links, self.params)
                total += own
                state = replace(state, mean=moved.mean, covariance=moved.covariance)
        return total, state

    def state(self, x: Array) -> State:
        """The particles at the last event, before it is weighed."""
        n, params, before = x.shape[1], self.params, self.before
        E = len(self.target.extent)
        y = np.zeros((7 + E, n))
        y[:4] = x[:4]
        y[-1] = before.height.mean if before.height.is_known else x[4]
        if params.has_object:
            y[4:-1] = self._offset_and_extent(x[self.motion : self.motion + 2 + E])
            y[:2] -= y[4] * np.stack((np.cos(y[5]), np.sin(y[5])))
        mean = np.tile(before.mean, (n, 1))
        covariance = np.tile(before.covariance, (n, 1, 1))
        if before.alternative is not None:
            covariance[x[-1] > 0] = before.alternative
        return State(y, np.full(n, 1 / n), mean, covariance)

    def _offset_and_extent(self, u: Array) -> Array:
        """Offset and extent (2 + E, n) from standard normal variables."""
        if self.before.carried is not None:
            mean, std = self.before.carried
            own = mean[:, None] + std[:, None] * u
            return np.concatenate((np.abs(own[:1]), own[1:2], np.abs(own[2:])))
        low, high = self.target.prior(self.params)
        first, last = self.params.bias_prior
        low, high = np.append((first, 0.0), low), np.append((last, 2 * pi), high)
        return np.asarray(low[:, None] + (high - low)[:, None] * ndtr(u))

    def _others(self) -> int:
        own = 2 + len(self.target.extent) if self.params.has_object else 0
        return own + (self.before.alternative is not None)

    def _shares(self) -> tuple[float, float, float]:
        of_modes, rings, prior = SHARES
        if not len(self.circles.z):
            return (1 - prior, 0.0, prior) if len(self.modes.share) else (0.0, 0.0, 1.0)
        return (of_modes, rings, prior) if len(self.modes.share) else (0.0, 1 - prior, prior)

    def _rings(self) -> tuple[Array, Array]:
        """Radius and standard deviation (M,) of the rings about anchors in the plane."""
        rise = self.circles.anchor[:, 2] - self.before.height.mean
        radius = np.sqrt(np.maximum(self.circles.z**2 - rise**2, 0.0))
        h = self.before.height
        loose = 0.0 if h.is_known else min(h.std, h.high - h.low) / 3
        return radius, np.sqrt(2 * self.circles.variance + loose**2)

    def _prior_motion(self, n: int, rng: np.random.Generator) -> Array:
        if self.before.motion is None:
            x = np.concatenate(
                (self.region.draw(n, rng), self.params.speed_std * rng.normal(size=(2, n)))
            )
        else:
            mean, P = self.before.motion
            x = mean[:, None] + np.linalg.cholesky(P) @ rng.normal(size=(4, n))
        if self.before.height.is_known:
            return x
        return np.concatenate((x, self.before.height.draw(n, rng)[None]))

    def _log_prior_motion(self, x: Array) -> Array:
        if self.before.motion is None:
            inside = np.where(self.region.contains(x[:2]), -np.log(self.area), -np.inf)
            return np.asarray(inside + self._log_velocity(x))
        mean, P = self.before.motion
        root = np.linalg.cholesky(P)
        t = np.linalg.solve(root, x[:4] - mean[:, None])
        return np.asarray(-0.5 * (t**2).sum(0) - 2 * np.log(2 * pi) - np.log(np.diag(root)).sum())

    def _log_velocity(self, x: Array) -> Array:
        s = self.params.speed_std
        return np.asarray(-0.5 * (x[2:4] ** 2).sum(0) / s**2 - np.log(2 * pi * s**2))

    def _log_height(self, x: Array) -> Array:
        if self.before.height.is_known:
            return np.zeros(x.shape[1])
        return self.before.height.log_density(x[4])


def _blurred(links: Links, age: float, params: Params) -> Links:
    """Links with the noise that the motion gathers between them and the last event."""
    if age == 0.0:
        return links
    return links._replace(variance=links.variance + params.acceleration_std**2 * STEP * age**3 / 3)


def _ranges(events: Sequence[Event], params: Params, before: Belief) -> Ranges:
    """The active ranges and differences of the events, what they have too much on average taken
    off."""
    rows: list[tuple[Array, Array, Array, Array, Array]] = []
    for event in events:
        age = (events[-1].time_ns - event.time_ns) * 1e-9
        links = _blurred(event.active, age, params)
        rx = np.repeat(links.rx, np.diff(links.offset))
        z, v = links.z, links.variance
        if len(before.mean):
            m, P = before.mean, before.covariance
            P = P if before.alternative is None else (P + before.alternative) / 2
            z = (z - m[1 + rx]) / (1 + m[0])
            v = v + P[1 + rx, 1 + rx] + 2 * z * P[0, 1 + rx] + z**2 * P[0, 0]
        rows.append((event.anchors[rx], np.full(len(z), age), z, v, np.full((len(z), 3), np.nan)))
        links = _blurred(event.differences, age, params)
        count = np.diff(links.offset)
        of, rx = np.repeat(links.tx, count), np.repeat(links.rx, count)
        v = links.variance
        if len(before.mean):
            P = before.covariance
            v = v + P[1 + rx, 1 + rx] + P[1 + of, 1 + of] - 2 * P[1 + rx, 1 + of]
        away = event.anchors[rx], np.full(len(rx), age), links.z, v, event.anchors[of]
        rows.append(away)
    return Ranges(*(np.concatenate(column) for column in zip(*rows, strict=True)))

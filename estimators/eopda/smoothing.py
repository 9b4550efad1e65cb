"""The way back over what a UWB filter knew: each time as all ranges see it, those to come too.

Between two events everything but the ranges is linear and Gaussian: motion, walks of offset, extent
and height, and what ranges have too much, which the particles hold as Gaussians. So what a time
adds to the one before is linear in what the particles know of both, and the way back is that of
Rauch, Tung and Striebel ("Maximum likelihood estimates of linear dynamic systems", AIAA Journal 3
(1965) 1445-1450) over the moments of the clouds: the best linear smoother of them, exact where they
are Gaussian (Sarkka, "Bayesian Filtering and Smoothing", 2013, section 10.4), in a time and a
memory that do not grow with the number of particles. Where a cloud is several images of one
position, each is a Gaussian of its own, and what comes later chooses among them: C.-J. Kim,
"Dynamic linear models with Markov-switching", Journal of Econometrics 60 (1994) 1-22. Turns of
odometry are linearised over the spread of the heading. Where the device had been lost, what the
particles believed is forgotten.

A state x (d,) is the rows of a particle (:class:`~.state.State`), its heading where odometry tells,
and what ranges have too much.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from ...models.motion import STEP, constant_velocity, motion_noise, walk_std
from ...models.records import Array, Objects
from .cloud.images import images
from .extract import extract
from .filter import PAUSE, widens
from .heading import LEAST, is_told
from .odometry import Increment
from .params import Params
from .state import Belief, State, Step, Target

DRAWS = 600
"""Draws by which a smoothed Gaussian is shown; their moments are its own."""
TINY = 1e-12
"""Variance that is added where one may be zero."""
NEGLIGIBLE = 1e-6
"""Probability of an image that is left out."""
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(9)


@dataclass(frozen=True, slots=True, eq=False)
class Record:
    """What the way back needs of a step: weights w (C,) of the C images that its particles are of
    a position, one as a rule, their means m (C, d) and covariances P (C, d, d).

    ``moved`` tells, where odometry does, of the time since the step before. Ranges up to ``until``
    [ns] are in it. The filter had been lost since ``lost`` [ns], None: it had not.
    """

    time_ns: int
    w: Array
    m: Array
    P: Array
    moved: Increment | None
    until: int
    lost: int | None


@dataclass(frozen=True, slots=True, eq=False)
class Carried:
    """A step's record, smoothed, and that of the last step that was not of a start."""

    now: Record
    anchor: Record


def record(step: Step, target: Target, params: Params) -> Record:
    """The moments of a step's particles, angles about their mean on the circle."""
    s = step.state
    x = np.vstack((s.y, *([s.heading] if len(s.heading) else []), s.mean.T))
    found = []
    parts = images(s.y[:2], s.w)
    for own in parts if len(parts) > 1 else (slice(None),):
        weight = float(s.w[own].sum())
        w, y = s.w[own] / weight, x[:, own]
        m = y @ w
        d = y - m[:, None]
        for k in _angles(len(s.y), len(s.heading) > 0, params):
            m[k] = np.angle(np.exp(1j * y[k]) @ w)
            d[k] = _wrapped(y[k] - m[k])
        P = (w * d) @ d.T
        D = s.mean.shape[1]
        if D:
            P[-D:, -D:] += np.tensordot(w, s.covariance[own], 1)
        if params.has_object:
            # what the offset walked since it was seen is not in the particles yet
            P[[4, 5], [4, 5]] += walk_std(_offset_walks(params), s.hidden) ** 2
        found.append((weight, m, (P + P.T) / 2))
    weights, means, covariances = (np.array(column) for column in zip(*found, strict=True))
    return Record(step.time_ns, weights, means, covariances, step.moved, step.until, step.lost)


def smoother(
    target: Target, params: Params, first: Belief, rng: np.random.Generator
) -> Callable[[Carried | None, Record], tuple[Carried, Callable[[], Objects]]]:
    """The way back of one recording, from one record to the one before, and who shows it."""
    rows = 7 + len(target.extent)
    drawn = rng.normal(size=(rows + 1 + len(first.mean), DRAWS // 2))
    known = first.height.is_known

    def backward(later: Carried | None, now: Record) -> tuple[Carried, Callable[[], Objects]]:
        x = back(later, now, target, params, first)

        def show() -> Objects:
            shown = _cloud(x.now, rows, len(first.mean), first, drawn)
            return extract(shown, now.time_ns, target, params, known).objects

        return x, show

    return backward


def back(
    later: Carried | None, now: Record, target: Target, params: Params, first: Belief
) -> Carried:
    """What is known of a time, given what is known of the next; None: there is none."""
    lost = None if later is None else later.now.lost
    if later is None or (lost is not None and now.time_ns <= lost):
        # where it was found knows nothing of where it had been
        return Carried(now, now)
    if lost is not None:
        now = _forgotten(now, lost, target, params, first)
    elif now.time_ns < now.until and is_told(later.now.moved):
        now = _forgotten(now, None, target, params, first)
    elif now.time_ns < now.until:
        # a start explains its events by one motion: what is known of its last moves back to this
        end = later.anchor
        age = (end.time_ns - now.time_ns) * 1e-9
        A = np.eye(now.m.shape[1])
        A[[0, 1], [2, 3]] = -age
        P = A @ end.P @ A.T
        P[:, [0, 1], [0, 1]] += params.acceleration_std**2 * STEP * age**3 / 3
        return Carried(replace(now, w=end.w, m=end.m @ A.T, P=P), end)
    own = _one_step(now, later.now, target, params, len(first.mean))
    return Carried(own, own)


def _one_step(now: Record, later: Record, target: Target, params: Params, errors: int) -> Record:
    """The record of a time given that of the next, which is smoothed."""
    rows, d = 7 + len(target.extent), now.m.shape[1]
    angles = _angles(rows, d > rows + errors, params)
    dt = (later.time_ns - now.time_ns) * 1e-9
    n, C = len(later.w), len(now.w)
    log_w, m, P = np.zeros((n, C)), np.zeros((n, C, d)), np.zeros((n, C, d, d))
    for c in range(C):
        ahead, A, Q = transition(
            now.m[c], now.P[c], dt, rows, d > rows + errors, later.moved, target, params
        )
        S = A @ now.P[c] @ A.T + Q + TINY * np.eye(d)
        G = np.linalg.solve(S, A @ now.P[c]).T
        change = later.m - ahead
        change[:, angles] = _wrapped(change[:, angles])
        left = np.eye(d) - G @ A
        m[:, c] = now.m[c] + change @ G.T
        P[:, c] = left @ now.P[c] @ left.T + G @ (Q + later.P) @ G.T
        if C > 1:
            log_w[:, c] = np.log(now.w[c]) + [
                -0.5 * (e @ np.linalg.solve(S + V, e) + np.linalg.slogdet(S + V)[1])
                for e, V in zip(change, later.P, strict=True)
            ]
    w = later.w[:, None] * np.exp(log_w - log_w.max(1, keepdims=True))
    w *= (later.w / w.sum(1))[:, None]
    kept = np.flatnonzero(w.sum(0) > NEGLIGIBLE)
    w = w[:, kept] / w[:, kept].sum()
    total = w.sum(0)
    share = w / total
    mean = np.einsum("jc,jcd->cd", share, m[:, kept])
    apart = m[:, kept] - mean
    V = np.einsum("jc,jcde->cde", share, P[:, kept])
    V += np.einsum("jc,jcd,jce->cde", share, apart, apart)
    return replace(now, w=total, m=mean, P=(V + V.swapaxes(1, 2)) / 2)


def transition(
    m: Array,
    P: Array,
    dt: float,
    rows: int,
    headed: bool,
    moved: Increment | None,
    target: Target,
    params: Params,
) -> tuple[Array, Array, Array]:
    """Mean (d,) of the state ``dt`` [s] later, matrix A and noise Q (d, d) that lead there.

    A state has ``rows`` of a particle and, if ``headed``, a heading.
    """
    A, Q = np.eye(len(m)), np.zeros_like(P)
    k = np.arange(rows)
    if params.has_object:
        Q[[4, 5], [4, 5]] = walk_std(_offset_walks(params), dt) ** 2
    Q[k[6:-1], k[6:-1]] = walk_std(target.walk(params), dt) ** 2
    if P[rows - 1, rows - 1] > 0:
        Q[rows - 1, rows - 1] = params.height_walk**2 * dt
    if params.range_bias_std > 0:
        b = np.arange(rows + headed + 1, len(m))
        Q[b, b] = params.range_bias_walk**2 * dt
    if widens(dt, params) > PAUSE:
        # the filter starts anew, from where any motion may have taken it, heading anywhere
        for own in (range(4), range(rows, rows + headed)):
            A[own, own] = 0.0
            Q[own, own] = np.maximum(P[own, own], 1.0)
        return A @ m, A, Q
    if not is_told(moved) or dt <= 0:
        A[:4, :4], _ = constant_velocity(dt)
        Q[:4, :4] = motion_noise(params.acceleration_std, dt)
        if headed:
            Q[rows, rows] = params.heading_walk**2 * dt
        return A @ m, A, Q
    variance = P[rows, rows]
    h = m[rows] + np.sqrt(variance) * _NODES
    w = _WEIGHTS / _WEIGHTS.sum()
    R = np.array([[np.cos(h), -np.sin(h)], [np.sin(h), np.cos(h)]]).transpose(2, 0, 1)
    step = R @ moved.displacement / moved.covered
    mean = w @ step
    slope = (w * (h - m[rows])) @ step / max(variance, TINY)
    noise = moved.covariance + LEAST * np.eye(3)
    d = step - mean
    own = (w * d.T) @ d - variance * np.outer(slope, slope)
    own += np.einsum("i,iab,bc,idc->ad", w, R, noise[:2, :2], R)
    cross = np.tensordot(w, R, 1) @ noise[:2, 2]
    # the velocity is what odometry told, which a start may not know: it tells nothing of before
    A[2:4], A[:2, rows] = 0.0, slope
    Q[:2, :2], Q[2:4, 2:4] = own, own / dt**2
    Q[:2, rows] = Q[rows, :2] = cross
    Q[rows, rows] = noise[2, 2]
    ahead = m.copy()
    ahead[:2] += mean
    ahead[2:4] = mean / dt
    ahead[rows] += moved.turn / moved.covered
    if params.has_object:
        ahead[5] += moved.turn
    return ahead, A, Q


def _forgotten(
    now: Record, lost: int | None, target: Target, params: Params, first: Belief
) -> Record:
    """The record of a time at which nothing is known but the heading, which is odometry's: that at
    which the device was ``lost``, or one of a start, where odometry knows better how it moved."""
    rows, D = 7 + len(target.extent), len(first.mean)
    m = now.w @ now.m
    wide = np.full(len(m), pi**2 / 3)
    wide[:2], wide[2:4], m[2:4] = float(params.max_range or 0.0) ** 2, params.speed_std**2, 0.0
    low, high = target.prior(params)
    wide[4] = np.ptp(params.bias_prior) ** 2 / 12
    wide[6 : rows - 1] = (high - low) ** 2 / 12
    h = first.height
    wide[rows - 1] = min(h.std, h.high - h.low) ** 2
    P = np.diag(wide)
    if not params.has_object:
        P[4 : rows - 1] = 0.0
    if len(m) > rows + D:
        P[rows, rows] = now.w @ (now.P[:, rows, rows] + (now.m[:, rows] - m[rows]) ** 2)
    if D:
        m[-D:], P[-D:, -D:] = first.mean, first.covariance
        if first.alternative is not None:
            P[-D:, -D:] = (first.covariance + first.alternative) / 2
    return replace(now, w=np.ones(1), m=m[None], P=P[None], lost=lost)


def _cloud(x: Record, rows: int, errors: int, first: Belief, drawn: Array) -> State:
    """Particles whose moments are those of ``x``, from standard normal draws (>= d, n / 2)."""
    d = x.m.shape[1]
    unit = drawn[:d]
    # antithetic, so that the mean is zero; turned and scaled, so that the covariance is one
    unit = np.linalg.solve(np.linalg.cholesky(unit @ unit.T / unit.shape[1]), unit)
    scale, axes = np.linalg.eigh(x.P)
    spread = axes @ (np.sqrt(np.maximum(scale, 0.0))[..., None] * unit)
    y = np.hstack((*(x.m[..., None] + spread), *(x.m[..., None] - spread)))
    w = np.tile(np.repeat(x.w, unit.shape[1]), 2) / (2 * unit.shape[1])
    own = y[:rows].copy()
    own[4] = np.abs(own[4])
    own[6:-1] = np.abs(own[6:-1])
    if not first.height.is_known:
        own[-1] = first.height.fold(own[-1])
    heading = y[rows] if d > rows + errors else np.zeros(0)
    covariance = np.zeros((y.shape[1], errors, errors))
    return State(own, w, y[d - errors :].T, covariance, heading=heading)


def _offset_walks(params: Params) -> Array:
    return np.array([params.bias_distance_std, params.bias_angle_std])


def _angles(rows: int, headed: bool, params: Params) -> list[int]:
    """The rows of a state that are angles."""
    return [5] * params.has_object + [rows] * headed


def _wrapped(angle: Array) -> Array:
    return np.remainder(angle + pi, 2 * pi) - pi

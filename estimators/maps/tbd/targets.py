"""Targets one by one: their motion, and what the cells about each say of it.

The state is x y vx vy heading, log brightness and log size. A pedestrian's heading and size say
nothing; a vehicle hardly slips across its heading. The likelihood is that of the cells in a window,
tempered by the ``weight`` of a cell, as an echo's cells fluctuate together; its mode is found by
scoring (Gauss and Newton with the expected information), which also gives the covariance.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ....models.motion import white_acceleration
from ....models.records import Array
from .params import Params
from .scene import View, windows

PEDESTRIAN, VEHICLE = 0, 1
REACH = 2.5, 5.0
"""Half the size [m] of the window about a target, by class."""
SEEN = np.array([0, 1, 4, 5, 6])
"""What of the state the likelihood depends on: x, y, heading, brightness, size."""
ORDER = np.array([0, 1, 4, 5, 6, 2, 3])
"""The state as the kernels take it."""
ROUNDS = 3
STRIDE = np.array([0.5, 0.5, 2.0, 2.0, 0.3, 0.5, 0.15])
"""Longest step of the scoring in each entry."""
POSE = np.array([0, 1, 4, 6])
"""What of the state a mode may differ in: x, y, heading, size."""
VARIED = np.array([0, 1, 2, 4])
"""The same as the kernels take it."""
DOUBTED = np.array([0.07, 0.07, 0.06, 0.03])
"""Deviations [m, rad, 1] that a prediction is never surer than when modes are compared."""


def _offsets(radii: tuple[float, ...], turns: tuple[float, ...], ring: float) -> Array:
    """Offsets (n, 4) in place, heading and size: on circles, and turned, there and on a ring."""
    angle = np.arange(8) * np.pi / 4
    round_ = np.stack((np.cos(angle), np.sin(angle), np.zeros(8), np.zeros(8)), 1)
    found = [r * round_ for r in radii]
    for turn in turns:
        found += [np.array([[0.0, 0.0, turn, 0.0]]), ring * round_ + (0, 0, turn, 0)]
    return np.concatenate(found)


SIZES = np.array([[0.0, 0.0, 0.0, s] for s in (-0.25, -0.12, 0.12, 0.25)])
OFFSETS = (
    _offsets((0.15, 0.3, 0.45), (), 0.0),
    np.concatenate((_offsets((0.2, 0.4, 0.7), (-0.3, -0.12, 0.12, 0.3), 0.25), SIZES)),
)
"""How another mode of a target may differ, by class."""
NEARBY = (
    _offsets((0.3,), (), 0.0),
    np.concatenate((_offsets((0.3,), (), 0.0), [[0, 0, -0.12, 0], [0, 0, 0.12, 0]])),
)
"""What is tried in most scans."""
LEAP = 20.0
"""Tempered log-likelihood that a vehicle with one end elsewhere must have beyond others, however
sure it is: few stations hardly tell such ends."""
SEARCH = 5
"""Scans from one search of all modes to the next."""
DIM = -0.5
"""Log brightness in the mean: the cells of an echo fluctuate together, and the logarithm of an
exponential is -0.58 in the mean."""
YOUNG = 10
"""Scans in which a target is doubted more."""
GAIN = 3.0
"""Most that one scan says of existence or class, in nats."""
DOUBT = 5
"""Scans after which a class that is sure is doubted again."""
SURE = 10.0
"""Log-odds of existence and class never exceed this."""
VIEW = 3.0
"""Nor those of class this for each station that sees a target: one alone takes two pedestrians
beside each other for a vehicle, again and again."""


@dataclass(frozen=True, slots=True, eq=False)
class Targets:
    """Targets: m (n, 7), P (n, 7, 7), classes ``kind`` (n,), log-odds and labels (n,).

    ``exists`` is the log-odds of existence, ``vehicle`` those of being a vehicle, ``age`` in scans.
    """

    m: Array
    P: Array
    kind: Array
    exists: Array
    vehicle: Array
    label: Array
    age: Array

    @staticmethod
    def none() -> Targets:
        """No targets."""
        zero, whole = np.zeros(0), np.zeros(0, np.int64)
        return Targets(np.zeros((0, 7)), np.zeros((0, 7, 7)), whole, zero, zero, whole, whole)

    def __len__(self) -> int:
        return len(self.m)

    def take(self, index: Array) -> Targets:
        """The targets ``index``."""
        return Targets(*(getattr(self, name)[index] for name in self.__slots__))

    def join(self, other: Targets) -> Targets:
        """Both."""
        pairs = ((getattr(self, name), getattr(other, name)) for name in self.__slots__)
        return Targets(*map(np.concatenate, pairs))

    @property
    def vectors(self) -> Array:
        """The states (n, 7) as the kernels take them."""
        return self.m[:, ORDER]


def modes(kind: int, m: Array, params: Params) -> Array:
    """Offsets (n, 4) of all modes of a target with the state ``m`` (7,).

    A vehicle may have one end where it is and be longer or shorter at the other.
    """
    if kind == PEDESTRIAN:
        return OFFSETS[kind]
    size = SIZES[:, 3]
    reach = params.vehicle_length / 2 * np.exp(m[6]) * np.expm1(size)
    along = reach[:, None] * np.array([np.cos(m[4]), np.sin(m[4])])
    zero = np.zeros(len(size))
    ends = [np.column_stack((sign * along, zero, size)) for sign in (1, -1)]
    return np.concatenate((OFFSETS[kind], *ends))


def motion(params: Params, dt: float) -> Array:
    """How the state (7,) goes on for ``dt`` [s], but for the mean of its brightness."""
    F = np.eye(7)
    F[[0, 1], [2, 3]] = dt
    F[5, 5] = np.exp(-dt / params.brightness_time)
    F[6, 6] = np.exp(-dt / params.size_time)
    return F


def predict(targets: Targets, params: Params, dt: float) -> Targets:
    """The targets ``dt`` [s] later; brightness returns to its mean."""
    F = motion(params, dt)
    keep = F[5, 5]
    Q = np.zeros((7, 7))
    Q[:4, :4] = params.acceleration_density * white_acceleration(dt)
    Q[4, 4] = params.turn_density * dt
    Q[5, 5] = (1 - keep**2) * params.std_brightness**2
    Q[6, 6] = (1 - F[6, 6] ** 2) * params.std_size**2
    m = targets.m @ F.T
    m[:, 5] += (1 - keep) * DIM
    return replace(targets, m=m, P=F @ targets.P @ F.T + Q)


def prior(params: Params, place: Array, heading: float) -> tuple[Array, Array]:
    """Mean (7,) and covariance (7, 7) of a new target, which is refined from there."""
    m = np.array([*place, 0.0, 0.0, heading, DIM, 0.0])
    v = params.std_speed
    std = np.array([1.0, 1.0, v, v, 0.5, params.std_brightness, params.std_size])
    return m, np.diag(std**2)


def vector(m: Array) -> Array:
    """A state as the kernels take it."""
    return np.ascontiguousarray(m[ORDER])


def correct(
    view: View,
    rest: Array,
    kind: int,
    m: Array,
    P: Array,
    start: Array,
    at: Array,
    params: Params,
) -> tuple[Array, Array, float]:
    """Mean, covariance, and what the target adds to the tempered log-likelihood.

    ``m``, ``P`` are its prediction, ``start`` (7,) where the mode is looked for, ``rest`` the mean
    of the maps without it, ``at`` its windows.
    """
    prior_information = np.linalg.inv(P)
    x = start.copy()
    for _ in range(ROUNDS):
        _, g, J = view.fit(rest, kind, vector(x), at, params.shape, True)
        L, b = prior_information.copy(), -prior_information @ (x - m)
        L[np.ix_(SEEN, SEEN)] += params.weight * J
        b[SEEN] += params.weight * g
        if kind == VEHICLE:
            c, s = np.cos(x[4]), np.sin(x[4])
            slope = np.array([0.0, 0.0, -s, c, -(x[2] * c + x[3] * s), 0.0, 0.0])
            L += np.outer(slope, slope) / params.slip**2
            b -= slope * (x[3] * c - x[2] * s) / params.slip**2
        step = np.linalg.solve(L, b)
        x = x + np.clip(step, -STRIDE, STRIDE)
        if (np.abs(step[SEEN]) < 0.01).all():
            break
    P = np.linalg.inv(L)
    return x, (P + P.T) / 2, worth(view, rest, kind, x, at, params)


def worth(view: View, rest: Array, kind: int, x: Array, at: Array, params: Params) -> float:
    """What a target adds to the tempered log-likelihood, brightness and size included."""
    gain, _, _ = view.fit(rest, kind, vector(x), at, params.shape, False)
    off = ((x[5] - DIM) / params.std_brightness) ** 2 + (x[6] / params.std_size) ** 2
    return float(params.weight * gain - 0.5 * off)


def jumped(
    view: View,
    rest: Array,
    kind: int,
    m: Array,
    P: Array,
    offsets: Array,
    at: Array,
    params: Params,
    doubt: float = 1.0,
) -> tuple[Array, Array]:
    """Where to look for the mode, and the covariance of the prediction, less sure if it is far.

    The nulls between a kernel's sidelobes make modes a range bin apart. Of places, headings
    and sizes at the ``offsets`` (n, 4) the best is chosen by the tempered likelihood and a prior
    that is never surer than ``doubt`` times :data:`DOUBTED`; the covariance grows so that what is
    chosen is not improbable.
    """
    x = vector(m)
    S = P[np.ix_(POSE, POSE)] + np.diag((doubt * DOUBTED) ** 2)
    far = 0.5 * (offsets * np.linalg.solve(S, offsets.T).T).sum(1)
    far[offsets[:, :2].any(1) & (offsets[:, 3] != 0)] = LEAP
    top, best = view.fit(rest, kind, x, at, params.shape, False)[0], None
    for d, cost in zip(offsets, far / params.weight, strict=True):
        y = x.copy()
        y[VARIED] += d
        found = view.fit(rest, kind, y, at, params.shape, False)[0] - cost
        if found > top:
            top, best = found, d
    if best is None:
        return m, P
    start = m.copy()
    start[POSE] += best
    off = float(best @ np.linalg.solve(P[np.ix_(POSE, POSE)], best))
    return start, P * max(1.0, off / 3)


def update(targets: Targets, view: View, mean: Array, params: Params) -> tuple[Targets, Array]:
    """The targets given the maps of a time, one after the other, and the mean with them.

    A pedestrian is also tried as what stands there of the other class, and the other way round.
    """
    m, P = targets.m.copy(), targets.P.copy()
    exists, vehicle, kind = targets.exists.copy(), targets.vehicle.copy(), targets.kind.copy()
    for i in np.argsort(-exists, kind="stable"):
        k = int(kind[i])
        view.add(mean, -1.0, k, vector(m[i]), view.whole)
        np.maximum(mean, 1.0, out=mean)
        at = windows(view.layout, m[i, 0], m[i, 1], REACH[VEHICLE])
        near = windows(view.layout, m[i, 0], m[i, 1], REACH[k])
        age = int(targets.age[i])
        few = age > YOUNG / 2 and (age + targets.label[i]) % SEARCH
        offsets = NEARBY[k] if few else modes(k, m[i], params)
        doubt = 3.0 if age < YOUNG else 1.0
        start, S = jumped(view, mean, k, m[i], P[i], offsets, near, params, doubt)
        x, S, _ = correct(view, mean, k, m[i], S, start, near, params)
        gain = worth(view, mean, k, x, at, params)
        if abs(vehicle[i]) < SURE or targets.age[i] % DOUBT == 0:
            y, T = turned(x, S, k, params)
            y, T, other = correct(view, mean, 1 - k, y, T, y, at, params)
            odds = np.clip((other - gain) * (1 if k == PEDESTRIAN else -1), -GAIN, GAIN)
            sure = min(SURE, VIEW * np.count_nonzero(near[:, 1] > near[:, 0]))
            vehicle[i] = np.clip(vehicle[i] + odds, -sure, sure)
            if (vehicle[i] > 0) != (k == VEHICLE):
                k, x, S, gain = 1 - k, y, T, other
        kind[i] = k
        exists[i] = min(exists[i] + np.clip(gain - params.live_price, -GAIN, GAIN), SURE)
        m[i], P[i] = x, S
        view.add(mean, 1.0, k, vector(x), view.whole)
    return replace(
        targets, m=m, P=P, exists=exists, vehicle=vehicle, kind=kind, age=targets.age + 1
    ), mean


def turned(m: Array, P: Array, kind: int, params: Params) -> tuple[Array, Array]:
    """Where a target of class ``kind`` would be if it were of the other: about there."""
    m, P = m.copy(), P.copy()
    if kind == PEDESTRIAN and np.hypot(m[2], m[3]) > 0.3:
        m[4] = np.arctan2(m[3], m[2])
    m[5:] = DIM, 0.0
    P[:2, :2] += 0.5**2 * np.eye(2)
    P[4, 4] += 0.5**2
    P[5:] = P[:, 5:] = 0.0
    P[5, 5], P[6, 6] = params.std_brightness**2, params.std_size**2
    return m, P

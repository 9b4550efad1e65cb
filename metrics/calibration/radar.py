"""A radar's latency, offsets, accuracy and rates, from detections that nobody has labelled.

About each true target detections have the intensity mu N(z; h(x(t - latency)) + b, R) + rho: mu
detections of the target, and a background. Whatever detections of one target do beside each other,
their intensity is that, so that the likelihood of a Poisson process gives consistent numbers, by
expectation and maximisation over which detection is whose; standard errors by the sandwich. That a
target has any detection comes from gates that are empty, less those that would be but for clutter.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from ...models.errors import InputError
from ...models.radar.detection import polar
from ...models.records import Array, Recording
from .quantities import Calibration, Quantity, Residuals, blocks, sandwich
from .seen import GATE, SLOPE, Data, RadarParams, flat, gathered
from .tracks import Track, places, seen_from, tracks

COARSE = 0.25
"""Step [s] of the latencies that are tried first."""
ROUNDS, CLOSE = 300, 1e-7
"""Most rounds of a fit, and the change at which it ends."""
BINS = 6
"""Ranges for which the probability of detection is told."""
FEW = 20
"""Detections of targets below which nothing is said."""


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """Latency [s], offsets b (2,), log deviations (2,), detections mu of a target, density rho.

    Deviations of positions are equal; ``rho`` is per m^2.
    """

    latency: float
    b: Array
    log_std: Array
    mu: float
    rho: float

    @property
    def vector(self) -> Array:
        """All numbers (7,)."""
        return np.array([self.latency, *self.b, *self.log_std, self.mu, self.rho])

    @staticmethod
    def of(v: Array) -> Model:
        """From :attr:`vector`."""
        return Model(float(v[0]), v[1:3], v[3:5], float(v[5]), float(v[6]))


def calibrate(recordings: Sequence[Recording], name: str, params: RadarParams) -> Calibration:
    """What the radar stream ``name`` of ``recordings`` is like.

    Raises
    ------
    InputError : a recording has no truth, or too few detections are those of targets
    """
    known = tracks(recordings, params.target_height)
    latency = coarse(recordings, name, known, params)
    data = gathered(recordings, name, known, latency, params)
    if len(data.pair) < FEW:
        raise InputError(f"{name}: {len(data.pair)} detections near true targets: too few")
    model = fit(data, started(data, latency, params))
    data = gathered(recordings, name, known, model.latency, params, model.b, np.exp(model.log_std))
    model = fit(data, model)
    edges = _edges(_ranges(data)[data.alone])
    found = quantities(data, model, edges)
    halves = [data.half(0), data.half(1)]
    own = [fit(half, model) for half in halves]
    parts = [quantities(half, one, edges) for half, one in zip(halves, own, strict=True)]
    both = tuple(
        replace(q, halves=((a.value, a.stderr), (b.value, b.stderr)))
        for q, a, b in zip(found, *parts, strict=True)
    )
    nis = nis_of(halves[0], own[1]), nis_of(halves[1], own[0])
    kind = "range_bearing" if data.polar else "position"
    return Calibration(name, kind, both, settings(both), nis, residuals(data, model, edges))


def settings(found: Sequence[Quantity]) -> dict[str, object]:
    """What estimators take, from the quantities."""
    q = {one.name: one.value for one in found}
    names = ("range", "azimuth") if "std_range" in q else ("x", "y")
    std = [k for k in ("std_position", "std_range", "std_azimuth") if k in q]
    return {
        "latency": max(q["latency"], 0.0),
        "registration": [q[f"registration_{k}"] for k in names],
        **{k: q[k] for k in std},
        "p_detect": min(q["p_detect"], 0.999),
        "clutter_rate": max(q["clutter_rate"], 0.0),
    }


def coarse(
    recordings: Sequence[Recording], name: str, known: Sequence[Track], params: RadarParams
) -> float:
    """The latency on a grid at which detections lie best about the targets."""
    grid = np.arange(params.latency_min, params.latency_max + COARSE / 2, COARSE)
    middle = float(grid[len(grid) // 2])
    # Far enough for the targets of any latency, and one set of pairs for all.
    wide = replace(params, reach=params.reach + _fastest(known) * float(np.ptp(grid)) / 2)
    data = gathered(recordings, name, known, middle, wide, slack=float(np.ptp(grid)) / 2)
    best = []
    for latency in grid.tolist():
        e = data.errors(data.expected(latency), np.zeros(2))
        d2 = _plain(data, e)
        best.append(np.exp(-d2 / (2 * (params.reach / 3) ** 2)).sum())
    return float(grid[int(np.argmax(best))])


def _fastest(known: Sequence[Track]) -> float:
    speed = [np.hypot(*np.diff(one.position[:, :2], axis=0).T) / np.diff(one.time) for one in known]
    return float(np.quantile(np.concatenate(speed), 0.95)) if speed else 0.0


def _plain(data: Data, e: Array) -> Array:
    """Squared distances (C,) [m^2] of errors."""
    return np.asarray((e**2 * np.stack((np.ones(len(e)), data.measure**2), 1)).sum(1))


def started(data: Data, latency: float, params: RadarParams) -> Model:
    """A model to begin with: wide, of medium density."""
    e = data.errors(data.expected(latency), np.zeros(2))
    r = data.measure
    std = params.reach / 6
    across = std / np.median(r) if data.polar else std
    share = max(len(e) / max(len(data.pair_scan), 1), 1e-3)
    rho = 0.3 * len(np.unique(data.detection)) / max(data.area.sum(), 1e-9)
    return Model(latency, np.zeros(2), np.log([std, across]), min(0.7, share), rho)


def weights(data: Data, model: Model, e: Array) -> tuple[Array, Array]:
    """How surely (C,) candidates are the target's, and their squared distances in deviations."""
    d2 = (e**2 * np.exp(-2 * model.log_std)).sum(1)
    density = model.mu * np.exp(-d2 / 2 - model.log_std.sum()) / (2 * pi)
    total = np.bincount(data.detection, density, len(data.z))
    rho = model.rho * data.measure
    return density / (total[data.detection] + rho), d2


def fit(data: Data, model: Model) -> Model:
    """The model of greatest likelihood, from one that is near."""
    P, area = max(int(data.inside.sum()), 1), max(float(data.area.sum()), 1e-9)
    n = len(np.unique(data.detection))
    for _ in range(ROUNDS):
        h = data.expected(model.latency)
        slope = data.slope(model.latency)
        e = data.errors(h, model.b)
        w, _ = weights(data, model, e)
        total = w.sum()
        if total < 1:
            break
        # Weighted least squares for latency and offsets.
        J = np.zeros((len(e), 2, 3))
        J[:, :, 0], J[:, :, 1:] = slope, np.eye(2)
        V = np.exp(-2 * model.log_std)
        A = np.einsum("cak,ca,cal,c->kl", J, np.tile(V, (len(e), 1)), J, w)
        g = np.einsum("cak,ca,ca,c->k", J, np.tile(V, (len(e), 1)), e, w)
        change = np.linalg.lstsq(A, g, rcond=1e-9)[0]
        change[0] = np.clip(change[0], -0.5, 0.5)
        rest = e - J @ change
        variance = w @ rest**2 / total
        if not data.polar:
            variance = np.full(2, variance.mean())
        new = Model(
            model.latency + float(change[0]),
            model.b + change[1:],
            np.log(np.maximum(variance, 1e-12)) / 2,
            float(w @ data.inside[data.pair]) / P,
            max((n - total) / area, 1e-12),
        )
        moved = np.abs(new.vector - model.vector) / (1 + np.abs(model.vector))
        model = new
        if moved.max() < CLOSE:
            break
    return model


def scores(data: Data, model: Model, p: Array, edges: Array, clutter: float) -> Array:
    """Equations (K, q) that sum up to zero at the right numbers.

    Those are the model, the shares p of targets detected, in all and by range, and the mean number
    of false detections.
    """
    K = len(data.scan_time)
    slope = data.slope(model.latency)
    h = data.expected(model.latency)
    e = data.errors(h, model.b)
    w, d2 = weights(data, model, e)
    V = np.exp(-2 * model.log_std)
    scan = data.pair_scan[data.pair]

    def by_scan(values: Array) -> Array:
        return np.bincount(scan, values, K)

    pairs = np.bincount(data.pair_scan, data.inside, K)
    own = by_scan(w)
    taken = np.bincount(data.detection, w, len(data.z))
    seen = np.unique(data.detection)
    free = np.bincount(data.scan[seen], 1 - taken[seen], K)
    found = np.bincount(data.scan, minlength=K)
    wide = by_scan(w * (e**2 * V)[:, 0]) - own, by_scan(w * (e**2 * V)[:, 1]) - own
    if not data.polar:
        # One deviation: the second equation keeps both equal.
        gap = model.log_std[1] - model.log_std[0]
        wide = wide[0] + wide[1], np.full(K, gap)
    columns = [
        by_scan(w * (slope * e * V).sum(1)),
        by_scan(w * e[:, 0] * V[0]),
        by_scan(w * e[:, 1] * V[1]),
        *wide,
        by_scan(w * data.inside[data.pair]) - model.mu * pairs,
        free - model.rho * data.area,
        found - own - clutter,
    ]
    return np.stack((*columns, *_empty(data, model, d2, h, p, edges)), 1)


def _empty(data: Data, model: Model, d2: Array, h: Array, p: Array, edges: Array) -> list[Array]:
    """Equations (K,) for the shares p of targets detected, all of them and by range.

    A gate is empty of the target's own and of the background, which are independent.
    """
    K, P = len(data.scan_time), len(data.pair_scan)
    r = _ranges(data)
    caught = np.bincount(data.pair, d2 < GATE, P) > 0
    measure = r if data.polar else np.ones(P)
    gate = GATE * pi * np.exp(model.log_std.sum()) * measure
    missed = np.where(caught, 0.0, np.exp(model.rho * gate))
    # All but exp(-GATE / 2) of the target's own are in the gate.
    inside = 1 - np.exp(-GATE / 2)
    out = []
    for k, share in enumerate(p):
        chosen = data.alone.copy()
        if k:
            chosen &= (r >= edges[k - 1]) & (r < edges[k])
        out.append(np.bincount(data.pair_scan, chosen * (1 - inside * share - missed), K))
    return out


def _ranges(data: Data) -> Array:
    """Range (P,) [m] of the targets."""
    time = np.array(data.scan_time[data.pair_scan])
    x = places(data.known, data.pair_track, time)
    local = seen_from(data.sensors, data.recording[data.pair_scan], time, x)
    return np.asarray(np.linalg.norm(local, axis=1))


def _edges(r: Array) -> Array:
    """Ends of ranges (BINS + 1,) that hold as many targets."""
    edges = np.quantile(r, np.linspace(0, 1, BINS + 1)) if len(r) else np.zeros(BINS + 1)
    edges[-1] = np.nextafter(edges[-1], np.inf)
    return np.asarray(edges)


def solved(data: Data, model: Model, edges: Array) -> tuple[Array, Array]:
    """All numbers (q,) with their covariance (q, q), by range between the ``edges``."""
    p = np.zeros(BINS + 1)
    at_zero = scores(data, model, p, edges, 0.0).sum(0)
    per_p = at_zero - scores(data, model, p + 1, edges, 0.0).sum(0)
    p = at_zero[8:] / np.where(per_p[8:] > 0, per_p[8:], np.nan)
    clutter = at_zero[7] / max(len(data.scan_time), 1)
    p = np.nan_to_num(p)
    theta = np.concatenate((model.vector, [clutter], p))

    def equations(x: Array) -> Array:
        return scores(data, Model.of(x[:7]), x[8:], edges, float(x[7]))

    std = np.exp(model.log_std)
    step = np.concatenate(
        (
            [0.01],
            0.02 * std,
            [0.02, 0.02],
            [0.02 * model.mu],
            [0.02 * model.rho],
            [0.1],
            0 * p + 0.1,
        )
    )
    block = blocks(len(data.scan_time))
    return theta, sandwich(equations, theta, step, block)


def quantities(data: Data, model: Model, edges: Array) -> list[Quantity]:
    """The numbers that are told, with standard errors; infinite ones where data tell nothing."""
    theta, cov = solved(data, model, edges)
    se = np.sqrt(np.maximum(np.diag(cov), 0.0))
    se = np.where(se > 0, se, np.inf)
    axes = (("range", "m"), ("azimuth", "rad")) if data.polar else (("x", "m"), ("y", "m"))
    found = [Quantity("latency", "s", theta[0], se[0])]
    found += [
        Quantity(f"registration_{axis}", unit, theta[1 + k], se[1 + k])
        for k, (axis, unit) in enumerate(axes)
    ]
    std = np.exp(theta[3:5])
    if data.polar:
        found += [
            Quantity(f"std_{axis}", unit, std[k], std[k] * se[3 + k])
            for k, (axis, unit) in enumerate(axes)
        ]
    else:
        found.append(Quantity("std_position", "m", std[0], std[0] * se[3]))
    found.append(Quantity("p_detect", "1", theta[8], se[8]))
    found.append(Quantity("clutter_rate", "1", theta[7], se[7]))
    p = max(float(theta[8]), 1e-9)
    slope = np.zeros(len(theta))
    slope[5], slope[8] = 1 / p, -theta[5] / p**2
    # Less than one detection is not told.
    spread = float(np.sqrt(np.maximum(slope @ cov @ slope, 0.0) + 1 / max(len(data.z), 1) ** 2))
    found.append(Quantity("detections_per_target", "1", theta[5] / p, spread))
    for k in range(BINS):
        name = f"p_detect {edges[k]:.0f} to {edges[k + 1]:.0f} m"
        found.append(Quantity(name, "1", theta[9 + k], se[9 + k]))
    return found


def nis_of(data: Data, model: Model) -> float:
    """Mean square of the residuals by a model, in units of what it expects."""
    w, d2 = weights(data, model, data.errors(data.expected(model.latency), model.b))
    total = w.sum()
    return float(w @ d2 / (2 * total)) if total > 0 else np.nan


def residuals(data: Data, model: Model, edges: Array) -> Residuals:
    """What is left, for a picture."""
    h, plain = data.expected(model.latency), data.expected(0.0)
    e = data.errors(h, model.b)
    w, _ = weights(data, model, e)
    kept = w > 0.5
    scan = data.pair_scan[data.pair]
    time = data.scan_time[scan] + data.offset[data.detection] - model.latency
    track = data.pair_track[data.pair]
    ends = [places(data.known, track, time + s) for s in (-SLOPE, SLOPE)]
    v = (ends[1] - ends[0])[:, :2] / (2 * SLOPE)
    speed = np.hypot(*v.T)
    local = [
        seen_from(data.sensors, data.recording[scan], time, np.column_stack((x, 0 * speed)))
        for x in (ends[0][:, :2], ends[0][:, :2] + np.where(speed > 0, 1, 0)[:, None] * v)
    ]
    way = (local[1] - local[0])[:, :2]
    length = np.maximum(np.hypot(*way.T), 1e-9)
    way = np.where((speed > 0.2)[:, None], way / length[:, None], np.nan)
    now = flat(data.z[data.detection] - model.b, data.polar) - flat(h, data.polar)
    before = flat(data.z[data.detection], data.polar) - flat(plain, data.polar)
    r, azimuth = h.T if data.polar else polar(h)
    u = np.stack((np.cos(azimuth), np.sin(azimuth)), 1)
    theta, cov = solved(data, model, edges)
    middle = (edges[1:] + edges[:-1]) / 2
    share = np.stack((middle, theta[9:], np.sqrt(np.maximum(np.diag(cov)[9:], 0.0))), 1)
    columns = {
        "along": (now * way).sum(1),
        "across": now[:, 1] * way[:, 0] - now[:, 0] * way[:, 1],
        "before": (before * way).sum(1),
        "over": (now * u).sum(1),
        "range": r,
        "azimuth": azimuth,
        "node": np.zeros(len(w), int),
        "weight": w,
    }
    return Residuals(**{name: np.asarray(c[kept]) for name, c in columns.items()}, share=share)

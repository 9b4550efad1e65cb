"""A truth fitted to the estimates of its device: its frame, its clock, or both.

At the true position p(t) an estimate is ``R p(t - tau) + s``, and an error. For each delay tau the
rotation R and the shift s that minimise the soft absolute errors are those of a weighted fit of
points (Arun et al., Least-squares fitting of two 3-D point sets, 1987), repeated with new weights.
From the best delay all are refined together, at last by the squares of the errors that are within
four standard deviations. A score against such a truth is better than it should be: p numbers are
taken from 2 n independent coordinates, so that a root mean square error of device or centre is too
small by about sqrt(1 - p / 2n), where n counts positions over the autocorrelation time of errors.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ...models.errors import InputError
from ...models.geometry.poses import Placement
from ...models.records import Array, Objects

SHIFT = 10.0
"""Largest delay that is looked for [s]."""
_SOFT = 0.1
"""Error from which on a position counts less [m]."""
_LEAST = 30
"""Positions without which nothing is fitted."""


def track(parts: Iterable[Objects], name: str) -> tuple[Array, Array]:
    """Times [s] (n,) and positions [m] (n, 2) of the device, or else the centre, of one object.

    Raises
    ------
    InputError : there are several objects, or none with a position
    """
    times, places, labels = [], [], set[int]()
    for o in parts:
        count = np.diff(o.row_offset)
        labels |= set(np.unique(o.label).tolist())
        if count.max(initial=0) > 1 or len(labels) > 1:
            raise InputError(f"{name}: the truth can be fitted to one object, there are several")
        pair = ("device_x", "device_y") if "device_x" in o.state_names else ("x", "y")
        if not set(pair) <= set(o.state_names):
            raise InputError(f"{name}: nothing to fit: there are no positions")
        times.append(np.repeat(o.time_ns, count) / 1e9)
        places.append(o.columns(*pair))
    return np.concatenate([np.zeros(0), *times]), np.concatenate([np.zeros((0, 2)), *places])


def fit(
    estimate: tuple[Array, Array], truth: tuple[Array, Array], mode: str, name: str
) -> tuple[Placement, dict[str, Any]]:
    """How the truth has to be placed, and what was fitted, for provenance.

    Raises
    ------
    InputError : too few estimates lie within the times of the truth
    """
    from scipy.optimize import least_squares

    (time, place), (known, true) = estimate, truth
    reach = SHIFT if mode != "rigid" else 0.0
    inside = np.zeros(len(time), bool)
    if len(known):
        inside = (time >= known[0] + reach) & (time <= known[-1] - reach)
        if inside.sum() < _LEAST:
            inside = (time >= known[0]) & (time <= known[-1])
    if inside.sum() < _LEAST:
        raise InputError(f"{name}: a fit needs {_LEAST} estimates within the times of the truth")
    # Times since 1970 have too few digits left for the small steps of a derivative.
    time, place, known = time[inside] - known[0], place[inside], known - known[0]
    free = np.array([mode != "time"] * 3 + [mode != "rigid"])

    def errors(values: Array, every: int = 1) -> Array:
        full = np.zeros(4)
        full[free] = values
        p = _at(known, true, time[::every] - full[3])
        c, s = np.cos(full[0]), np.sin(full[0])
        return np.asarray(p @ np.array([[c, s], [-s, c]]) + full[1:3] - place[::every])

    every = max(1, len(time) // 500)
    best: tuple[float, Array] = (np.inf, np.zeros(0))
    for delay in np.arange(-SHIFT, SHIFT + 0.25, 0.25) if mode != "rigid" else [0.0]:
        p = _at(known, true, time[::every] - delay)
        rigid = _procrustes(p, place[::every]) if mode != "time" else np.zeros(3)
        values = np.array([*rigid, delay])[free]
        best = min(best, (_cost(errors(values, every)), values), key=lambda pair: pair[0])
    said: dict[str, Any] = {"x_scale": "jac", "max_nfev": 200}
    values = least_squares(
        lambda v: errors(v).ravel(), best[1], loss="soft_l1", f_scale=_SOFT, **said
    ).x
    for _ in range(3):
        size = np.linalg.norm(errors(values), axis=1)
        kept = size <= 4 * 1.4826 * np.median(size) + 1e-12
        values = least_squares(lambda v, kept=kept: errors(v)[kept].ravel(), values, **said).x
    full = np.zeros(4)
    full[free] = values
    off = errors(values)
    placement = Placement(*map(float, full))
    found = {
        "mode": mode,
        "fitted": int(free.sum()),
        "positions": int(kept.sum()),
        "left_out": int((~kept).sum()),
        "independent": _independent(off[kept]),
        **placement.told,
        "median_error": float(np.median(np.linalg.norm(off, axis=1))),
    }
    return placement, found


def gain(found: dict[str, Any]) -> float:
    """Factor by which a root mean square error is too small after the fit; 0 if nothing is left."""
    return float(np.sqrt(max(0.0, 1 - found["fitted"] / (2 * found["independent"]))))


def _at(known: Array, true: Array, time: Array) -> Array:
    return np.column_stack([np.interp(time, known, true[:, k]) for k in (0, 1)])


def _cost(off: Array) -> float:
    return float(np.sum(np.sqrt(1 + (off / _SOFT) ** 2) - 1))


def _procrustes(p: Array, q: Array) -> Array:
    """Rotation and shift (3,) from points ``p`` to ``q`` (n, 2), by weights anew ten times."""
    w = np.ones(len(p))
    for _ in range(10):
        a, b = p - np.average(p, 0, w), q - np.average(q, 0, w)
        cross = np.sum(w * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]))
        theta = float(np.arctan2(cross, np.sum(w[:, None] * a * b)))
        c, s = np.cos(theta), np.sin(theta)
        turned = p @ np.array([[c, s], [-s, c]])
        shift = np.average(q - turned, 0, w)
        w = 1 / np.sqrt(1 + np.sum((turned + shift - q) ** 2, 1) / _SOFT**2)
    return np.array([theta, *shift])


def _independent(off: Array) -> float:
    """Errors (n, 2) over their autocorrelation time, summed to the first that is not positive."""
    n = len(off)
    x = off - off.mean(axis=0)
    size = 1 << (2 * n - 1).bit_length()
    spectrum = np.abs(np.fft.rfft(x, size, axis=0)) ** 2
    lags = np.fft.irfft(spectrum.sum(axis=1), size)[: n // 2]
    if lags[0] <= 0:
        return float(n)
    rho = lags[1:] / lags[0]
    stop = int(np.argmax(rho <= 0)) if (rho <= 0).any() else len(rho)
    return float(max(n / (1 + 2 * rho[:stop].sum()), 1.0))

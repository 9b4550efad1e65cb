"""Compiled twins of :mod:`echoset.estimators.maps.kernels.response`."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from .....models.records import Array
from ..response import (
    A0,
    AXIS,
    BEAM,
    BIN,
    COS,
    DA,
    DR,
    GAIN,
    INNER,
    LATE,
    OUTER,
    POSITION_X,
    POSITION_Y,
    R0,
    RCS,
    SIN,
    SPEED,
    STEP,
    X,
    Y,
    Z,
)

TAU = 2 * math.pi


@njit(cache=True)
def _sinc2(x: float) -> float:
    if abs(x) < 1e-9:
        return 1.0
    a = math.sin(math.pi * x) / (math.pi * x)
    return a * a


@njit(cache=True)
def add(
    out: Array,
    sign: float,
    station: Array,
    beam: Array,
    column: Array,
    body: Array,
    target: Array,
    window: Array,
) -> None:
    """Add the mean power of a target in a window of one map, in place; see the definition."""
    i0, i1, j0, j1 = window[0], window[1], window[2], window[3]
    n, m = i1 - i0, j1 - j0
    if n <= 0 or m <= 0:
        return
    x, y, heading = target[0] + station[LATE] * target[5], target[1], target[2]
    y += station[LATE] * target[6]
    c, s = math.cos(heading), math.sin(heading)
    size = math.exp(target[4])
    dx, dy = x - station[X], y - station[Y]
    sight = math.atan2(-dy, -dx) - heading
    distance = math.sqrt(dx * dx + dy * dy + station[Z] ** 2)
    doppler = -station[SPEED] * (dx * target[5] + dy * target[6]) / distance
    bright = sign * station[GAIN] * math.exp(target[3])
    loss, towards, gain = np.empty(m), np.empty(m), np.empty(m)
    for j in range(m):
        loss[j] = _sinc2(doppler - column[j0 + j])
        towards[j] = math.sin(station[A0] + station[DA] * (j0 + j))
    even = abs(station[DR] / station[BIN] - 1) < 1e-9
    for l in range(len(body)):
        off = sight - body[l, AXIS]
        off = abs(off - TAU * np.round(off / TAU))
        ramp = max(body[l, OUTER] - body[l, INNER], 1e-12)
        seen = min(max((body[l, OUTER] - off) / ramp, 0.0), 1.0)
        if seen * body[l, RCS] == 0.0:
            continue
        px = dx + size * (c * body[l, POSITION_X] - s * body[l, POSITION_Y])
        py = dy + size * (s * body[l, POSITION_X] + c * body[l, POSITION_Y])
        if station[COS] * px + station[SIN] * py <= 0:
            continue
        r = math.sqrt(px * px + py * py + station[Z] ** 2)
        sine = (station[COS] * py - station[SIN] * px) / r
        power = bright * body[l, RCS] * seen / (r * r * r * r)
        for j in range(m):
            u = abs(towards[j] - sine) * (BEAM / 2)
            k = min(int(u), BEAM - 2)
            gain[j] = power * (beam[k] + (u - k) * (beam[k + 1] - beam[k])) * loss[j]
        first = (station[R0] + station[DR] * i0 - r) / station[BIN]
        wave = math.sin(math.pi * first) / math.pi
        for i in range(n):
            if even:
                at = first + i
                w = 1.0 if abs(at) < 1e-9 else (wave / at) ** 2
            else:
                w = _sinc2(first + i * station[DR] / station[BIN])
            for j in range(m):
                out[i0 + i, j0 + j] += w * gain[j]


@njit(cache=True)
def strongest(
    column: Array, peak: Array, station: Array, beam: Array, body: Array, target: Array
) -> None:
    """Note a target's Doppler bin where it is the strongest; see the definition."""
    x, y, heading = target[0] + station[LATE] * target[5], target[1], target[2]
    y += station[LATE] * target[6]
    c, s = math.cos(heading), math.sin(heading)
    size = math.exp(target[4])
    dx, dy = x - station[X], y - station[Y]
    sight = math.atan2(-dy, -dx) - heading
    distance = math.sqrt(dx * dx + dy * dy + station[Z] ** 2)
    doppler = -station[SPEED] * (dx * target[5] + dy * target[6]) / distance
    bright = station[GAIN] * math.exp(target[3])
    found = np.zeros(len(column))
    for l in range(len(body)):
        off = sight - body[l, AXIS]
        off = abs(off - TAU * np.round(off / TAU))
        ramp = max(body[l, OUTER] - body[l, INNER], 1e-12)
        seen = min(max((body[l, OUTER] - off) / ramp, 0.0), 1.0)
        px = dx + size * (c * body[l, POSITION_X] - s * body[l, POSITION_Y])
        py = dy + size * (s * body[l, POSITION_X] + c * body[l, POSITION_Y])
        if seen * body[l, RCS] == 0.0 or station[COS] * px + station[SIN] * py <= 0:
            continue
        r = math.sqrt(px * px + py * py + station[Z] ** 2)
        sine = (station[COS] * py - station[SIN] * px) / r
        power = bright * body[l, RCS] * seen / (r * r * r * r)
        for j in range(len(column)):
            u = abs(math.sin(station[A0] + station[DA] * j) - sine) * (BEAM / 2)
            k = min(int(u), BEAM - 2)
            found[j] += power * (beam[k] + (u - k) * (beam[k + 1] - beam[k]))
    for j in range(len(column)):
        if found[j] > peak[j]:
            peak[j] = found[j]
            column[j] = np.round(doppler)


@njit(cache=True)
def log_likelihood(power: Array, mean: Array, shape: float) -> float:
    """Sum of the log-likelihood of all cells of one map."""
    total = 0.0
    R, A = power.shape
    for i in range(R):
        a = b = 1.0
        for j in range(A):
            a *= mean[i, j]
            b *= mean[i, j] + power[i, j] / shape
            if b > 1e200 or a > 1e200:
                total += shape * math.log(a) - (shape + 1) * math.log(b)
                a = b = 1.0
        total += shape * math.log(a) - (shape + 1) * math.log(b)
    return total


@njit(cache=True)
def fit(
    power: Array,
    rest: Array,
    stations: Array,
    beams: Array,
    columns: Array,
    body: Array,
    target: Array,
    windows: Array,
    shape: float,
    derive: bool,
) -> tuple[float, Array, Array]:
    """What a target adds to the log-likelihood, its score and information; see the definition."""
    total, g, J = 0.0, np.zeros(5), np.zeros((5, 5))
    d, K = np.zeros(5), 5 if len(body) > 1 else 4
    whole = np.zeros(4, np.int64)
    for q in range(len(stations)):
        i0, j0 = windows[q, 0], windows[q, 2]
        n, m = windows[q, 1] - i0, windows[q, 3] - j0
        if n <= 0 or m <= 0:
            continue
        # A window of its own: the station's axes begin where it does.
        station = stations[q].copy()
        station[R0] += i0 * station[DR]
        station[A0] += j0 * station[DA]
        column = columns[q, j0 : j0 + m]
        whole[1], whole[3] = n, m
        T = np.zeros((n, m))
        add(T, 1.0, station, beams[q], column, body, target, whole)
        changed = np.zeros((K if derive else 0, n, m))
        if derive:
            x = target.copy()
            for k in range(K):
                x[k] = target[k] + STEP[k]
                add(changed[k], 1.0, station, beams[q], column, body, x, whole)
                x[k] = target[k] - STEP[k]
                add(changed[k], -1.0, station, beams[q], column, body, x, whole)
                x[k] = target[k]
        for i in range(n):
            a = b = 1.0
            for j in range(m):
                D, B = power[q, i0 + i, j0 + j], rest[q, i0 + i, j0 + j]
                M = B + T[i, j]
                a *= M / B
                b *= (M + D / shape) / (B + D / shape)
                if a > 1e200:
                    total += shape * math.log(a) - (shape + 1) * math.log(b)
                    a = b = 1.0
                if derive:
                    score = (D - M) / (M + D / shape)
                    for k in range(K):
                        d[k] = changed[k, i, j] / (2 * STEP[k] * M)
                    for k in range(K):
                        g[k] += d[k] * score
                        for l in range(K):
                            J[k, l] += d[k] * d[l]
            total += shape * math.log(a) - (shape + 1) * math.log(b)
    return total, g, J * (shape / (shape + 2))


@njit(cache=True)
def gains(power: Array, mean: Array, cell: Array, weight: Array, shape: float) -> Array:
    """What pedestrians at each place would add to the log-likelihood; see the definition."""
    J, S, _ = cell.shape
    R = power.shape[1]
    out = np.zeros(J)
    for p in range(J):
        a = b = 1.0
        for q in range(S):
            i, j = cell[p, q, 0], cell[p, q, 1]
            if i < 0:
                continue
            D, B = power[q, i, j], mean[q, i, j]
            for k in (max(i - 1, 0), min(i + 1, R - 1)):
                if power[q, k, j] * B > D * mean[q, k, j]:
                    D, B = power[q, k, j], mean[q, k, j]
            M = B + weight[p, q]
            a *= M / B
            b *= (M + D / shape) / (B + D / shape)
            if a > 1e200:
                out[p] += shape * math.log(a) - (shape + 1) * math.log(b)
                a = b = 1.0
        out[p] += shape * math.log(a) - (shape + 1) * math.log(b)
    return out

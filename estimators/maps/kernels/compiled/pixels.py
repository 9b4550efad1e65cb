"""Compiled twins of :mod:`echoset.estimators.maps.kernels.pixels`.

On a grid a neighbourhood is a run of pixels in each row: neighbours are counted, and core pixels
joined, by the row instead of by the pair.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from .....models.records import Array


@njit(cache=True)
def nearest(point: Array, where: Array, gate: Array, room: Array) -> Array:
    """Index (n,) of the target nearest to each point, -1 beyond its gate; see the definition."""
    out = np.full(len(point), -1)
    for i in range(len(point)):
        best, d = np.inf, 0.0
        for k in range(len(where)):
            x, y = point[i, 0] - where[k, 0], point[i, 1] - where[k, 1]
            middle = np.sqrt(x * x + y * y)
            if middle - room[k] < best:
                best, d, out[i] = middle - room[k], middle, k
        if out[i] >= 0 and d > gate[out[i]]:
            out[i] = -1
    return out


@njit(cache=True)
def _half_widths(reach2: int) -> Array:
    """Half width of the neighbourhood in rows 0, 1, ... away."""
    reach = int(np.sqrt(reach2))
    while (reach + 1) ** 2 <= reach2:
        reach += 1
    while reach**2 > reach2:
        reach -= 1
    half = np.empty(reach + 1, np.int64)
    width = reach
    for dy in range(reach + 1):
        while width**2 + dy**2 > reach2:
            width -= 1
        half[dy] = width
    return half


@njit(cache=True)
def _before(mask: Array) -> Array:
    """How many true pixels (ny, nx + 1) come before each, row by row."""
    ny, nx = mask.shape
    before = np.empty((ny, nx + 1), np.int32)
    n = 0
    for y in range(ny):
        for x in range(nx):
            before[y, x] = n
            n += mask[y, x]
        before[y, nx] = n
    return before


@njit(cache=True)
def _root(parent: Array, s: int) -> int:
    while parent[s] != s:
        parent[s] = parent[parent[s]]
        s = parent[s]
    return s


@njit(cache=True)
def dbscan(mask: Array, reach2: int, least: int) -> Array:
    """DBSCAN's label (n,) of each true pixel, -1 for noise; see the definition.

    Core pixels of a row that are within reach of their neighbours form a segment; each core pixel
    joins its own segment to those within reach in the rows before.
    """
    ny, nx = mask.shape
    half = _half_widths(reach2)
    reach = len(half) - 1
    before = _before(mask)
    N = before[-1, -1]
    core = np.zeros((ny, nx), np.bool_)
    for y in range(ny):
        if before[y, 0] == before[y, nx]:
            continue
        for x in range(nx):
            if mask[y, x]:
                n = 0
                for row in range(max(y - reach, 0), min(y + reach + 1, ny)):
                    h = half[abs(row - y)]
                    n += before[row, min(x + h + 1, nx)] - before[row, max(x - h, 0)]
                core[y, x] = n >= least
    earlier = _before(core)
    segment = np.empty(earlier[-1, -1], np.int64)
    parent = np.arange(len(segment))
    k, s = 0, -1
    for y in range(ny):
        last = -1
        for x in range(nx):
            if not core[y, x]:
                continue
            if last < 0 or x - last > reach:
                s += 1
            segment[k], last = s, x
            mine = _root(parent, s)
            for row in range(max(y - reach, 0), y):
                h = half[y - row]
                a = earlier[row, max(x - h, 0)]
                b = earlier[row, min(x + h + 1, nx)]
                if a < b:
                    for other in range(segment[a], segment[b - 1] + 1):
                        theirs = _root(parent, other)
                        if theirs != mine:
                            parent[theirs] = mine
            k += 1
    name, of = np.full(s + 1, -1), np.empty(s + 1, np.int64)
    n = 0
    for s in range(len(of)):
        root = _root(parent, s)
        if name[root] < 0:
            name[root] = n
            n += 1
        of[s] = name[root]
    label = np.full(N, -1)
    for y in range(ny):
        if before[y, 0] == before[y, nx]:
            continue
        for x in range(nx):
            if core[y, x]:
                label[before[y, x]] = of[segment[earlier[y, x]]]
            elif mask[y, x]:
                best = n
                for row in range(max(y - reach, 0), min(y + reach + 1, ny)):
                    h = half[abs(row - y)]
                    a = earlier[row, max(x - h, 0)]
                    b = earlier[row, min(x + h + 1, nx)]
                    if a < b:
                        for other in range(segment[a], segment[b - 1] + 1):
                            best = min(best, of[other])
                if best < n:
                    label[before[y, x]] = best
    return label

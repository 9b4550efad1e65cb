"""Where a sensor keeps detecting what is no target: a map of clutter, learnt while filtering.

Land and moored boats return from one place scan after scan. In square cells of the map's frame the
number of detections per scan is averaged with exponentially fading weights, and taken for clutter.
What moves through a cell leaves little there; a target that stays becomes clutter, too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...models.records import Array, Scan
from .sensing import Look, SensorParams, positions

NEGLIGIBLE = 1e-3
"""Detections per scan below which a cell is forgotten, so that memory has a bound."""


@dataclass(frozen=True, slots=True, eq=False)
class ClutterMap:
    """Detections per scan ``rate`` (k,) in the ``cells`` (k, 2), after the scan at ``time_ns``.

    Cells are counted from the origin of the map, in their own size.
    """

    cells: Array
    rate: Array
    time_ns: int

    def density(self, position: Array, size: float) -> Array:
        """Expected clutter (n,) [m^-2] at positions (n, 2), with cells of ``size`` [m]."""
        found, index = np.unique(
            np.concatenate((self.cells, _cells(position, size))), axis=0, return_inverse=True
        )
        rate = np.zeros(len(found))
        index = index.ravel()
        rate[index[: len(self.cells)]] = self.rate
        return np.asarray(rate[index[len(self.cells) :]] / size**2)

    def learn(self, position: Array, size: float, memory: float, time_ns: int) -> ClutterMap:
        """The map after detections at ``position`` (n, 2), fading over ``memory`` [s]."""
        fade = np.exp(-(time_ns - self.time_ns) / 1e9 / memory)
        cells = np.concatenate((self.cells, _cells(position, size)))
        weight = np.concatenate((fade * self.rate, np.full(len(position), 1 - fade)))
        cells, index = np.unique(cells, axis=0, return_inverse=True)
        rate = np.bincount(index.ravel(), weight, len(cells))
        kept = rate >= NEGLIGIBLE
        return ClutterMap(cells[kept], rate[kept], time_ns)


def unknown(time_ns: int) -> ClutterMap:
    """Nothing has been detected yet."""
    return ClutterMap(np.zeros((0, 2)), np.zeros(0), time_ns)


Maps = Mapping[str, ClutterMap]
"""Maps by stream."""


def persistent(maps: Maps, stream: str, seen: Look, params: SensorParams) -> Array:
    """Density (n,) of what persists in a stream at its detections, in their own measure."""
    if stream not in maps:
        return np.zeros(len(seen.z))
    density = maps[stream].density(positions(seen)[0], params.clutter_cell)
    return density * seen.z[:, 0] if seen.polar else density


def learnt(maps: Maps, scan: Scan, seen: Look, params: SensorParams) -> Maps:
    """The maps after a scan, if any are wanted."""
    if not params.clutter_cell:
        return maps
    known = maps.get(scan.stream) or unknown(scan.time_ns)
    where, t = positions(seen)[0], scan.time_ns
    new = known.learn(where, params.clutter_cell, params.clutter_memory, t)
    return {**maps, scan.stream: new}


def _cells(position: Array, size: float) -> Array:
    return np.asarray(np.floor(position / size) + 0.0)

"""Where a sensor keeps detecting what is no target: a map of clutter, learnt while filtering.

Land and moored boats return from one place scan after scan. In square cells of the map's frame
detections are counted per look at the cell: with a Gamma prior of one memory's worth of looks at
which nothing was seen, and all counts fading, the expected rate is their ratio. What moves through
a cell leaves little there; a target that stays becomes clutter, too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ....models.radar.detection import polar
from ....models.records import Array, Scan
from .measurement import positions
from .sensing import Look, SensorParams

InView = Callable[[Array], Array]
"""Whether positions (n, 2) in the map are in view."""


def everywhere(position: Array) -> Array:
    """All of them."""
    return np.ones(len(position), bool)


FADED = 0.02
"""Faded detections below which a cell is forgotten, so that memory has a bound."""
LEAST_LOOKS = 10
"""Looks that a memory has at least: a pause between two counts for no more than its share."""


@dataclass(frozen=True, slots=True, eq=False)
class ClutterMap:
    """Faded detections ``count`` (k,) in the ``cells`` (k, 2) and faded ``looks`` (k,) at them.

    Cells are counted from the origin of the map, in their own size; ``time_ns`` (k,) is the last
    look at each, and ``last_ns`` that at any.
    """

    cells: Array
    count: Array
    looks: Array
    time_ns: Array
    last_ns: int

    def density(self, position: Array, size: float) -> Array:
        """Expected clutter (n,) [m^-2] at positions (n, 2), with cells of ``size`` [m]."""
        found, index = np.unique(
            np.concatenate((self.cells, _cells(position, size))), axis=0, return_inverse=True
        )
        rate = np.zeros(len(found))
        index = index.ravel()
        rate[index[: len(self.cells)]] = self.count / self.looks
        return np.asarray(rate[index[len(self.cells) :]] / size**2)

    def learn(
        self, position: Array, size: float, memory: float, time_ns: int, view: InView = everywhere
    ) -> ClutterMap:
        """The map after detections at ``position`` (n, 2), fading over ``memory`` [s].

        Cells whose centres are not in ``view`` have not been looked at, and stay as they are.
        """
        new = _cells(position, size)
        cells, index = np.unique(np.concatenate((self.cells, new)), axis=0, return_inverse=True)
        old, here = np.split(index.ravel(), [len(self.cells)])
        added = np.bincount(here, minlength=len(cells))
        seen = np.asarray(view((cells + 0.5) * size)) | (added > 0)
        before = np.full(len(cells), self.last_ns)
        before[old] = self.time_ns
        longest, gap = memory / LEAST_LOOKS, (time_ns - before) / 1e9
        # At the first scan nobody knows how often there will be one.
        fade = np.exp(-np.where(gap > 0, np.minimum(gap, longest), longest) / memory)
        count, looks = np.zeros(len(cells)), 1 / (1 - fade)
        count[old], looks[old] = self.count, self.looks
        count = np.where(seen, fade * count + added, count)
        looks = np.where(seen, fade * looks + 1, looks)
        last = np.where(seen, time_ns, before)
        kept = count >= FADED
        return ClutterMap(cells[kept], count[kept], looks[kept], last[kept], time_ns)


def unknown(time_ns: int) -> ClutterMap:
    """Nothing has been detected yet."""
    none = np.zeros(0)
    return ClutterMap(np.zeros((0, 2)), none, none, np.zeros(0, np.int64), time_ns)


Maps = Mapping[str, ClutterMap]
"""Maps by stream."""


def persistent(maps: Maps, stream: str, seen: Look, params: SensorParams) -> Array:
    """Density (n,) of what persists in a stream at its detections, in their own measure."""
    if stream not in maps:
        return np.zeros(len(seen.z))
    density = maps[stream].density(positions(seen)[0], params.clutter_cell)
    return seen.with_doppler(density * seen.z[:, 0] if seen.polar else density)


def learnt(maps: Maps, scan: Scan, seen: Look, params: SensorParams) -> Maps:
    """The maps after a scan, if any are wanted."""
    if not params.clutter_cell:
        return maps
    known = maps.get(scan.stream) or unknown(scan.time_ns)
    where, t = positions(seen)[0], scan.time_ns

    def view(x: Array) -> Array:
        return seen.view.contains(*polar((x - seen.position) @ seen.rotation))

    new = known.learn(where, params.clutter_cell, params.clutter_memory, t, view)
    return {**maps, scan.stream: new}


def _cells(position: Array, size: float) -> Array:
    return np.asarray(np.floor(position / size) + 0.0)

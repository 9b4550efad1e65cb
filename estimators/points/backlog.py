"""Targets that have appeared anywhere and that no sensor has detected yet: a map of how many wait.

It counts in steps of births: where nobody looks, what appeared since and lives; where a sensor
looks, the share that it misses. Waiting targets stay in their cells. J. L. Williams, "Marginal
multi-Bernoulli filters", IEEE Trans. Aerosp. Electron. Syst. 51 (2015) 1664-1687, theorems 1, 2.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...models.parameters import parameter
from ...models.radar.detection import polar
from ...models.records import Array
from .model.sensing import Look, spread
from .model.targets import appeared

CELLS = 24
"""Cells from a sensor to the end of its view."""
MOST = 1 << 20
"""Cells of the map; beyond, it begins anew around the view."""


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class BacklogParams:
    """How many targets wait at the start."""

    TITLE = "undetected targets"

    backlog: float = parameter(
        100.0,
        "1",
        "of a Poisson process of undetected targets, with births at detections: steps of births "
        "that wait undetected where no sensor has looked, at the start",
        within="[0, inf)",
    )


@dataclass(frozen=True, slots=True, eq=False)
class Backlog:
    """Steps of births that wait ``elsewhere``, and in ``cells`` (nx, ny) of the map.

    These are ``width`` [m] wide, and the first has the index ``corner`` (2,) counted from 0, 0.
    """

    elsewhere: float
    width: float = 0.0
    corner: Array = field(default_factory=lambda: np.zeros(2, np.int64))
    cells: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def predict(self, p_survive: float, steps: float) -> Backlog:
        """What waits ``steps`` later."""
        stay, new = p_survive**steps, appeared(p_survive, 0.0, steps)
        return replace(self, elsewhere=stay * self.elsewhere + new, cells=stay * self.cells + new)

    def at(self, where: Array) -> Array:
        """What waits (n,) at positions (n, 2) [m]."""
        found = np.full(len(where), self.elsewhere)
        if self.cells.size:
            cell = np.floor(where / self.width).astype(np.int64) - self.corner
            known = ((cell >= 0) & (cell < self.cells.shape)).all(1)
            found[known] = self.cells[tuple(cell[known].T)]
        return found

    def missed(self, look: Look) -> Backlog:
        """What still waits after a look, cell by cell all or nothing of it in view."""
        view = look.view
        if not np.isfinite(view.range_max):
            miss = 1 - look.p_detect
            return replace(self, elsewhere=miss * self.elsewhere, cells=miss * self.cells)
        covering, centre, part = self._around(look)
        seen = view.contains(*polar((centre - look.position) @ look.rotation))
        cells = covering.cells.copy()
        cells[part] *= np.where(seen, 1 - look.p_detect, 1.0)
        return replace(covering, cells=cells)

    def mean(self, look: Look) -> float:
        """What waits where a look's clutter may be, on average over that."""
        if not np.isfinite(look.view.range_max):
            return self.elsewhere
        covering, centre, part = self._around(look)
        density = spread(look, centre.reshape(-1, 2)).reshape(centre.shape[:2])
        total = density.sum()
        return float((density * covering.cells[part]).sum() / total) if total else self.elsewhere

    def _around(self, look: Look) -> tuple[Backlog, Array, tuple[slice, ...]]:
        """The same with cells for all that a look may see: their centres (nx, ny, 2) and place."""
        reach = look.view.range_max
        covering = self._covering(look.position, reach)
        low, high = _span(look.position, reach, covering.width)
        axes = [(np.arange(a, b) + 0.5) * covering.width for a, b in zip(low, high, strict=True)]
        centre = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
        return covering, centre, _part(low - covering.corner, centre.shape[:2])

    def _covering(self, position: Array, reach: float) -> Backlog:
        """The same with cells for all within ``reach`` [m] of a position."""
        width = self.width or reach / CELLS
        low, high = _span(position, reach, width)
        if not self.cells.size:
            return Backlog(self.elsewhere, width, low, np.full(high - low, self.elsewhere))
        end = self.corner + self.cells.shape
        if (low >= self.corner).all() and (high <= end).all():
            return self
        low, high = np.minimum(low, self.corner), np.maximum(high, end)
        if np.prod((high - low).astype(float)) > MOST:
            return Backlog(self.elsewhere)._covering(position, reach)
        cells = np.full(high - low, self.elsewhere)
        cells[_part(self.corner - low, self.cells.shape)] = self.cells
        return Backlog(self.elsewhere, width, low, cells)


def _span(position: Array, reach: float, width: float) -> tuple[Array, Array]:
    """First cells (2,) within ``reach`` of a position, and those after the last."""
    low, high = (np.floor((position + d) / width).astype(np.int64) for d in (-reach, reach))
    return low, high + 1


def _part(start: Array, shape: tuple[int, ...]) -> tuple[slice, ...]:
    return tuple(slice(a, a + n) for a, n in zip(start.tolist(), shape, strict=True))

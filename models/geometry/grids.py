"""Tables on regular grids, read by linear interpolation."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from ..records import Array


@dataclass(frozen=True, slots=True, eq=False)
class Grid:
    """Nodes ``origin + i spacing`` with ``shape`` of them along the axes, (d,) each [m].

    An axis of one node says that nothing depends on it.
    """

    origin: Array
    spacing: Array
    shape: tuple[int, ...]

    @staticmethod
    def around(lower: Array, upper: Array, cell: float) -> Grid:
        """Centres of the cells that fill the box [lower, upper] and of one ring around it."""
        count = np.maximum(np.ceil((upper - lower) / cell - 1e-9).astype(int), 1)
        spacing = (upper - lower) / count
        return Grid(lower - spacing / 2, spacing, tuple((count + 2).tolist()))

    def nodes(self) -> Array:
        """Positions of the nodes, (*shape, d) [m]."""
        index = np.moveaxis(np.indices(self.shape), 0, -1)
        return np.asarray(self.origin + index * self.spacing)

    def interpolate(self, table: Array, points: Array, outside: Array) -> Array:
        """Values (m, ...) of ``table`` (*shape, ...) at ``points`` (m, d).

        ``outside`` (...) is the value beyond the outermost nodes.
        """
        shape = np.array(self.shape)
        t = np.where(shape > 1, (points - self.origin) / self.spacing, 0.0)
        i = np.clip(np.floor(t).astype(int), 0, np.maximum(shape - 2, 0))
        w = t - i
        value = np.zeros((len(points), *table.shape[len(shape) :]))
        for corner in product((0, 1), repeat=len(shape)):
            c = np.array(corner)
            weight = np.prod(np.where(c, w, 1 - w), axis=1)
            node = table[tuple(np.minimum(i + c, shape - 1).T)]
            value += weight.reshape(-1, *(1,) * (value.ndim - 1)) * node
        beyond = ((t < 0) | (t > shape - 1)).any(1)
        value[beyond] = outside
        return value

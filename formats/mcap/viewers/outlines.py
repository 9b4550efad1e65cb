"""Objects as coloured points along their outlines, for viewers that draw points but no shapes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....models.geometry.poses import rotation
from ....models.records import Array, Objects
from ..tables import drawn, point_cloud
from .shapes import COLOURS, half_turn, places

_ANGLE = 2 * np.pi * np.arange(32) / 32
_CIRCLE = np.stack((np.cos(_ANGLE), np.sin(_ANGLE), np.zeros(32)), 1)
_RECTANGLE = np.array(
    [[1 - 2 * s, 1, 0] for s in np.arange(8) / 8] + [[-1, 1 - 2 * s, 0] for s in np.arange(8) / 8]
)
_RECTANGLE = np.concatenate((_RECTANGLE, -_RECTANGLE))


def clouds(objects: Objects, frame: str, kind: str) -> Iterator[tuple[int, bytes]]:
    """Times and messages: centres, devices, and the outlines of the extents.

    An ellipse has one line, an ellipsoid one in each of its three principal planes.
    """
    found = places(objects)
    rgba = [round(255 * c) for c in (*COLOURS[kind][:3], 1.0)]
    for k, t in enumerate(objects.time_ns.tolist()):
        rows = range(objects.row_offset[k], objects.row_offset[k + 1])
        parts = [xyz[rows.start : rows.stop] for xyz in found.values()]
        if objects.semi_axes is not None and "centre" in found:
            parts += [found["centre"][row] + _outline(objects, row) for row in rows]
        points = np.concatenate([np.zeros((0, 3)), *parts])
        columns: dict[str, Array] = dict(zip("xyz", drawn(points).T, strict=True))
        for name, value in zip(("red", "green", "blue", "alpha"), rgba, strict=True):
            columns[name] = np.full(len(points), value, "u1")
        yield t, point_cloud(columns, frame, t)


def _outline(objects: Objects, row: int) -> Array:
    """Points (p, 3) along the extent of a row, about its centre."""
    assert objects.semi_axes is not None
    axes = objects.semi_axes[row]
    axes = np.repeat(axes, 2) if len(axes) == 1 else axes
    solid = len(axes) > 2
    shape = _RECTANGLE if objects.extent_kind == "rectangle" else _CIRCLE
    lines = [np.roll(shape, i, axis=1) for i in range(3 if solid else 1)]
    local = np.concatenate(lines) * (axes[:3] if solid else [*axes, 0.0])
    return np.asarray(local @ rotation(half_turn(objects, row)).T)

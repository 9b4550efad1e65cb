"""Names beside places of a map, where they cover neither each other nor the places."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...models.records import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_AROUND = ((1, 1), (-1, 1), (1, -1), (-1, -1), (0, 1), (0, -1), (1, 0), (-1, 0))
"""Directions from a place in which its name may stand, the best first."""
_GAP = 4.0
"""Distance [points] of a name from its place, and half of the width of a mark."""
_LETTER = 0.62, 1.25
"""Width and height of a letter, in its size."""
_OPTIONS: Mapping[str, Any] = {"textcoords": "offset points", "zorder": 7}


def place(axes: Axes, names: Sequence[str], points: Array, size: float = 8.0) -> None:
    """Write ``names`` beside ``points`` (n, 2); one that has room nowhere is left out.

    The limits of the axes are to be final.
    """
    scale = 72 / axes.figure.dpi
    at = scale * axes.transData.transform(points)
    x0, y0, x1, y1 = scale * np.array(axes.get_window_extent().extents)
    inside: Box = float(x0), float(y0), float(x1), float(y1)
    taken: list[Box] = [(x - _GAP, y - _GAP, x + _GAP, y + _GAP) for x, y in at.tolist()]
    for name, (x, y), point in zip(names, at.tolist(), points.tolist(), strict=True):
        width, height = _LETTER[0] * size * len(name), _LETTER[1] * size
        for dx, dy in _AROUND:
            cx, cy = x + dx * (_GAP + width / 2), y + dy * (_GAP + height / 2)
            box = cx - width / 2, cy - height / 2, cx + width / 2, cy + height / 2
            if _within(box, inside) and not any(_cover(box, other) for other in taken):
                taken.append(box)
                axes.annotate(
                    name,
                    point,
                    xytext=(dx * _GAP, dy * _GAP),
                    ha=("right", "center", "left")[dx + 1],
                    va=("top", "center", "bottom")[dy + 1],
                    fontsize=size,
                    **_OPTIONS,
                )
                break


Box = tuple[float, float, float, float]


def _within(box: Box, frame: Box) -> bool:
    return box[0] >= frame[0] and box[1] >= frame[1] and box[2] <= frame[2] and box[3] <= frame[3]


def _cover(one: Box, other: Box) -> bool:
    beside = one[2] <= other[0] or other[2] <= one[0]
    return not (beside or one[3] <= other[1] or other[3] <= one[1])

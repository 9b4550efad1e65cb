"""A truth that is put into another frame and onto another clock."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .records import Objects

_PAIRS = (("x", "y", 1), ("device_x", "device_y", 1), ("vx", "vy", 0))
FITS = ("rigid", "time", "both")
"""What may be fitted: the frame, the clock, or both."""


@dataclass(frozen=True, slots=True)
class Placement:
    """Turned by ``rotation`` [rad] from x to y, shifted by ``x, y`` [m], late by ``delay`` [s]."""

    rotation: float = 0.0
    x: float = 0.0
    y: float = 0.0
    delay: float = 0.0

    def of(self, objects: Objects) -> Objects:
        """The objects so placed: positions, velocities and headings of extents, and times."""
        c, s = np.cos(self.rotation), np.sin(self.rotation)
        state = objects.state.copy()
        for x, y, moved in _PAIRS:
            if x in objects.state_names and y in objects.state_names:
                i, j = objects.state_names.index(x), objects.state_names.index(y)
                a, b = objects.state[:, i], objects.state[:, j]
                state[:, i] = c * a - s * b + moved * self.x
                state[:, j] = s * a + c * b + moved * self.y
        turned = objects.rotation
        if turned is not None and turned.ndim == 1:
            turned = turned + self.rotation
        time = objects.time_ns + round(self.delay * 1e9)
        return replace(objects, time_ns=time, state=state, rotation=turned)

    @property
    def told(self) -> dict[str, Any]:
        """The numbers, for provenance."""
        turn = float((self.rotation + np.pi) % (2 * np.pi) - np.pi)
        shift = [float(self.x), float(self.y)]
        return {"rotation": turn, "translation": shift, "delay": float(self.delay)}


def said(found: dict[str, Any]) -> str:
    """What was fitted, as a sentence tells it."""
    x, y = found["translation"]
    return (
        f"turned by {np.degrees(found['rotation']):.2f} degrees, shifted by ({x:.3f}, {y:.3f}) m "
        f"and {found['delay']:.3f} s"
    )

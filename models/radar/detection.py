"""What a radar sees: its field of view, in range and azimuth about its x axis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, cos, inf, isfinite, pi, sin
from typing import Any

import numpy as np

from ..records import Array


@dataclass(frozen=True, slots=True)
class View:
    """Azimuths [rad], anticlockwise from first to last, and ranges [m] in the sensor's frame."""

    azimuth_min: float = -pi
    azimuth_max: float = pi
    range_min: float = 0.0
    range_max: float = inf

    @staticmethod
    def of(scan: Mapping[str, Any], max_range: float = inf) -> View:
        """The view that a scan's columns state, or all around up to ``max_range``."""
        return View(
            float(scan.get("view_azimuth_min", -pi)),
            float(scan.get("view_azimuth_max", pi)),
            float(scan.get("view_range_min", 0.0)),
            float(scan.get("view_range_max", max_range)),
        )

    @property
    def width(self) -> float:
        """Angle [rad] from the first to the last azimuth, at most a full turn."""
        turn = self.azimuth_max - self.azimuth_min
        return min(turn, 2 * pi) if turn >= 0 else turn % (2 * pi)

    @property
    def area(self) -> float:
        """Range times azimuth [m rad]: what clutter uniform in both spreads over."""
        return (self.range_max - self.range_min) * self.width

    @property
    def bounded(self) -> bool:
        """Whether it has an area, and one that ends."""
        return isfinite(self.range_max) and self.area > 0

    def contains(self, distance: Array, azimuth: Array) -> Array:
        """Whether points at these ranges [m] and azimuths [rad] are in view."""
        turn = np.mod(azimuth - self.azimuth_min, 2 * pi)
        near = (distance >= self.range_min) & (distance <= self.range_max)
        return near & ((turn <= self.width) | (self.width >= 2 * pi))

    def distance(self, position: Array) -> Array:
        """How far (n,) [m] positions (n, 2) in the sensor's frame are from the border, at least."""
        r, azimuth = polar(position)
        found = np.abs(r - self.range_max)
        if self.range_min > 0:
            found = np.minimum(found, np.abs(r - self.range_min))
        if self.width < 2 * pi:
            for edge in (self.azimuth_min, self.azimuth_max):
                turn = azimuth - edge
                across = np.where(np.cos(turn) > 0, r * np.abs(np.sin(turn)), r)
                found = np.minimum(found, across)
        return np.asarray(found)

    def corners(self, step: float = 0.05, end: float = inf) -> Array:
        """The view up to range ``end`` as a polygon (v, 2) in the sensor's frame, anticlockwise.

        Its arcs are chords of at most ``step`` [rad], at radii that keep the area of the sector.
        """
        last = min(self.range_max, end)
        n = max(ceil(self.width / step), 1)
        azimuth = self.azimuth_min + self.width * np.arange(n + 1) / n
        # A chord's triangle has sin(a) / a of its sector's area.
        a = self.width / n
        swell = (a / sin(a)) ** 0.5 if cos(a) > 0 else 1.0
        ring = swell * np.stack((np.cos(azimuth), np.sin(azimuth)), 1)
        inner = self.range_min * ring[::-1] if self.range_min > 0 else np.zeros((1, 2))
        return np.concatenate((last * ring, inner))


def polar(position: Array) -> tuple[Array, Array]:
    """Range [m] and azimuth [rad] of positions (..., 2) in the sensor's frame."""
    return np.hypot(position[..., 0], position[..., 1]), np.arctan2(
        position[..., 1], position[..., 0]
    )

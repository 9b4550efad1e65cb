"""Detections of sensors that are tilted, or above or below targets, taken to the map's plane."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ....models.errors import InputError
from ....models.records import Array

STEEP = 100.0
"""Most that a range on the ground changes per metre of the range in space."""


def level(turn: Array) -> Array:
    """Rotation (2, 2) about the vertical of a sensor with rotation ``turn`` (3, 3), tilted or not.

    Raises
    ------
    InputError : its x axis is vertical
    """
    if turn[2, 2] == 1:
        return np.asarray(turn[:2, :2])
    length = np.hypot(turn[0, 0], turn[1, 0])
    if length < 1e-6:
        raise InputError("a sensor's x axis is vertical: it has no azimuth in the plane")
    c, s = turn[:2, 0] / length
    return np.array([[c, -s], [s, c]])


def ground(rows: Mapping[str, Array], turn: Array, down: float) -> tuple[Array, Array | None]:
    """Ranges and azimuths (n, 2) in the plane, about the sensor's foot, of those in space.

    Also their slopes (n,) over the measured range, None where nothing changes. Without elevation
    it is what takes the detection to targets, which are ``down`` [m] from the sensor (negative for
    below it).
    """
    r, azimuth = rows["range"], rows["azimuth"]
    tilted = turn[2, 2] != 1
    if "elevation" not in rows and not tilted and down == 0:
        return np.stack((r, azimuth), 1), None
    if "elevation" in rows:
        elevation = rows["elevation"]
    else:
        # Height over the sensor is r (A cos el + B sin el) with A and B by the third row of turn.
        A = turn[2, 0] * np.cos(azimuth) + turn[2, 1] * np.sin(azimuth)
        share = down / np.maximum(r * np.hypot(A, turn[2, 2]), 1e-9)
        elevation = np.arctan2(turn[2, 2], A) - np.arccos(np.clip(share, -1.0, 1.0))
    c = np.cos(elevation)
    ray = np.stack((c * np.cos(azimuth), c * np.sin(azimuth), np.sin(elevation)), 1)
    x = r[:, None] * ray @ turn.T
    distance = np.maximum(np.hypot(x[:, 0], x[:, 1]), 1e-9)
    along = x[:, :2] @ level(turn)
    z = np.stack((distance, np.arctan2(along[:, 1], along[:, 0])), 1)
    measured = "elevation" in rows
    return z, distance / np.maximum(r, 1e-9) if measured else np.minimum(r / distance, STEEP)


def above(rows: Mapping[str, Array], turn: Array, down: float, polar_rows: bool) -> Array:
    """Heights (n,) [m] over the sensor, by their elevation or z, else those of targets."""
    if polar_rows and "elevation" in rows:
        r, azimuth, elevation = rows["range"], rows["azimuth"], rows["elevation"]
        c = r * np.cos(elevation)
        x = np.stack((c * np.cos(azimuth), c * np.sin(azimuth), r * np.sin(elevation)), 1)
        return np.asarray(x @ turn[2])
    if not polar_rows and "z" in rows:
        return np.asarray(np.stack((rows["x"], rows["y"], rows["z"]), 1) @ turn[2])
    return np.full(len(rows["range" if polar_rows else "x"]), down)


def in_plane(rows: Mapping[str, Array], turn: Array, down: float) -> tuple[Array, Array]:
    """Offsets (n, 2) in the map from the sensor, and their Jacobian (2, 2) over x and y."""
    x = np.stack((rows["x"], rows["y"]), 1)
    if "z" in rows:
        return x @ turn[:2, :2].T + rows["z"][:, None] * turn[:2, 2], turn[:2, :2]
    if turn[2, 2] == 1:
        return x @ turn[:2, :2].T, turn[:2, :2]
    z = (down - x @ turn[2, :2]) / turn[2, 2]
    J = turn[:2, :2] - np.outer(turn[:2, 2], turn[2, :2]) / turn[2, 2]
    return x @ turn[:2, :2].T + z[:, None] * turn[:2, 2], J

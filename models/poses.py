"""Poses of sensors at any time."""

from __future__ import annotations

import numpy as np

from .errors import InputError
from .records import Array, Sensor


def pose_at(sensor: Sensor, time_ns: int) -> tuple[Array, Array]:
    """Position (3,) [m] and rotation (3, 3), sensor to map, at ``time_ns``.

    Linear in position, spherical linear in orientation between the samples, constant outside.

    Raises
    ------
    InputError : nobody knows where the sensor is
    """
    t, k = sensor.time_ns, len(sensor.time_ns)
    if k == 0:
        raise InputError(f"the pose of the {sensor.kind} is not known")
    i = min(max(int(np.searchsorted(t, time_ns)), 1), k - 1) if k > 1 else 0
    before = max(i - 1, 0)
    gap = float(t[i] - t[before])
    share = min(max(float(time_ns - t[before]) / gap, 0.0), 1.0) if gap else 0.0
    a, b = sensor.position[before], sensor.position[i]
    return a + share * (b - a), rotation(
        slerp(sensor.quaternion[before], sensor.quaternion[i], share)
    )


def slerp(a: Array, b: Array, share: float) -> Array:
    """Unit quaternion (4,) at ``share`` in [0, 1] of the shorter way from ``a`` to ``b``."""
    cosine = float(a @ b)
    if cosine < 0:
        b, cosine = -b, -cosine
    angle = np.arccos(min(cosine, 1.0))
    if angle < 1e-6:
        q = a + share * (b - a)
    else:
        q = np.sin((1 - share) * angle) * a + np.sin(share * angle) * b
    return np.asarray(q / np.linalg.norm(q))


def rotation(quaternion: Array) -> Array:
    """Rotation matrix (3, 3) of a unit quaternion x, y, z, w."""
    x, y, z, w = quaternion.tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def yaw_quaternion(yaw: Array) -> Array:
    """Quaternions (..., 4) of turns by ``yaw`` [rad] about the vertical axis."""
    half = np.asarray(yaw, float) / 2
    zero = np.zeros_like(half)
    return np.stack((zero, zero, np.sin(half), np.cos(half)), -1)

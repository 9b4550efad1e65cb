"""Poses of sensors at any time, and truths that are put into another frame."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InputError
from ..records import Array, Objects, Sensor


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


def poses_at(sensor: Sensor, time: Array) -> tuple[Array, Array]:
    """:func:`pose_at` of many times (n,) [s]: positions (n, 3) and rotations (n, 3, 3).

    Raises
    ------
    InputError : nobody knows where the sensor is
    """
    if len(sensor.time_ns) < 2:
        q, turn = pose_at(sensor, 0)
        return np.tile(q, (len(time), 1)), np.tile(turn, (len(time), 1, 1))
    t = sensor.time_ns / 1e9
    i = np.clip(np.searchsorted(t, time), 1, len(t) - 1)
    share = np.clip((time - t[i - 1]) / (t[i] - t[i - 1]), 0.0, 1.0)
    a, b = sensor.position[i - 1], sensor.position[i]
    ends = zip(sensor.quaternion[i - 1], sensor.quaternion[i], share.tolist(), strict=True)
    if (sensor.quaternion == sensor.quaternion[0]).all():
        turn = np.tile(rotation(sensor.quaternion[0]), (len(time), 1, 1))
    else:
        turn = np.array([rotation(slerp(*one)) for one in ends]).reshape(-1, 3, 3)
    return a + share[:, None] * (b - a), turn


def velocity_at(sensor: Sensor, time_ns: int) -> Array:
    """Velocity (3,) [m/s] of a sensor in the map at ``time_ns``, as its poses tell it.

    At a sample it is the slope of the parabola through it and its neighbours; between two it is
    interpolated. Outside it is that of the end for as long as the next sample is away, then zero.
    """
    t, p, k = sensor.time_ns, sensor.position, len(sensor.time_ns)
    if k < 2 or time_ns < 2 * t[0] - t[1] or time_ns > 2 * t[-1] - t[-2]:
        return np.zeros(3)
    i = min(max(int(np.searchsorted(t, time_ns, "right")), 1), k - 1)
    first = max(i - 2, 0)
    near = slice(first, i + 2)
    v = np.gradient(p[near], (t[near] - t[i]) * 1e-9, axis=0)[i - 1 - first :]
    share = min(max(float(time_ns - t[i - 1]) / float(t[i] - t[i - 1]), 0.0), 1.0)
    return np.asarray(v[0] + share * (v[1] - v[0]))


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

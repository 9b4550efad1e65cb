"""Sensors above the plane and tilted ones: where their detections are, by vectors in space."""

import numpy as np
import pytest

from echoset.estimators.points.model.measurement import positions
from echoset.estimators.points.model.sensing import SensorParams, look
from echoset.models.errors import InputError
from echoset.models.geometry.poses import rotation
from echoset.models.records import Scan, Sensor

TARGETS = np.array([[300.0, 40.0, 2.0], [-150.0, 260.0, 2.0], [80.0, -90.0, 2.0]])
PARAMS = SensorParams(
    p_detect=0.9,
    clutter_rate=1.0,
    max_range=2000.0,
    std_range=1.0,
    std_azimuth=0.01,
    std_position=1.0,
    target_height=2.0,
)


def quaternion(yaw, pitch, roll):
    """Of a turn about z, then y, then x, each in the turned frame."""
    found = np.array([0.0, 0.0, 0.0, 1.0])
    for angle, axis in ((yaw, 2), (pitch, 1), (roll, 0)):
        turn = np.zeros(4)
        turn[axis], turn[3] = np.sin(angle / 2), np.cos(angle / 2)
        (a, s), (b, t) = (found[:3], found[3]), (turn[:3], turn[3])
        found = np.append(s * b + t * a + np.cross(a, b), s * t - a @ b)
    return found


@pytest.mark.parametrize("angles", [(0, 0, 0), (0.7, 0, 0), (2.0, 0.17, -0.1), (-1.0, -0.05, 0.2)])
@pytest.mark.parametrize("height", [2.0, 25.0])
@pytest.mark.parametrize("elevation", [False, True])
def test_ranges_and_azimuths_in_space(angles, height, elevation):
    q = quaternion(*angles)
    position = np.array([10.0, -20.0, height])
    d = (TARGETS - position) @ rotation(q)
    rows = {"range": np.linalg.norm(d, axis=1), "azimuth": np.arctan2(d[:, 1], d[:, 0])}
    if elevation:
        rows["elevation"] = np.arctan2(d[:, 2], np.hypot(d[:, 0], d[:, 1]))
    sensor = Sensor("radar", np.zeros(1, np.int64), position[None], q[None])
    seen = look(PARAMS, Scan("a", 0, {}, rows), True, sensor)
    np.testing.assert_allclose(positions(seen)[0], TARGETS[:, :2], atol=1e-6)
    np.testing.assert_allclose(seen.rotation @ seen.rotation.T, np.eye(2), atol=1e-12)
    flat = np.hypot(*(TARGETS[:, :2] - position[:2]).T)
    np.testing.assert_allclose(seen.z[:, 0], flat, atol=1e-6)
    if not elevation and not any(angles[1:]):
        slope = rows["range"] / flat
        np.testing.assert_allclose(np.broadcast_to(seen.R, (3, 2, 2))[:, 0, 0], slope**2)


@pytest.mark.parametrize("angles", [(0.7, 0, 0), (2.0, 0.17, -0.1)])
@pytest.mark.parametrize("with_z", [False, True])
def test_positions_in_space(angles, with_z):
    q, position = quaternion(*angles), np.array([10.0, -20.0, 2.0])
    d = (TARGETS - position) @ rotation(q)
    rows = {"x": d[:, 0], "y": d[:, 1]} | ({"z": d[:, 2]} if with_z else {})
    sensor = Sensor("radar", np.zeros(1, np.int64), position[None], q[None])
    seen = look(PARAMS, Scan("a", 0, {}, rows), False, sensor)
    np.testing.assert_allclose(seen.z, TARGETS[:, :2], atol=1e-6)


def test_who_looks_straight_up_has_no_azimuth():
    q = quaternion(0.0, np.pi / 2, 0.0)
    sensor = Sensor("radar", np.zeros(1, np.int64), np.zeros((1, 3)), q[None])
    rows = {"range": np.ones(1), "azimuth": np.zeros(1)}
    with pytest.raises(InputError, match="vertical"):
        look(PARAMS, Scan("a", 0, {}, rows), True, sensor)

"""Poses of moving sensors against scipy's rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from echoset.models.errors import InputError
from echoset.models.geometry.poses import pose_at, velocity_at, yaw_quaternion
from echoset.models.records import Sensor

SECOND = 10**9


def test_between_samples_poses_are_interpolated_and_outside_constant():
    rng = np.random.default_rng(1)
    turns = Rotation.random(4, rng=rng)
    time = np.array([0, 1, 3, 4]) * SECOND
    place = rng.normal(size=(4, 3))
    sensor = Sensor("radar", time, place, turns.as_quat() * [[1], [-1], [1], [-1]])
    slerp = Slerp(time / SECOND, turns)
    for t in (0.0, 0.25, 1.0, 2.5, 3.999, 4.0):
        position, rotation = pose_at(sensor, round(t * SECOND))
        np.testing.assert_allclose(rotation, slerp(t).as_matrix(), atol=1e-12)
        expected = [np.interp(t, time / SECOND, place[:, k]) for k in range(3)]
        np.testing.assert_allclose(position, expected, atol=1e-12)
    for t, k in ((-5, 0), (9, 3)):
        position, rotation = pose_at(sensor, t * SECOND)
        np.testing.assert_allclose(rotation, turns[k].as_matrix(), atol=1e-12)
        np.testing.assert_allclose(position, place[k])


def test_a_yaw_turns_the_x_axis_in_the_plane():
    sensor = Sensor(
        "radar", np.zeros(1, np.int64), np.zeros((1, 3)), yaw_quaternion(np.pi / 3)[None]
    )
    _, rotation = pose_at(sensor, 5)
    np.testing.assert_allclose(rotation[:, 0], [0.5, np.sqrt(3) / 2, 0.0], atol=1e-15)


def test_a_sensor_without_a_pose_is_refused():
    with pytest.raises(InputError, match="pose of the device"):
        pose_at(Sensor.device(), 0)


def test_the_velocity_of_a_sensor_under_constant_acceleration():
    """Exact at samples within, whatever their spacing, and so between them."""
    time = np.array([0, 1, 3, 4, 6]) * SECOND
    t = time / SECOND
    v0, a = np.array([3.0, -1.0, 0.5]), np.array([0.5, 2.0, -1.0])
    still = np.tile([0.0, 0.0, 0.0, 1.0], (5, 1))
    sensor = Sensor("radar", time, t[:, None] * v0 + t[:, None] ** 2 * a / 2, still)
    for at in (1.0, 1.5, 3.0, 3.25, 4.0):
        np.testing.assert_allclose(velocity_at(sensor, round(at * SECOND)), v0 + at * a, atol=1e-12)
    for end, ahead, beyond in ((0, -1, -2), (6, 7, 9)):
        v = velocity_at(sensor, end * SECOND)
        np.testing.assert_allclose(v, v0 + a * (0.5 if end == 0 else 5.0), atol=1e-12)
        np.testing.assert_array_equal(velocity_at(sensor, ahead * SECOND), v)
        np.testing.assert_array_equal(velocity_at(sensor, beyond * SECOND), np.zeros(3))
    rest = Sensor.static("radar", np.ones(2))
    np.testing.assert_array_equal(velocity_at(rest, 5), np.zeros(3))
    two = Sensor("radar", time[:2], sensor.position[:2], still[:2])
    np.testing.assert_allclose(velocity_at(two, SECOND // 3), v0 + a / 2, atol=1e-12)

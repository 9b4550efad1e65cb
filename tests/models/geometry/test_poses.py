"""Poses of moving sensors against scipy's rotations."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from echoset.models.errors import InputError
from echoset.models.geometry.poses import pose_at, yaw_quaternion
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

"""Constant velocity."""

from __future__ import annotations

import numpy as np

from echoset.models.motion import constant_velocity


def test_motion_under_constant_acceleration_is_exact():
    F, G = constant_velocity(0.5)
    x, a = np.array([1.0, 2.0, 3.0, 4.0]), np.array([2.0, -4.0])
    assert np.allclose(F @ x + G @ a, [1 + 1.5 + 0.25, 2 + 2 - 0.5, 4.0, 2.0])


def test_steps_compose():
    (F1, G1), (F2, G2), (F, G) = (constant_velocity(dt) for dt in (0.1, 0.3, 0.4))
    assert np.allclose(F2 @ F1, F)
    assert np.allclose(F2 @ G1 + G2, G)

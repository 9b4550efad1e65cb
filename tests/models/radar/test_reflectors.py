"""Reflection points of a vehicle and from where they are seen."""

import numpy as np
import pytest

from echoset.models.radar.reflectors import pedestrian, vehicle, visibility

CAR = vehicle(4.5, 1.8, (20.0, 0.0, 5.0), (0.05, 0.2), (0.8, 1.2), (1.7, 2.35))


def test_a_vehicle_has_twelve_points_on_its_outline() -> None:
    p = CAR.position
    assert p.shape == (12, 2)
    on_edge = np.isclose(np.abs(p[:, 0]), 2.25) | np.isclose(np.abs(p[:, 1]), 0.9)
    assert on_edge.all()
    assert CAR.rcs.tolist() == [20.0] * 4 + [0.0] * 4 + [5.0] * 4


def test_from_ahead_the_front_and_the_front_corners_are_seen() -> None:
    v = visibility(CAR, np.array(0.0))
    assert v[:4].tolist() == [1, 0, 0, 0]
    assert v[8:] == pytest.approx([1, 0, 0, 1], abs=1e-2)


def test_from_the_left_what_is_on_the_left() -> None:
    v = visibility(CAR, np.array(np.pi / 2))
    assert v[:4].tolist() == [0, 1, 0, 0]
    assert v[4:8].tolist() == [1, 1, 0, 0]


def test_the_ramp_is_linear_and_wraps() -> None:
    v = visibility(CAR, np.array([0.125, 2 * np.pi + 0.125, -0.125]))
    assert v[:, 0] == pytest.approx(0.5)


def test_a_pedestrian_is_seen_from_everywhere() -> None:
    assert visibility(pedestrian(1.0), np.linspace(-7, 7, 50)).min() == 1


def test_a_pedestrian_is_seen_from_straight_behind() -> None:
    assert (visibility(pedestrian(1.0), np.array([np.pi, -np.pi, 3 * np.pi])) == 1).all()

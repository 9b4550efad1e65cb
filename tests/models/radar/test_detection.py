"""Fields of view: which points are in them, and their shape as polygons."""

import numpy as np
import pytest

from echoset.models.geometry.regions import area
from echoset.models.radar.detection import View, polar


def test_a_view_across_the_back():
    view = View(3.0, 3.5, 1.0, 2.0)
    seen = view.contains(np.array([1.5, 1.5, 1.5, 0.5, 2.5]), np.array([3.1, -3.0, 2.9, 3.1, 3.1]))
    assert seen.tolist() == [True, True, False, False, False]
    assert View().contains(np.array([9.0]), np.array([-3.0])).all()


def test_columns_of_a_scan_state_the_view():
    view = View.of({"view_azimuth_min": 0.1, "view_azimuth_max": 0.4}, 50.0)
    assert view == View(0.1, 0.4, 0.0, 50.0)
    assert view.area == pytest.approx(15.0)
    assert view.bounded and not View().bounded


@pytest.mark.parametrize("near", [0.0, 3.0])
@pytest.mark.parametrize("width", [0.04, 1.0, 4.0, 2 * np.pi])
def test_corners_enclose_the_sector(near, width):
    view = View(-0.3, -0.3 + width, near, 10.0)
    corners = view.corners()
    assert area(corners) == pytest.approx(width / 2 * (100.0 - near**2), rel=1e-12)
    distance, _ = polar(corners)
    assert np.abs(distance[distance > near + 1] - 10.0).max() < 2.5e-3


def test_a_view_that_runs_over_the_cut_has_its_width():
    assert View(3.0, -3.0, 0.0, 1.0).width == pytest.approx(2 * np.pi - 6.0)

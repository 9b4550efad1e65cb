"""A measured recording: two-way ranges of a robot in a labyrinth, and its wheels."""

from __future__ import annotations

import pytest
from papers.labyrinth import DATA, rmse

pytestmark = [
    pytest.mark.verification,
    pytest.mark.skipif(not DATA.is_dir(), reason=f"no recording in {DATA}; set ECHOSET_DATA"),
]


def test_all_defaults_estimate_the_range_bias():
    value, error = rmse({})
    print(f"all defaults: {value:.3f} ± {error:.3f} m")
    assert value <= 0.125


def test_ranges_taken_as_calibrated():
    """The offset of the ranges stays in: no better than a range EKF, 0.22 m, within two errors."""
    value, error = rmse({"range_bias_std": 0.0, "learn": []})
    print(f"range bias left out: {value:.3f} ± {error:.3f} m")
    assert value <= 0.22 + 2 * error


def test_smoothed():
    value, error = rmse({"smooth": "whole"})
    print(f"smoothed: {value:.3f} ± {error:.3f} m")
    assert value <= 0.095


def test_all_ranges_at_once():
    value, error = rmse({}, "range-ls")
    print(f"range-ls: {value:.3f} ± {error:.3f} m")
    assert value <= 0.09


def test_wheels_help_the_filter():
    value, error = rmse({}, wheels=True)
    print(f"with the wheels: {value:.3f} ± {error:.3f} m")
    assert value <= 0.07 + error


def test_wheels_and_all_ranges_at_once():
    value, error = rmse({}, "range-ls", wheels=True)
    print(f"range-ls, with the wheels: {value:.3f} ± {error:.3f} m")
    assert value <= 0.05

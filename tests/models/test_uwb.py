"""Ranges of a UWB network."""

from __future__ import annotations

import numpy as np

from echoset.models.uwb import (
    device_position,
    distance,
    free_space_amplitude,
    range_std,
    scatter_distance,
)


def test_range_std_is_the_root_of_the_inverse_fisher_information():
    # 1 GHz rms bandwidth and amplitude 1: c / (sqrt(8) pi 1e9) = 33.7385 mm
    assert np.isclose(range_std(1.0, 1e9), 0.0337385, rtol=1e-5)
    assert np.allclose(
        range_std(np.array([1.0, 2.0, 10.0]), 1e9) * [1, 2, 10], 0.0337385, rtol=1e-5
    )


def test_free_space_amplitude_loses_6_db_per_doubling():
    snr = 20 * np.log10(free_space_amplitude(np.array([1.0, 2.0, 4.0]), 30.0))
    assert np.allclose(snr, [30.0, 23.979400, 17.958800])


def test_paths_by_hand():
    a, b = np.array([[0.0, 0.0], [3.0, 0.0]]), np.array([3.0, 4.0])
    assert np.allclose(distance(a, b), [5.0, 4.0])
    assert np.allclose(scatter_distance(a[0], b, a[1]), 9.0)
    assert np.allclose(scatter_distance(a[0], b, a[0]), 10.0)


def test_device_turns_about_the_centre():
    m = device_position(np.array([1.0, 2.0]), np.full(3, 0.5), np.array([0.0, np.pi / 2, np.pi]))
    assert np.allclose(m, [[1.5, 2.0], [1.0, 2.5], [0.5, 2.0]])

"""Ranges of a UWB network."""

from __future__ import annotations

import numpy as np

from echoset.models.uwb import (
    Region,
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


def test_a_region_of_few_far_anchors_is_drawn_from_evenly():
    """Two unit discs 1 m apart, whose union has 5.0548 m^2, and one 1000 km away."""
    anchors = np.array([[0.0, 0.0], [1.0, 0.0], [1e6, 0.0]])
    region, n = Region(anchors, 1.0), 20_000
    p = region.draw(n, np.random.default_rng(5))
    away = np.linalg.norm(p.T[:, None] - anchors, axis=2)
    assert p.shape == (2, n) and (away.min(1) <= 1 + 1e-9).all()
    lens = 2 * np.pi / 3 - np.sqrt(3) / 2
    whole = 3 * np.pi - lens
    shares = {"far": np.pi / whole, "both": lens / whole, "upper": 0.5, "inner": np.pi / 4 / whole}
    found = {
        "far": away[:, 2] <= 1,
        "both": (away[:, :2] <= 1).all(1),
        "upper": p[1] > 0,
        "inner": away[:, 2] <= 0.5,
    }
    for name, share in shares.items():
        error = np.sqrt(share * (1 - share) / n)
        assert abs(found[name].mean() - share) < 4.5 * error, name
    assert np.isclose(region.area(), whole, rtol=1e-3)
    np.testing.assert_allclose(
        region.covariance()[0, 0], 1e12 * shares["far"] * (1 - shares["far"]), rtol=1e-3
    )
    tiny = Region(anchors, 1e-9).draw(10, np.random.default_rng(1))
    assert np.abs(tiny[0][:, None] - anchors[:, 0]).min(1).max() <= 1e-9

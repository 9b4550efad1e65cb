"""Soft maps against maps whose value at any place is known, and the twin against its definition."""

import numpy as np
import pytest

from echoset.estimators.maps.detector import Station
from echoset.estimators.maps.kernels import cnn, fusion
from echoset.estimators.maps.kernels.compiled import fusion as compiled
from echoset.estimators.maps.kernels.fusion import Pixels
from echoset.models.geometry.poses import yaw_quaternion
from echoset.models.records import Sensor

RANGE, AZIMUTH = 20 + np.arange(120) * 0.5, np.deg2rad(np.arange(-60, 61, 3.0))
PIXELS = Pixels.of((-20.0, 20.0, -10.0, 10.0), 0.5)


def station(x, y, yaw, distance=RANGE, azimuth=AZIMUTH, pixels=PIXELS, z=0.0):
    quaternion = yaw_quaternion(np.array([yaw]))
    sensor = Sensor("radar", np.zeros(1, np.int64), np.array([[x, y, z]]), quaternion)
    return Station.of(sensor, {"range_axis": distance, "azimuth_axis": azimuth}, pixels)


def resampled(power, where, pixels=PIXELS, add=compiled.add):
    soft, t = np.zeros((pixels.ny, pixels.nx), np.float32), where.table
    add(soft, np.asarray(power, np.float32), t.pixel, t.corner, t.u, t.v)
    return soft


def local(pixels, x, y, yaw):
    """Range and azimuth of all pixels from a station, by complex numbers."""
    row, column = np.mgrid[: pixels.ny, : pixels.nx]
    z = (pixels.x(column) - x) + 1j * (pixels.y(row) - y)
    return np.abs(z), np.angle(z * np.exp(-1j * yaw))


@pytest.mark.parametrize("pose", [(-50.0, 0.0, 0.0), (30.0, 40.0, -2.2), (-3.0, -45.0, np.pi / 2)])
def test_a_bilinear_map_is_met_exactly(pose):
    r, a = local(PIXELS, *pose)
    R, A = np.meshgrid(RANGE, AZIMUTH, indexing="ij")
    soft = resampled(3 + 2 * R + 50 * A + A * R, station(*pose))
    inside = (r >= RANGE[0]) & (r <= RANGE[-1]) & (np.abs(a) <= AZIMUTH[-1])
    assert inside.sum() > 500
    np.testing.assert_allclose(soft, np.where(inside, 3 + 2 * r + 50 * a + a * r, 0.0), rtol=2e-6)


def test_a_station_on_a_mast_sees_slant_ranges_and_cones():
    """Of a place on the ground: distance in space, and the angle to the array's normal plane."""
    x, y, yaw, z = -25.0, 4.0, 0.2, 12.0
    row, column = np.mgrid[: PIXELS.ny, : PIXELS.nx]
    offset = np.stack((PIXELS.x(column) - x, PIXELS.y(row) - y, np.full(row.shape, -z)), -1)
    r = np.linalg.norm(offset, axis=-1)
    a = np.pi / 2 - np.arccos(offset @ (-np.sin(yaw), np.cos(yaw), 0.0) / r)
    R, A = np.meshgrid(RANGE, AZIMUTH, indexing="ij")
    soft = resampled(3 + 2 * R + 50 * A, station(x, y, yaw, z=z))
    inside = (r >= RANGE[0]) & (r <= RANGE[-1]) & (np.abs(a) <= AZIMUTH[-1])
    assert 500 < inside.sum() < inside.size
    np.testing.assert_allclose(soft, np.where(inside, 3 + 2 * r + 50 * a, 0.0), rtol=2e-6)


def test_outside_of_a_map_is_nothing():
    pose = (-25.0, 0.0, 0.3)
    r, a = local(PIXELS, *pose)
    outside = (r < RANGE[0]) | (r > RANGE[-1]) | (np.abs(a) > AZIMUTH[-1])
    soft = resampled(np.ones((len(RANGE), len(AZIMUTH))), station(*pose))
    assert 100 < outside.sum() < outside.size - 100
    np.testing.assert_allclose(soft, ~outside)


@pytest.mark.parametrize("pose", [(-50.0, 0.0, 0.0), (30.0, 40.0, -2.2)])
def test_one_bright_cell_lands_where_it_is(pose):
    i, j = 60, 22
    power = np.zeros((len(RANGE), len(AZIMUTH)))
    power[i, j] = 7.0
    soft = resampled(power, station(*pose))
    where = complex(*pose[:2]) + RANGE[i] * np.exp(1j * (AZIMUTH[j] + pose[2]))
    row, column = np.unravel_index(soft.argmax(), soft.shape)
    assert abs(PIXELS.x(column) - where.real) <= 0.25 + 1e-9
    assert abs(PIXELS.y(row) - where.imag) <= 0.25 + 1e-9
    r, a = local(PIXELS, *pose)
    beyond = (np.abs(r - RANGE[i]) >= 0.5) | (np.abs(a - AZIMUTH[j]) >= np.deg2rad(3))
    assert (soft[beyond] == 0).all()
    tent = 7 * (1 - np.abs(r - RANGE[i]) / 0.5) * (1 - np.abs(a - AZIMUTH[j]) / np.deg2rad(3))
    np.testing.assert_allclose(soft[~beyond], tent[~beyond], atol=2e-5)


def test_azimuths_behind_the_back_and_the_whole_way_round():
    azimuth = np.linspace(np.pi / 2, 5 * np.pi / 2, 73)
    pose = (0.0, 0.0, 0.4)
    where = station(*pose, distance=np.arange(60) * 0.5, azimuth=azimuth)
    soft = resampled(np.tile(azimuth, (60, 1)), where)
    _, a = local(PIXELS, *pose)
    np.testing.assert_allclose(soft, np.pi / 2 + (a - np.pi / 2) % (2 * np.pi), rtol=1e-6)


def test_maps_of_different_axes_add_up():
    a, b = station(-50.0, 0.0, 0.0), station(0.0, 50.0, -np.pi / 2, azimuth=AZIMUTH[::2])
    one = np.random.default_rng(0).exponential(size=(len(RANGE), len(AZIMUTH)))
    two = np.random.default_rng(1).exponential(size=(len(RANGE), len(AZIMUTH[::2])))
    soft = resampled(one, a)
    t = b.table
    compiled.add(soft, two.astype(np.float32), t.pixel, t.corner, t.u, t.v)
    np.testing.assert_allclose(soft, resampled(one, a) + resampled(two, b), rtol=1e-6)


def test_the_twin_is_the_definition():
    rng = np.random.default_rng(2)
    for _ in range(5):
        where = station(*rng.uniform(-40, 40, 2), rng.uniform(-3, 3))
        power = rng.exponential(size=(len(RANGE), len(AZIMUTH))) * 10 ** rng.uniform(0, 6)
        np.testing.assert_array_equal(
            resampled(power, where), resampled(power, where, add=fusion.add)
        )


def test_pixels_fill_the_region():
    pixels = Pixels.of((-20.0, 20.0, -5.0, 5.0), 0.1)
    assert (pixels.nx, pixels.ny) == (400, 100)
    np.testing.assert_allclose(
        pixels.centres()[[0, 1, 400]], [[-19.95, -4.95], [-19.85, -4.95], [-19.95, -4.85]]
    )


def test_windows_are_the_pixels_about_a_place():
    pixels = Pixels.of((-20.0, 20.0, -20.0, 20.0), 0.1)
    soft = np.arange(400 * 400, dtype=np.float32).reshape(400, 400)
    where = np.array([[0.0, 1.0], [1.03, -2.06]])
    for window, (column, row) in zip(
        cnn.windows(soft, where, pixels), ((170, 180), (180, 149)), strict=True
    ):
        np.testing.assert_array_equal(window, soft[row : row + 60, column : column + 60])


def test_windows_are_dark_beyond_the_map():
    pixels = Pixels.of((-20.0, 20.0, -20.0, 20.0), 0.1)
    soft = np.ones((400, 400), np.float32)
    corner, far, huge = cnn.windows(
        soft, np.array([[-20.0, 20.0], [0, 23.5], [1e12, -1e12]]), pixels
    )
    assert (corner[:30, 30:] == 1).all() and corner.sum() == 900
    assert not far.any() and not huge.any()
    assert cnn.windows(soft, np.zeros((0, 2)), pixels).shape == (0, 60, 60)

"""How filters see detections: measures of clutter, moments of ranges and azimuths, births."""

import numpy as np
import pytest

from echoset.estimators.points.kernels import births
from echoset.estimators.points.model.edge import detection_probability
from echoset.estimators.points.model.measurement import expected, positions
from echoset.estimators.points.model.sensing import Look, SensorParams, look
from echoset.models.geometry.poses import yaw_quaternion
from echoset.models.radar.detection import View
from echoset.models.records import Sensor

TURN = 2.2
SENSOR = Sensor(
    "radar", np.zeros(1, np.int64), np.array([[10.0, -20.0, 0.0]]), yaw_quaternion(TURN)[None]
)
BASE = {"p_detect": 0.9, "clutter_rate": 12.0, "std_position": 2.0, "std_range": 3.0}


def seen(make_recording, detections, kind="range_bearing", **changes):
    recording = make_recording([detections], kind, sensor=SENSOR)
    params = SensorParams(**{**BASE, "std_azimuth": 0.05, **changes})
    return look(params, next(recording.scans()), kind == "range_bearing", SENSOR)


def wrapped(angle):
    return (angle + np.pi) % (2 * np.pi) - np.pi


def measure(x):
    """Range and azimuth of positions (n, 2) in the map, by complex numbers."""
    d = (x[:, 0] + 1j * x[:, 1] - (10.0 - 20.0j)) * np.exp(-1j * TURN)
    return np.stack((np.abs(d), np.angle(d)), 1)


def test_clutter_uniform_in_the_view_has_its_density_in_both_measures(make_recording):
    polar = seen(make_recording, [[50.0, 0.3], [80.0, -2.0]], max_range=100.0)
    np.testing.assert_allclose(polar.clutter, 12.0 / (100.0 * 2 * np.pi))
    z = [[30.0, 40.0], [0.0, -80.0]]
    flat = seen(make_recording, z, "position", max_range=100.0)
    # Uniform in range and azimuth: the density per area falls with the range.
    np.testing.assert_allclose(flat.clutter, 12.0 / (100.0 * 2 * np.pi * np.array([50.0, 80.0])))


def test_clutter_uniform_in_a_region_has_its_density_in_both_measures(make_recording):
    region = {"clutter_region": (0.0, 200.0, -100.0, 100.0)}
    flat = seen(make_recording, [[30.0, 40.0]], "position", **region)
    np.testing.assert_allclose(flat.clutter, 12.0 / 200.0**2)
    polar = seen(make_recording, [[50.0, 0.3]], **region)
    np.testing.assert_allclose(polar.clutter, 12.0 / 200.0**2 * 50.0)


def test_positions_turn_with_the_sensor(make_recording):
    z = np.array([[50.0, 0.3], [20.0, -1.0]])
    polar = seen(make_recording, z, max_range=100.0)
    where, R = positions(polar)
    np.testing.assert_allclose(measure(where), z, atol=1e-12)
    flat = seen(make_recording, z[:, :1] * np.stack((np.cos(z[:, 1]), np.sin(z[:, 1])), 1),
                "position", max_range=100.0)  # fmt: skip
    np.testing.assert_allclose(flat.z, where, atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(R), (3.0 * 0.05 * z[:, 0]) ** 2)


def test_the_extended_update_linearises_at_the_mean(make_recording):
    polar = seen(make_recording, [], max_range=100.0)
    m = np.array([[40.0, 30.0, 1.0, 2.0], [-30.0, 5.0, 0.0, 0.0]])
    z_hat, C, S = expected(polar, m, np.tile(np.eye(4), (2, 1, 1)), False)
    np.testing.assert_allclose(z_hat, measure(m), atol=1e-12)
    step = 1e-6
    for d in range(4):
        shift = step * np.eye(4)[d]
        slope = wrapped(measure(m + shift) - measure(m - shift)) / (2 * step)
        np.testing.assert_allclose(C[:, d], slope, atol=1e-8)
    np.testing.assert_allclose(S, C.swapaxes(1, 2) @ C, atol=1e-12)


def test_unscented_moments_are_those_of_samples(make_recording):
    """Wide in azimuth, where the mean range is well above the range of the mean."""
    rng = np.random.default_rng(1)
    polar = seen(make_recording, [], max_range=100.0)
    direction = np.exp(1j * (TURN + np.pi))
    m = np.array([[10.0 + 60 * direction.real, -20.0 + 60 * direction.imag, 1.0, 2.0]])
    A = rng.normal(size=(4, 4))
    P = (A @ A.T + np.diag([40.0, 40.0, 0.0, 0.0]))[None]
    n = 400_000
    x = rng.multivariate_normal(m[0], P[0], n)
    z = measure(x)
    z_hat, C, S = expected(polar, m, P, True)
    e = np.stack((z[:, 0] - z_hat[0, 0], wrapped(z[:, 1] - z_hat[0, 1])), 1)
    assert z_hat[0, 0] > np.linalg.norm(m[0, :2] - SENSOR.position[0, :2]) + 0.2
    np.testing.assert_allclose(e.mean(0) / e.std(0), 0.0, atol=0.01)
    np.testing.assert_allclose(np.cov(e.T), S[0], rtol=0.05, atol=0.01)
    np.testing.assert_allclose((x - m).T @ e / n, C[0], atol=0.02 * np.abs(C[0]).max())


def test_detection_by_mean_or_by_mass():
    view = View(-0.4, 0.4, 0.0, 100.0)
    here = Look(True, *(np.zeros((0, 2)),) * 2, np.zeros(0), np.zeros(2), np.zeros(2), np.eye(2),
                view, 0.8, np.zeros(0))  # fmt: skip
    ray = 50 * np.array([np.cos(0.4), np.sin(0.4), 0.0, 0.0])
    m = np.array([[50.0, 0.0, 0.0, 0.0], ray, [-50.0, 0.0, 0.0, 0.0]])
    P = np.tile(4.0 * np.eye(4), (3, 1, 1))
    assert detection_probability(here, m, P, False)[[0, 2]].tolist() == [0.8, 0.0]
    np.testing.assert_allclose(detection_probability(here, m, P, True), [0.8, 0.4, 0.0], atol=1e-3)


def test_births_at_detections_share_their_rate_by_novelty():
    where = np.arange(8.0).reshape(4, 2)
    moments = (
        np.hstack((where, np.zeros((4, 2)))),
        np.tile(np.diag([2.0, 2.0, 9.0, 16.0]), (4, 1, 1)),
    )
    novelty = np.array([0.9, 0.0, 0.3, 0.6])
    w, m, P = births.at_detections(0.5, *moments, novelty, 9)
    np.testing.assert_allclose(w, [0.25, 0.5 / 6, 0.5 / 3])
    np.testing.assert_array_equal(m[:, :2], where[[0, 2, 3]])
    np.testing.assert_array_equal(P[0], np.diag([2.0, 2.0, 9.0, 16.0]))
    assert births.at_detections(9.0, *moments, novelty, 9)[0].tolist() == [
        0.9,
        0.3,
        0.6,
    ]
    assert births.at_detections(0.5, *moments, novelty, 1)[1].tolist() == [[0, 1, 0, 0]]
    assert len(births.at_detections(0.5, *moments, np.zeros(4), 9)[0]) == 0


@pytest.mark.parametrize("turned", [False, True])
def test_births_along_an_edge_lie_along_it(turned):
    edge = np.array([0.0, 0.0, 0.0, 80.0] if not turned else [0.0, 0.0, 80.0, 0.0])
    w, m, P = births.along_edge(2.0, edge, 4, 1.0, np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    along = 0 if turned else 1
    assert w.sum() == 2.0
    assert m[:, along].tolist() == [10.0, 30.0, 50.0, 70.0]
    assert (P[0, along, along], P[0, 1 - along, 1 - along], P[0, 0, 1]) == (400.0, 1.0, 0.0)

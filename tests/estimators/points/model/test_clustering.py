"""Clusters of detections: means, how sure they are, and targets with several detections."""

import numpy as np
import pytest

from echoset.estimators.points import mbm, phd, pmb
from echoset.estimators.points.model.clustering import PRIOR, ClusterParams, clustered
from echoset.models.records import Scan

CLOSE = ClusterParams(cluster="dbscan", cluster_radius=2.0, cluster_doppler=1.0)


def scan(x, **more):
    x = np.asarray(x, float)
    return Scan("radar", 0, {}, {"x": x[:, 0], "y": x[:, 1], **more})


def test_means_of_neighbours_and_who_is_alone():
    z = [[0.0, 0.0], [1.5, 0.0], [3.0, 0.0], [50.0, 0.0], [0.0, 30.0], [0.0, 31.0]]
    found = clustered(CLOSE, scan(z, power=np.arange(6.0)), False, np.eye(2)[None]).rows
    at = np.stack((found["x"], found["y"]), 1)
    np.testing.assert_allclose(at[np.lexsort(at.T)], [[1.5, 0.0], [50.0, 0.0], [0.0, 30.5]])
    assert sorted(found["power"]) == [1.0, 3.0, 4.5]
    alone = int(np.argmax(found["x"]))
    assert (found["cov_xx"][alone], found["cov_xy"][alone], found["cov_yy"][alone]) == (1, 0, 1)


def test_doppler_parts_what_is_side_by_side():
    z = [[0.0, 0.0], [1.0, 0.0], [0.5, 0.9], [0.5, -0.9]]
    doppler = np.array([3.0, 3.2, -4.0, -4.2])
    found = clustered(CLOSE, scan(z, doppler=doppler), False, np.eye(2)[None]).rows
    assert sorted(found["doppler"]) == pytest.approx([-4.1, 3.1])
    assert sorted(found["y"]) == [0.0, 0.0]


def test_azimuths_are_not_torn_at_half_a_turn():
    rows = {"range": np.array([10.0, 10.0]), "azimuth": np.array([np.pi - 0.05, -np.pi + 0.03])}
    found = clustered(CLOSE, Scan("radar", 0, {}, rows), True, np.diag([1.0, 0.01])[None]).rows
    assert found["azimuth"][0] == pytest.approx(np.pi - 0.01)
    # (2 * 0.04^2 + PRIOR * 0.01) / (1 + PRIOR) / 2
    expected = (2 * 0.04**2 + PRIOR * 0.01) / (1 + PRIOR) / 2
    assert found["std_azimuth"][0] == pytest.approx(np.sqrt(expected))


def test_the_covariance_is_that_of_means():
    """Of ten detections of a body as large as the noise."""
    rng, runs, n = np.random.default_rng(1), 2000, 10
    body = np.diag([1.0, 0.3])
    means, told = [], []
    wide = ClusterParams(cluster="dbscan", cluster_radius=50.0)
    for _ in range(runs):
        z = rng.multivariate_normal((20.0, 10.0), body + np.eye(2), n)
        rows = clustered(wide, scan(z), False, np.eye(2)[None]).rows
        means.append((rows["x"][0], rows["y"][0]))
        told.append((rows["cov_xx"][0], rows["cov_xy"][0], rows["cov_yy"][0]))
    true = (body + np.eye(2)) / n
    # The noise alone is assumed before, and counts for PRIOR of the detections.
    weight = PRIOR / (n - 1 + PRIOR)
    expected = ((1 - weight) * (body + np.eye(2)) + weight * np.eye(2)) / n
    error = 4.5 * 0.2 * np.sqrt(2 / runs)
    np.testing.assert_allclose(np.cov(np.transpose(means)), true, atol=error)
    xx, xy, yy = np.mean(told, 0)
    np.testing.assert_allclose([[xx, xy], [xy, yy]], expected, atol=0.01)


@pytest.mark.parametrize("module", [phd, mbm, pmb])
def test_a_body_is_one_target(make_recording, module):
    rng = np.random.default_rng(2)
    scans = [[100.0, 50.0] + k * np.array([5.0, 0.0]) + rng.normal(size=(6, 2)) for k in range(15)]
    recording = make_recording(scans)
    params = {
        "p_detect": 0.95, "clutter_rate": 0.1, "clutter_region": (0.0, 300.0, 0.0, 100.0),
        "std_position": 0.5, "std_acceleration": 0.3, "birth_rate": 0.1,
    }  # fmt: skip
    number = {}
    for cluster in ("none", "dbscan"):
        made = module.Params(**params, cluster=cluster)
        steps = list(module.estimate(recording.setup(), recording.scans(), made, rng))
        number[cluster] = np.mean([len(step.objects.label) for step in steps[5:]])
    last = steps[-1].objects.state[0]
    assert number["none"] > 2 and number["dbscan"] == pytest.approx(1.0, abs=0.11)
    assert np.hypot(*(last[:2] - [170.0, 50.0])) < 1.5

"""Clusters of pixels against scikit-learn, brute force and numbers by hand."""

import numpy as np
import pytest
from scipy.spatial import cKDTree
from sklearn.cluster import DBSCAN

from echoset.estimators.maps.kernels import pixels
from echoset.estimators.maps.kernels.compiled import pixels as compiled


def masks(rng):
    """Random pixels, even and in clumps, on grids of all shapes."""
    for k in range(60):
        shape = rng.integers(1, 50, 2)
        if k % 2:
            yield rng.random(shape) < rng.choice([0.01, 0.05, 0.2, 0.7])
        else:
            mask = np.zeros(shape, bool)
            middle = rng.uniform(0, shape, (6, 2))[rng.integers(0, 6, 150)]
            p = np.rint(middle + rng.normal(0, 1.5, (150, 2))).astype(int)
            p = p[((p >= 0) & (p < shape)).all(1)]
            mask[tuple(p.T)] = True
            yield mask


@pytest.mark.parametrize("dbscan", [pixels.dbscan, compiled.dbscan])
def test_labels_are_scikit_learns(dbscan):
    rng = np.random.default_rng(0)
    several = noise = border = 0
    for mask in masks(rng):
        reach2, least = int(rng.integers(1, 90)), int(rng.integers(1, 12))
        point = np.argwhere(mask)
        label = dbscan(mask, reach2, least)
        assert label.shape == (len(point),)
        if not len(point):
            continue
        found = DBSCAN(eps=np.sqrt(reach2 + 0.5), min_samples=least).fit(point)
        np.testing.assert_array_equal(label, found.labels_)
        several += found.labels_.max() > 1
        noise += (found.labels_ < 0).any()
        border += ((found.labels_ >= 0).sum() > len(found.core_sample_indices_)) and (
            found.labels_.max() > 0
        )
    assert min(several, noise, border) >= 5


def test_labels_with_the_neighbourhood_of_the_maps():
    rng = np.random.default_rng(1)
    mask = np.zeros((400, 400), bool)
    middle = np.vstack((rng.uniform(0, 400, (25, 2)), np.full((2, 2), 200)))
    middle = middle[np.append(rng.integers(0, 25, 2300), np.full(40, 26))]
    p = np.clip(np.rint(middle + rng.normal(0, 5, middle.shape)), 0, 399).astype(int)
    mask[tuple(p.T)] = True
    expected = DBSCAN(eps=30.0, min_samples=50).fit(np.argwhere(mask)).labels_
    assert expected.max() > 5 and (expected < 0).any()
    np.testing.assert_array_equal(compiled.dbscan(mask, 900, 50), expected)


@pytest.mark.parametrize("nearest", [pixels.nearest, compiled.nearest])
def test_pixels_go_to_the_nearest_target_within_its_gate(nearest):
    rng = np.random.default_rng(2)
    point, where = rng.uniform(0, 40, (2000, 2)), rng.uniform(0, 40, (8, 2))
    gate = rng.uniform(2, 9, 8)
    distance, index = cKDTree(where).query(point)
    expected = np.where(distance <= gate[index], index, -1)
    assert len(np.unique(expected)) == 9
    np.testing.assert_array_equal(nearest(point, where, gate, np.zeros(8)), expected)


@pytest.mark.parametrize("nearest", [pixels.nearest, compiled.nearest])
def test_the_border_between_two_targets_is_where_their_outlines_are_equally_far(nearest):
    """From circles of 2.5 m and 0.5 m about 0 and 4 m it lies at 3 m."""
    where, gate, room = np.array([[0.0, 0.0], [4.0, 0.0]]), np.full(2, 5.0), np.array([2.5, 0.5])
    point = np.array([[2.9, 0.0], [3.1, 0.0], [-5.1, 0.0], [9.1, 0.0], [0.0, -4.9]])
    assert nearest(point, where, gate, room).tolist() == [0, 1, -1, -1, 0]
    assert nearest(point, where, gate, np.zeros(2)).tolist() == [1, 1, -1, -1, 0]


@pytest.mark.parametrize("nearest", [pixels.nearest, compiled.nearest])
def test_the_gate_is_that_of_the_nearest(nearest):
    where, gate = np.array([[0.0, 0.0], [10.0, 0.0]]), np.array([4.0, 6.0])
    point = np.array([[4.0, 0.0], [4.9, 0.0], [5.0, 0.0], [5.1, 0.0], [16.0, 0.0], [16.1, 0.0]])
    assert nearest(point, where, gate, np.zeros(2)).tolist() == [0, -1, -1, 1, 1, -1]
    assert nearest(point, np.zeros((0, 2)), np.zeros(0), np.zeros(0)).tolist() == [-1] * 6
    assert nearest(np.zeros((0, 2)), where, gate, np.zeros(2)).shape == (0,)


def test_centroid_and_covariance_by_hand():
    point = np.array([[1.0, 2.0], [2.0, 2.0], [3.0, 5.0], [7.0, 8.0], [100.0, 100.0]])
    n, z, R = pixels.summary(point, np.array([1, 1, 1, 0, -1]), 3, 0.6)
    assert n.tolist() == [1, 3, 0]
    np.testing.assert_allclose(z, [[7, 8], [2, 3], [0, 0]])
    # Deviations (-1, -1), (0, -1), (1, 2), their products over 3 - 1, and 0.6^2 / 12 = 0.03.
    np.testing.assert_allclose(R[1], [[1.03, 1.5], [1.5, 3.03]])
    np.testing.assert_allclose(R[[0, 2]], [0.03 * np.eye(2)] * 2)


def test_centroid_and_covariance_are_numpys():
    rng = np.random.default_rng(3)
    point, label = rng.normal(size=(500, 2)) + 1e4, rng.integers(-1, 4, 500)
    _, z, R = pixels.summary(point, label, 4, 0.1)
    for k in range(4):
        mine = point[label == k]
        np.testing.assert_allclose(z[k], mine.mean(0), rtol=1e-12)
        np.testing.assert_allclose(R[k], np.cov(mine.T) + 0.01 / 12 * np.eye(2), rtol=1e-9)

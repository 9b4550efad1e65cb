"""Extents: triangular matrices, ellipsoids, and the fit to a scatter."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from echoset.models.geometry import extent


@pytest.mark.parametrize(("d", "size"), [(2, 3), (3, 6)])
def test_parameters_and_matrix_are_each_other(d, size):
    e = np.random.default_rng(0).uniform(0.5, 1.5, (4, size))
    E = extent.triangular(e)
    assert (np.triu(E, 1) == 0).all()
    np.testing.assert_array_equal(extent.parameters(E), e)
    np.testing.assert_allclose(extent.volume(e), np.linalg.det(E))
    np.testing.assert_allclose(extent.covariance(e), E @ E.swapaxes(1, 2))
    assert extent.names(d)[-1] == f"e{d - 1}{d - 1}"


@pytest.mark.parametrize("size", [3, 6])
def test_ellipsoid_gives_back_the_covariance(size):
    S = extent.covariance(np.random.default_rng(1).uniform(0.2, 1.5, (5, size)))
    kind, axes, rotation = extent.ellipsoid(S)
    if size == 3:
        c, s = np.cos(rotation), np.sin(rotation)
        R = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    else:
        R = Rotation.from_quat(rotation).as_matrix()
    assert kind == {3: "ellipse", 6: "ellipsoid"}[size]
    np.testing.assert_allclose(R * axes[:, None] ** 2 @ R.swapaxes(1, 2), S, atol=1e-12)


def test_fit_inverts_the_covariance_inside_the_box_and_survives_a_negative_one():
    lower, upper = np.array([1, -0.5, 1, -0.5, -0.5, 1]), np.array([1.5, 0.5, 1.5, 0.5, 0.5, 1.5])
    e = np.random.default_rng(2).uniform(lower, upper)
    np.testing.assert_allclose(extent.fit(extent.covariance(e), lower, upper), e)
    odd = extent.fit(np.diag([-1.0, 2.0, 9.0]), lower, upper)
    np.testing.assert_allclose(odd[[0, 2, 5]], [1.0, np.sqrt(2), 1.5])

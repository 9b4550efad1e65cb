"""The sector of scatterers and its approximation by an ellipse."""

from __future__ import annotations

import numpy as np
import pytest

from echoset.models.scatter import (
    bearing,
    path_moments,
    scatter_ellipse,
    sector,
    sector_gradient,
    unit_square_nodes,
)
from echoset.models.uwb import scatter_distance

OPENING = 2 * np.pi / 3
CENTRE, AXES, WIDTH = np.array([1.0, 2.0]), np.array([0.3, 0.2]), 0.1
ANCHOR, OTHER = np.array([4.0, 4.5]), np.array([0.0, 0.5])


def test_scatterers_face_the_anchor():
    east = np.array([100.0, 2.0])
    q = sector(np.array([0.0, 0.5, 1.0]), 0.0, CENTRE, east, AXES, WIDTH, np.pi)
    assert np.allclose(q, [[1.0, 1.8], [1.3, 2.0], [1.0, 2.2]])
    assert bearing(CENTRE, east) == 0.0


def test_gradients_of_the_sector_are_finite_differences():
    u, s = np.random.default_rng(2).random((2, 20))
    x = np.array([*CENTRE, *AXES, WIDTH])

    def points(x):
        return sector(u, s, x[:2], ANCHOR, x[2:4], x[4], OPENING)

    numeric = [(points(x + e) - points(x - e)) / 2e-6 for e in 1e-6 * np.eye(5)]
    G = sector_gradient(u, s, CENTRE, ANCHOR, AXES, WIDTH, OPENING)
    assert np.allclose(G, np.stack(numeric, -1), atol=1e-8)


def test_scatterers_fill_the_sector():
    u, s = np.random.default_rng(1).random((2, 10_000))
    d = (sector(u, s, CENTRE, ANCHOR, AXES, WIDTH, OPENING) - CENTRE) / AXES
    depth, angle = np.hypot(*d.T), np.arctan2(d[:, 1], d[:, 0])
    off = np.remainder(angle - bearing(CENTRE, ANCHOR) + np.pi, 2 * np.pi) - np.pi
    assert np.abs(off).max() <= OPENING / 2 + 1e-12
    assert depth.max() <= 1 + 1e-12 and depth.min() >= 1 - WIDTH / 0.25 - 1e-12
    # uniform laws: mean and variance within 4.5 standard errors
    for x, width in ((off, OPENING), (1 - depth, WIDTH / 0.25)):
        x = x / width
        assert abs(x.var() - 1 / 12) < 4.5 * np.sqrt(1 / 180 / len(x))
    assert abs(off.mean()) < 4.5 * OPENING / np.sqrt(12 * len(off))


@pytest.mark.parametrize("tx", [ANCHOR, OTHER])
def test_lattice_is_better_than_draws(tx):
    def density(u: np.ndarray, s: np.ndarray) -> np.ndarray:
        h = scatter_distance(tx, sector(u, s, CENTRE, ANCHOR, AXES, WIDTH, OPENING), ANCHOR)
        return (
            np.exp(-((grid[:, None] - h) ** 2) / (2 * 0.04**2)) / 0.04 / np.sqrt(2 * np.pi)
        ).mean(1)

    middle = scatter_distance(tx, CENTRE, ANCHOR)
    grid = np.linspace(middle - 0.9, middle + 0.3, 80)
    k = (np.arange(300) + 0.5) / 300
    dense = density(*(x.ravel() for x in np.meshgrid(k, k)))
    rng = np.random.default_rng(2)
    draws = [np.mean((density(*rng.random((2, 50))) - dense) ** 2) for _ in range(200)]
    lattice = np.mean((density(*unit_square_nodes(50)) - dense) ** 2)
    assert lattice < np.mean(draws) / 20


def test_lattice_has_equal_weights_on_the_unit_square():
    u, s = unit_square_nodes(50)
    assert np.allclose(u.mean(), 0.5) and abs(s.mean() - 0.5) < 0.02
    assert (np.diff(u) > 0).all() and s.min() > 0 and s.max() < 1


def test_ellipse_has_the_semi_axes_of_the_model():
    centre, root = scatter_ellipse(CENTRE, np.array([1.0, 9.0]), 0.4, 0.1, OPENING)
    assert np.allclose(centre, [1.0, 2.4])
    eigenvalues = np.linalg.eigvalsh(root @ root.T)
    half = 0.4 * np.sin(OPENING / 2) / 2
    assert np.allclose(eigenvalues, [0.05**2, half**2])
    assert np.allclose((root @ root.T)[0, 0], half**2)


@pytest.mark.parametrize("tx", [ANCHOR, OTHER])
def test_moments_agree_with_monte_carlo(tx):
    centre, root = scatter_ellipse(CENTRE, ANCHOR, 0.3, 0.1, OPENING)
    h, mean, variance = path_moments(tx, ANCHOR, centre, root)
    n = 200_000
    q = centre + np.random.default_rng(3).normal(size=(n, 2)) @ root.T
    path = scatter_distance(tx, q, ANCHOR)
    assert np.isclose(h, scatter_distance(tx, centre, ANCHOR))
    # the transform is exact to third order; the ellipse is a tenth of the distance
    assert abs(mean - path.mean()) < 4.5 * path.std() / np.sqrt(n) + 1e-5
    assert abs(variance / path.var() - 1) < 4.5 * np.sqrt(3 / n) + 2e-2
    assert abs(mean - h) > 10 * abs(mean - path.mean())


def test_moments_of_a_small_ellipse_are_linear():
    centre, root = scatter_ellipse(CENTRE, ANCHOR, 1e-4, 1e-4, OPENING)
    gradient = sum((centre - a) / np.linalg.norm(centre - a) for a in (OTHER, ANCHOR))
    _, _, variance = path_moments(OTHER, ANCHOR, centre, root)
    assert np.isclose(variance, gradient @ root @ root.T @ gradient, rtol=1e-3)

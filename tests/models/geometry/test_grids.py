"""Linear interpolation on grids: exact for linear functions, and beside SciPy's."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from echoset.models.geometry.grids import Grid

GRID = Grid.around(np.zeros(3), np.array([50.0, 20.0, 10.0]), 2.5)


def test_nodes_are_cell_centres_and_a_ring():
    assert GRID.shape == (22, 10, 6)
    nodes = GRID.nodes()
    np.testing.assert_allclose(nodes[0, 0, 0], [-1.25, -1.25, -1.25])
    np.testing.assert_allclose(nodes[-1, -1, -1], [51.25, 21.25, 11.25])


def test_interpolation_is_scipys_inside_and_the_given_value_outside():
    rng = np.random.default_rng(0)
    table = rng.normal(size=(*GRID.shape, 2))
    x = rng.uniform([-4, -4, -4], [54, 24, 14], (500, 3))
    axes = [
        o + s * np.arange(n) for o, s, n in zip(GRID.origin, GRID.spacing, GRID.shape, strict=True)
    ]
    expected = RegularGridInterpolator(axes, table, bounds_error=False, fill_value=7.0)(x)
    found = GRID.interpolate(table, x, np.array([7.0, 7.0]))
    np.testing.assert_allclose(found, expected, atol=1e-12)
    assert (found == 7.0).any()


def test_an_axis_of_one_node_does_not_matter():
    flat = Grid(np.zeros(3), np.ones(3), (3, 2, 1))
    table = np.arange(6.0).reshape(3, 2, 1)
    found = flat.interpolate(table, np.array([[0.5, 1.0, 99.0]]), np.array(-1.0))
    np.testing.assert_allclose(found, [2.0])

"""Mass of Gaussians in boxes and polygons against integration, other formulas and sampling."""

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad

from echoset.models.errors import ParameterError
from echoset.models.geometry.regions import area, contains, mass, polygon, polygons


def gaussian(rng):
    A = rng.normal(size=(2, 2))
    return rng.normal(size=2), A @ A.T + 0.01 * np.eye(2)


def by_integration(m, P, box):
    """The mass in a box, one axis integrated numerically, the other by the normal law."""
    x0, x1, y0, y1 = box
    slope, s = P[0, 1] / P[0, 0], np.sqrt(P[1, 1] - P[0, 1] ** 2 / P[0, 0])

    def strip(x):
        given = m[1] + slope * (x - m[0])
        height = stats.norm.cdf((y1 - given) / s) - stats.norm.cdf((y0 - given) / s)
        return stats.norm.pdf(x, m[0], np.sqrt(P[0, 0])) * height

    return quad(strip, x0, x1, epsabs=1e-14, epsrel=1e-12, limit=200)[0]


def test_box_is_the_integral():
    rng = np.random.default_rng(1)
    for _ in range(60):
        m, P = gaussian(rng)
        low = rng.normal(size=2) * 1.5
        high = low + rng.uniform(0.2, 3.0, 2)
        box = [low[0], high[0], low[1], high[1]]
        assert mass(m[None], P[None], polygon(box))[0] == pytest.approx(
            by_integration(m, P, box), abs=1e-12
        )


def test_box_is_four_values_of_the_bivariate_distribution():
    rng = np.random.default_rng(2)
    m, P = gaussian(rng)
    x0, x1, y0, y1 = m[0] - 0.3, m[0] + 1.1, m[1] - 2.0, m[1] + 0.4
    F = stats.multivariate_normal(m, P).cdf
    expected = F([x1, y1]) - F([x0, y1]) - F([x1, y0]) + F([x0, y0])
    assert mass(m[None], P[None], polygon([x0, x1, y0, y1]))[0] == pytest.approx(
        expected, abs=1e-10
    )


def test_correlation_near_one_and_long_thin_covariances():
    P = np.array([[1.0, 0.9999], [0.9999, 1.0]])
    m, box = np.array([0.2, 0.1]), [-0.5, 0.5, -0.4, 0.6]
    # With such a correlation the distribution function is nearly that of the smaller bound.
    assert mass(m[None], P[None], polygon(box))[0] == pytest.approx(
        by_integration(m, P, box), abs=1e-9
    )


def test_a_polygon_is_the_sum_of_its_parts():
    rng = np.random.default_rng(3)
    hexagon = np.array([[2, 0], [1, 2], [-1, 2], [-2, 0], [-1, -2], [1, -2]], float)
    m, P = (np.stack(x) for x in zip(*(gaussian(rng) for _ in range(50)), strict=True))
    fan = [hexagon[[0, k, k + 1]] for k in range(1, 5)]
    parts = sum(mass(m, P, polygon(triangle)) for triangle in fan)
    np.testing.assert_allclose(mass(m, P, polygon(hexagon)), parts, atol=1e-13)


def test_half_planes_and_the_whole_plane():
    m, P = np.array([[0.0, 0.0]]), np.array([[[4.0, 1.0], [1.0, 2.0]]])
    far = 1e4
    assert mass(m, P, polygon([-far, far, -far, far]))[0] == pytest.approx(1.0, abs=1e-13)
    assert mass(m, P, polygon([-far, 1.0, -far, far]))[0] == pytest.approx(
        stats.norm.cdf(0.5), abs=1e-12
    )
    assert mass(m, P, polygon([0.0, far, -far, far]))[0] == pytest.approx(0.5, abs=1e-12)
    assert mass(m, P, polygon([100.0, 101.0, 0.0, 1.0]))[0] == 0.0


def test_mass_is_the_share_of_samples_in_the_polygon():
    rng = np.random.default_rng(4)
    n = 200_000
    m, P = gaussian(rng)
    triangle = polygon(m + np.array([[1.0, 0.0], [-0.5, 0.8], [-0.6, -0.9]]))
    share = contains(triangle, rng.multivariate_normal(m, P, n)).mean()
    p = mass(m[None], P[None], triangle)[0]
    assert abs(share - p) < 4.5 * np.sqrt(p * (1 - p) / n)


def test_corners_run_anticlockwise_whatever_the_user_gave():
    corners = np.array([[0, 0], [2, 0], [1, 3]], float)
    assert area(polygon(corners)) == area(polygon(corners[::-1])) == 3.0


@pytest.mark.parametrize(
    "bad",
    [
        [0, 1, 2],
        [1, 0, 0, 1],
        [[0, 0], [1, 1]],
        [[0, 0], [1, 1], [2, 2]],
        [[0, 0], [2, 0], [0.5, 0.5], [0, 2]],
        [[0, 0], [1, 1], [1, 0], [0, 1]],
        [[np.cos(4 * np.pi * k / 5), np.sin(4 * np.pi * k / 5)] for k in range(5)],
        [[0, 0], [1, np.nan], [0, 1]],
        "box",
        None,
    ],
)
def test_what_is_no_box_and_no_convex_polygon_is_refused(bad):
    with pytest.raises(ParameterError, match=r"regions\.B"):
        polygons({"B": bad})

"""What ranges have too much: twins are equal, and equal the Kalman filter where it is exact."""

from __future__ import annotations

import numpy as np
import pytest

from echoset.estimators.eopda.kernels import range_error as definition
from echoset.estimators.eopda.kernels.compiled import range_error as compiled

ANCHORS = np.array([[4.0, 4.5, 2.0], [0.0, 0.5, 2.5], [6.5, 0.0, 1.0]])
LINKS = (np.array([0, 2, 1]), np.array([0, 2, 2, 5]))


def arguments(rng: np.random.Generator, n: int, D: int):
    """Devices about (3, 2), two ranges, none and three, and beliefs of dimension ``D``."""
    device = np.array([[3.0], [2.0]]) + 0.3 * rng.normal(size=(2, n))
    root = 0.2 * rng.normal(size=(n, D, D))
    z = np.concatenate((3.9 + 0.2 * rng.normal(size=2), 4.0 + 0.3 * rng.normal(size=3)))
    noise = rng.uniform(0.05, 0.2, 5) ** 2
    belief = (0.05 * rng.normal(size=(n, D)), root @ root.swapaxes(1, 2))
    return device, rng.uniform(0, 1, n), ANCHORS, *LINKS, z, noise, *belief


@pytest.mark.parametrize("detour", [1e-3, 0.3, 5.0])
@pytest.mark.parametrize("D", [0, 4])
def test_twins_are_equal(D, detour):
    rng = np.random.default_rng(1)
    values = arguments(rng, 60, D)
    for a, b in zip(
        definition.direct(*values, 0.3, 0.9, 0.2, detour),
        compiled.direct(*values, 0.3, 0.9, 0.2, detour),
        strict=True,
    ):
        assert np.allclose(a, b, rtol=1e-6, atol=1e-9)
    if D:
        path = rng.uniform(1, 9, (3, 60))
        for a, b in zip(
            definition.excess(path, *values[-2:], LINKS[0]),
            compiled.excess(path, *values[-2:], LINKS[0]),
            strict=True,
        ):
            assert np.allclose(a, b)


@pytest.mark.parametrize("module", [definition, compiled])
def test_without_false_ranges_it_is_the_joint_gaussian(module):
    """All ranges at once: mean, covariance and evidence of a linear Gaussian model."""
    device, height, anchors, rx, offset, z, v, mean, P = arguments(np.random.default_rng(2), 1, 4)
    link = np.repeat(rx, np.diff(offset))
    d = np.linalg.norm(np.array([*device[:, 0], height[0]]) - anchors[link], axis=1)
    H = np.zeros((5, 4))
    H[:, 0], H[range(5), 1 + link] = d, 1.0
    S, nu = H @ P[0] @ H.T + np.diag(v), z - d - H @ mean[0]
    rest = (mean, P, 1e-30, 1.0, 0.0, 1.0)
    log_l, m, C = module.direct(device, height, anchors, rx, offset, z, v, *rest)
    gain = P[0] @ H.T @ np.linalg.inv(S)
    assert np.allclose(m[0], mean[0] + gain @ nu)
    assert np.allclose(C[0], P[0] - gain @ H @ P[0])
    exact = -0.5 * (nu @ np.linalg.solve(S, nu) + np.linalg.slogdet(2 * np.pi * S)[1])
    assert np.isclose(log_l[0], exact)


def test_a_range_that_may_be_false_collapses_to_the_moments_of_the_mixture():
    """One anchor, no scale: moments of the two hypotheses by integration over the offset."""
    b = np.linspace(-3, 3, 20_001)
    prior = np.exp(-0.5 * (b / 0.4) ** 2)
    likely = 0.2 + np.exp(-0.5 * ((0.7 - b) / 0.1) ** 2) / (0.1 * np.sqrt(2 * np.pi))
    w = prior * likely
    mean = w @ b / w.sum()
    variance = w @ (b - mean) ** 2 / w.sum()
    P = np.zeros((1, 2, 2))
    P[0, 1, 1] = 0.16
    one = (np.array([[3.0], [0.0]]), np.zeros(1), np.array([[0.0, 4.0, 0.0]]))
    ranges = (np.array([0]), np.array([0, 1]), np.array([5.7]), np.array([0.01]))
    log_l, m, C = compiled.direct(*one, *ranges, np.zeros((1, 2)), P, 0.2, 1.0, 0.0, 1.0)
    assert np.isclose(m[0, 1], mean, atol=1e-6) and np.isclose(C[0, 1, 1], variance, atol=1e-6)
    assert np.isclose(log_l[0], np.log(w.sum() / prior.sum()), atol=1e-6)


@pytest.mark.parametrize("z", [4.6, 5.0, 5.4, 7.0])
@pytest.mark.parametrize("module", [definition, compiled])
def test_a_range_that_may_be_late_collapses_to_the_moments_of_the_mixture(module, z):
    """One anchor, no scale: moments by integration over the offset and over the detour."""
    b = np.linspace(-2.5, 2.5, 2001)
    length = (np.arange(12_000) + 0.5) * 2e-3
    prior = np.exp(-0.5 * (b / 0.4) ** 2)

    def normal(d):
        return np.exp(-0.5 * (d / 0.1) ** 2) / (0.1 * np.sqrt(2 * np.pi))

    detour = np.exp(-length / 0.3) / 0.3 * 2e-3
    late = np.array([normal(z - 5.0 - offset - length) @ detour for offset in b])
    w = prior * (0.02 + 0.7 * normal(z - 5.0 - b) + 0.3 * late)
    mean = w @ b / w.sum()
    P = np.zeros((1, 2, 2))
    P[0, 1, 1] = 0.16
    one = (np.array([[3.0], [0.0]]), np.zeros(1), np.array([[0.0, 4.0, 0.0]]))
    ranges = (np.array([0]), np.array([0, 1]), np.array([z]), np.array([0.01]))
    log_l, m, C = module.direct(*one, *ranges, np.zeros((1, 2)), P, 0.02, 0.7, 0.3, 0.3)
    assert np.isclose(m[0, 1], mean, atol=1e-4)
    assert np.isclose(C[0, 1, 1], w @ (b - mean) ** 2 / w.sum(), atol=1e-4)
    assert np.isclose(log_l[0], np.log(w.sum() / prior.sum()), atol=1e-4)

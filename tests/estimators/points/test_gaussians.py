"""Gaussian kernels: the compiled twins equal the definitions; these equal scipy and textbooks."""

import numpy as np
import pytest
from scipy import stats

from echoset.estimators.points.kernels import gaussians
from echoset.estimators.points.kernels.compiled import gaussians as compiled
from echoset.estimators.points.kernels.compiled import parts

PERIOD = np.array([0.0, 2 * np.pi])


def covariances(rng, *shape):
    A = rng.normal(size=shape)
    return A @ A.swapaxes(-1, -2) + 0.1 * np.eye(shape[-1])


@pytest.fixture
def case():
    rng = np.random.default_rng(1)
    J, n = 12, 7
    return {
        "w": rng.uniform(0.01, 1, J),
        "m": rng.normal(size=(J, 4)) * 3,
        "P": covariances(rng, J, 4, 4),
        "z": rng.normal(size=(n, 2)) * 4,
        "z_hat": rng.normal(size=(J, 2)) * 4,
        "C": rng.normal(size=(J, 4, 2)) * 0.2,
        "S": covariances(rng, J, 1, 2, 2) + np.eye(2),
        "S_each": covariances(rng, J, n, 2, 2),
        "F": rng.normal(size=(4, 4)),
        "Q": covariances(rng, 4, 4),
    }


def same(a, b):
    for x, y in zip(a, b, strict=True):
        np.testing.assert_allclose(x, y, rtol=1e-11, atol=1e-12)


def test_twins_are_equal(case):
    c = case
    same(*(k.predict(c["m"], c["P"], c["F"], c["Q"]) for k in (gaussians, compiled)))
    for S in (c["S"], c["S_each"]):
        for gate in (9.0, 1e9):
            args = (c["z"], c["z_hat"], S, PERIOD, gate)
            same(gaussians.log_likelihood(*args), compiled.log_likelihood(*args))
    S = c["S"][:, 0]
    K, P = gaussians.gain(c["P"], c["C"], S)
    same((K, P), compiled.gain(c["P"], c["C"], S))
    args = (c["m"], K, np.resize(c["z"], (12, 2)), c["z_hat"], PERIOD)
    same(gaussians.correct(*args), compiled.correct(*args))
    for scale, distance in ((c["P"], 8.0), (np.tile(np.eye(4), (12, 1, 1)), 25.0), (c["P"], 1e9)):
        for by_leader in (False, True):
            args = (c["w"], c["m"], c["P"], scale, distance, by_leader)
            a, b = gaussians.merge(*args), compiled.merge(*args)
            assert len(a[0]) < 12
            same(a, b)


def test_twins_are_equal_with_nothing(case):
    c = case
    none = np.zeros((0, 2))
    for k in (gaussians, compiled):
        assert k.log_likelihood(none, c["z_hat"], c["S"], PERIOD, 9.0).shape == (12, 0)
        empty = k.merge(np.zeros(0), np.zeros((0, 4)), *(np.zeros((0, 4, 4)),) * 2, 4.0)
        assert [x.shape for x in empty] == [(0,), (0, 4), (0, 4, 4), (0,)]
        assert k.predict(np.zeros((0, 4)), np.zeros((0, 4, 4)), c["F"], c["Q"])[0].shape == (0, 4)


def test_densities_are_those_of_scipy_and_angles_wrap(case):
    c = case
    log_l = gaussians.log_likelihood(c["z"], c["z_hat"], c["S"], np.zeros(2), np.inf)
    expected = stats.multivariate_normal(c["z_hat"][3], c["S"][3, 0]).logpdf(c["z"])
    np.testing.assert_allclose(log_l[3], expected, atol=1e-12)
    turned = c["z"] + [0.0, 4 * np.pi]
    a, b = (
        gaussians.log_likelihood(z, c["z_hat"], c["S"], PERIOD, np.inf) for z in (c["z"], turned)
    )
    np.testing.assert_allclose(a, b, atol=1e-9)
    assert abs(gaussians.innovation(np.array([0.0, 3.1]), np.array([0.0, -3.1]), PERIOD)[1]) < 0.1


def test_gain_conditions_the_joint_gaussian(case):
    c = case
    S, P, C = c["S"][0, 0], c["P"][0], c["C"][0]
    K, P_new = gaussians.gain(c["P"][:1], c["C"][:1], c["S"][:1, 0])
    joint = np.block([[P, C], [C.T, S]])
    np.testing.assert_allclose(K[0], C @ np.linalg.inv(S), atol=1e-12)
    np.testing.assert_allclose(np.linalg.inv(P_new[0]), np.linalg.inv(joint)[:4, :4], atol=1e-10)


def test_merging_keeps_weight_mean_and_spread(case):
    c = case
    w, m, P, _ = gaussians.merge(c["w"], c["m"], c["P"], c["P"], 1e9)
    assert len(w) == 1
    second = np.einsum("j,jab->ab", c["w"], c["P"] + c["m"][:, :, None] * c["m"][:, None, :])
    np.testing.assert_allclose(w[0], c["w"].sum())
    np.testing.assert_allclose(m[0] * w[0], c["w"] @ c["m"])
    np.testing.assert_allclose((P[0] + np.outer(m[0], m[0])) * w[0], second, atol=1e-9)


@pytest.mark.parametrize("n", [0, 1, 2, 3, 7, 8, 9, 100])
def test_falling_order_keeps_equals_as_they_stand(n):
    values = np.random.default_rng(n).integers(0, 5, n).astype(float)
    expected = np.argsort(-values, kind="stable")
    assert parts.falling.py_func(values).tolist() == expected.tolist()


def test_strongest():
    w = np.array([0.1, 0.5, 0.0, 0.3, 0.5])
    m = np.arange(10.0).reshape(5, 2)
    assert gaussians.strongest(w, m, 0.0, 9).tolist() == [0, 1, 3, 4]
    assert gaussians.strongest(w, m, 0.1, 2).tolist() == [1, 4]
    assert gaussians.strongest(w, m, 0.9, 2).tolist() == []


def test_of_equals_no_place_is_preferred_and_the_same_are_taken_in_any_order():
    rng = np.random.default_rng(3)
    values = np.sort(rng.uniform(-1, 1, (400, 2)), axis=0)
    first = gaussians.falling(np.ones(400), values)
    shuffled = rng.permutation(400)
    again = shuffled[gaussians.falling(np.ones(400), values[shuffled])]
    np.testing.assert_array_equal(first, again)
    # The first half of the order: its indices have the mean of 200 drawn without putting back.
    stderr = np.sqrt((400**2 - 1) / 12 / 200 * (1 - 200 / 400))
    assert abs(first[:200].mean() - 199.5) < 4.5 * stderr
    assert abs(np.corrcoef(first[:-1], first[1:])[0, 1]) < 4.5 / 20
    heavy = np.array([0.2, 0.9, 0.5])
    assert gaussians.falling(heavy, values[:3]).tolist() == [1, 2, 0]

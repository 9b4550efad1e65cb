"""Pairs of targets and detections: twins, the k-d tree against all pairs, belief propagation."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy import stats

from echoset.estimators.points import pairs
from echoset.estimators.points.kernels import association
from echoset.estimators.points.kernels import pairs as definition
from echoset.estimators.points.kernels.compiled import association as compiled_association
from echoset.estimators.points.kernels.compiled import pairs as compiled
from echoset.estimators.points.model.measurement import innovations, log_likelihood
from echoset.estimators.points.model.sensing import Look, Part
from echoset.estimators.points.model.targets import TargetParams, within
from echoset.models.radar.detection import View

PERIOD = np.array([0.0, 2 * np.pi])


def covariances(rng, *shape):
    A = rng.normal(size=shape)
    return A @ A.swapaxes(-1, -2) + 0.1 * np.eye(shape[-1])


def look(z, R, polar=False, **changes):
    """A look from (5, -3), turned by 0.3."""
    n, c, s = len(z), np.cos(0.3), np.sin(0.3)
    period = np.array([0.0, 2 * np.pi if polar else 0.0])
    pose = np.array([5.0, -3.0]), np.array([[c, -s], [s, c]])
    even = np.full(n, 1e-4)
    return replace(Look(polar, z, R, 5 * even, period, *pose, View(), 0.9, even), **changes)


def scene(rng, kind, T=40, n=60):
    """A look and targets near its detections and far from them."""
    m = np.hstack((rng.uniform(-100, 100, (T, 2)), rng.normal(size=(T, 2)) * 5))
    P = covariances(rng, T, 4, 4) * rng.gamma(1.0, 40.0, T)[:, None, None]
    if kind == "polar":
        z = np.stack((rng.uniform(0.1, 150, n), rng.uniform(-np.pi, np.pi, n)), 1)
        each = np.array([[1.0, 0], [0, 1e-3]]) * rng.gamma(1.0, 1.0, n)[:, None, None]
        return look(z, each, polar=True), m, P
    z = rng.uniform(-100, 100, (n, 2))
    return look(z, covariances(rng, 1 if kind == "one noise" else n, 2, 2)), m, P


def test_twins_are_equal():
    rng = np.random.default_rng(1)
    k, t, z = 50, np.sort(rng.integers(0, 8, 50)), rng.integers(0, 9, 50)
    for n in (1, 9):
        R = covariances(rng, n, 2, 2)
        place = rng.normal(size=(9, 2)) * 4, rng.normal(size=(8, 2)), covariances(rng, 8, 2, 2)
        for gate in (4.0, 1e9):
            args = (*place, R, PERIOD, t, z, gate)
            a, b = (f.log_likelihood(*args) for f in (definition, compiled))
            np.testing.assert_allclose(a, b, rtol=1e-12)
    group = rng.integers(0, 7, k)
    group[group == 3] = 4
    args = group, rng.random(k), rng.normal(size=(k, 4)), covariances(rng, k, 4, 4), 7
    for a, b in zip(definition.matched(*args), compiled.matched(*args), strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-13)
        assert not a[3].any()
    for k in (0, 12, 40):
        t, z = np.divmod(rng.choice(99, k, replace=False), 11)
        for scale in (1.0, 1e3, 1e20):
            args = t, z, scale * rng.gamma(1.0, 2.0, k), 9, 11
            a, b = association.marginals(*args), compiled_association.marginals(*args)
            for x, y in zip(a, b, strict=True):
                np.testing.assert_allclose(x, y, atol=1e-8)


def test_densities_and_moments_are_those_of_scipy():
    rng = np.random.default_rng(2)
    z, z_hat, S = rng.normal(size=(9, 2)), rng.normal(size=(4, 2)), covariances(rng, 4, 2, 2)
    R, t = covariances(rng, 9, 2, 2), np.arange(9) % 4
    found = definition.log_likelihood(z, z_hat, S, R, np.zeros(2), t, np.arange(9), 1e9)
    law = stats.multivariate_normal
    expected = [law.logpdf(z[i], z_hat[t[i]], S[t[i]] + R[i]) for i in range(9)]
    np.testing.assert_allclose(found, expected, rtol=1e-12)
    w, m, P = np.array([0.3, 0.9]), rng.normal(size=(2, 4)), covariances(rng, 2, 4, 4)
    total, mean, spread = (a[0] for a in definition.matched(np.zeros(2, int), w, m, P, 1))
    second = sum(v * (C + np.outer(x, x)) for v, x, C in zip(w, m, P, strict=True)) / 1.2
    np.testing.assert_allclose((total, *mean), (1.2, *(w @ m / 1.2)), rtol=1e-12)
    np.testing.assert_allclose(spread, second - np.outer(mean, mean), rtol=1e-12)


@pytest.mark.parametrize("unscented", [False, True])
@pytest.mark.parametrize("kind", ["one noise", "own noise", "polar"])
@pytest.mark.parametrize("gate", [3.0, 20.0])
def test_pairs_are_all_that_a_comparison_of_all_with_all_finds(kind, unscented, gate):
    for seed in range(10):
        seen, m, P = scene(np.random.default_rng(seed), kind)
        z_hat, _, S = innovations(seen, m, P, unscented)
        log_l = log_likelihood(seen, z_hat, S, gate)
        target, detection = np.nonzero(log_l > -np.inf)
        found = pairs.near(seen, m, P, unscented, gate)
        found = found.take(np.lexsort((found.detection, found.target)))
        np.testing.assert_array_equal(found.target, target)
        np.testing.assert_array_equal(found.detection, detection)
        np.testing.assert_allclose(found.log_l, log_l[target, detection], rtol=1e-10)
        assert len(found) > 3 and not found.cut


@pytest.mark.parametrize("kind", ["one noise", "polar"])
def test_rows_with_times_of_their_own(kind):
    rng = np.random.default_rng(4)
    whole, m, P = scene(rng, kind, n=8)
    motion = within(TargetParams(acceleration_density=1.0))
    parts = tuple(
        Part(
            replace(
                whole, z=whole.z[i : i + 1], R=whole.R[i % len(whole.R)][None],
                position=whole.position + i,
            ),
            *motion(0.2 * i - 0.5),
        )
        for i in range(8)
    )  # fmt: skip
    seen = replace(whole, parts=parts)
    z_hat, C, S = innovations(seen, m, P, False)
    log_l = log_likelihood(seen, z_hat, S, 50.0)
    target, detection = np.nonzero(log_l > -np.inf)
    found = pairs.near(seen, m, P, False, 50.0)
    np.testing.assert_array_equal(found.target, target)
    np.testing.assert_array_equal(found.detection, detection)
    np.testing.assert_allclose(found.C, C[target, detection], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.S, S[target, detection], rtol=1e-9)


def test_too_many_pairs_are_cut_to_the_nearest_and_counted(monkeypatch):
    monkeypatch.setattr(pairs, "MOST", 30)
    seen = look(np.arange(50.0)[:, None] * [0.1, 0.0], np.eye(2)[None])
    m, P = np.zeros((10, 4)), np.tile(np.eye(4), (10, 1, 1))
    found = pairs.near(seen, m, P, False, 1e4)
    assert len(found) == 30 and found.cut == 470
    assert sorted(set(found.detection.tolist())) == [0, 1, 2]


def test_nothing_to_compare():
    seen = look(np.zeros((0, 2)), np.eye(2)[None])
    assert not len(pairs.near(seen, np.zeros((3, 4)), np.tile(np.eye(4), (3, 1, 1)), False, 9.0))
    seen = look(np.zeros((2, 2)), np.eye(2)[None])
    assert not len(pairs.near(seen, np.zeros((0, 4)), np.zeros((0, 4, 4)), False, 9.0))


def enumerated(t, z, odds):
    """Marginals of the pairs over all joint associations."""
    total, found = 0.0, np.zeros(len(t))
    for chosen in product([False, True], repeat=len(t)):
        on = np.flatnonzero(chosen)
        if len(set(t[on])) == len(set(z[on])) == len(on):
            weight = np.prod(odds[on])
            total += weight
            found[on] += weight
    return found / total


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_marginals_are_exact_on_trees(scale):
    """Random forests: each new edge joins two parts."""
    rng = np.random.default_rng(7)
    for _ in range(40):
        nodes = [("t", i) for i in range(5)] + [("z", i) for i in range(5)]
        part = {node: k for k, node in enumerate(nodes)}
        edges = []
        for a, b in rng.permutation([(a, b) for a in range(5) for b in range(5)]).tolist():
            if part["t", a] != part["z", b]:
                old, new = part["t", a], part["z", b]
                part = {node: new if k == old else k for node, k in part.items()}
                edges.append((a, b))
        t, z = np.array(edges).T
        odds = scale * rng.gamma(0.5, 2.0, len(t))
        p, none = compiled_association.marginals(t, z, odds, 5, 5)
        np.testing.assert_allclose(p, enumerated(t, z, odds), atol=1e-9)
        np.testing.assert_allclose(np.bincount(t, p, 5) + none, 1.0, rtol=1e-12)


@pytest.mark.parametrize(("odds", "near"), [(0.1, 1e-9), (1.0, 1e-9), (30.0, 1e-9), (1e4, 1e-6)])
def test_two_targets_that_share_two_detections(odds, near):
    """The fixed point of the circle: nu = 1 / (1 + mu), mu = odds / (1 + odds nu)."""
    t, z = np.array([0, 0, 1, 1]), np.array([0, 1, 0, 1])
    p, _ = compiled_association.marginals(t, z, np.full(4, odds), 2, 2)
    # nu (1 + odds nu + odds) = 1 + odds nu
    nu = (-1 + np.sqrt(1 + 4 * odds)) / (2 * odds)
    np.testing.assert_allclose(p, odds * nu / (1 + 2 * odds * nu), atol=near)


def test_messages_converge_and_no_detection_is_given_away_twice():
    """Dense graphs with any odds: the residual of the fixed point is nought, and sums are sums."""
    rng = np.random.default_rng(8)
    for scale in (1.0, 1e3, 1e6):
        t, z = (a.ravel() for a in np.meshgrid(np.arange(12), np.arange(15), indexing="ij"))
        odds = scale * rng.gamma(0.3, 1.0, len(t))
        p, none = compiled_association.marginals(t, z, odds, 12, 15)
        assert (np.bincount(z, p, 15) < 1 + 1e-6).all() and (p >= 0).all()
        np.testing.assert_allclose(np.bincount(t, p, 12) + none, 1.0, rtol=1e-12)
        # At the fixed point a detection left free has odds 1 / (1 + sum mu) on either side.
        psi_nu = p / none[t]
        nu = psi_nu / odds
        mu = odds / (1 / none[t] - psi_nu)
        expected = 1 / (1 + np.bincount(z, mu, 15)[z] - mu)
        np.testing.assert_allclose(nu, expected, atol=1e-8)

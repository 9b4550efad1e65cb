"""The batch over a whole recording, against dense algebra, finite differences and SciPy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.linalg import inv, slogdet
from scipy.optimize import least_squares

from echoset.estimators.eopda.batch import range_ls
from echoset.estimators.eopda.batch.chain import (
    Chain,
    diagonal_of_inverse,
    factor,
    log_determinant,
    solve,
)
from echoset.estimators.eopda.batch.gather import PER_RANGE, Data
from echoset.estimators.eopda.batch.motion import Layout, Motion
from echoset.estimators.eopda.batch.params import Params
from echoset.estimators.eopda.batch.problem import Problem
from echoset.estimators.eopda.odometry import Increment
from echoset.models.columns import ACTIVE
from echoset.models.motion import STEP, white_acceleration
from echoset.models.records import Meta, Recording, Sensor, Stream

UP = np.array([0.0, 0.0, 1.5])
ANCHORS = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 5.0], [0.0, 5.0]])
PLAIN = Params(
    range_bias_std=0.0, sigma=0.1, acceleration_std=1.0, learn=(), max_range=20.0, tail=1e9,
    mean_clutter=0.0,
)  # fmt: skip
"""Gaussian ranges without errors; false ones have the density that is assumed at least."""


def chain(n: int, d: int, seed: int) -> tuple[Chain, np.ndarray]:
    """A random chain and the dense matrix that it is."""
    rng = np.random.default_rng(seed)
    B = np.zeros((n * d, n * d))
    for k in range(n):
        rows = slice(k * d, (k + 1) * d)
        B[rows, k * d : min(k + 2, n) * d] = rng.normal(size=(d, (min(k + 2, n) - k) * d))
    A = B.T @ B + np.eye(n * d)
    blocks = A.reshape(n, d, n, d).swapaxes(1, 2)
    k = np.arange(n)
    return Chain(blocks[k, k].copy(), blocks[k[:-1], k[1:]].copy()), A


@pytest.mark.parametrize(("n", "d"), [(1, 3), (2, 1), (6, 4)])
def test_the_algebra_of_a_chain_is_that_of_the_dense_matrix(n: int, d: int) -> None:
    own, A = chain(n, d, 1)
    band = factor(own)
    b = np.random.default_rng(2).normal(size=(n, d))
    np.testing.assert_allclose(solve(band, b).ravel(), np.linalg.solve(A, b.ravel()), rtol=1e-9)
    assert log_determinant(band) == pytest.approx(slogdet(A)[1])
    k = np.arange(n)
    expected = inv(A).reshape(n, d, n, d).swapaxes(1, 2)[k, k]
    np.testing.assert_allclose(diagonal_of_inverse(own), expected, rtol=1e-8, atol=1e-12)


def walk(n: int, rng: np.random.Generator, dt: float = 0.2, q: float = STEP) -> np.ndarray:
    """States (n, 4) of a walk by white acceleration of density ``q``."""
    x = np.zeros((n, 4))
    x[0] = 3.0, 2.5, 0.3, -0.2
    F = np.eye(4) + dt * np.eye(4, k=2)
    root = np.linalg.cholesky(q * white_acceleration(dt))
    for k in range(1, n):
        x[k] = F @ x[k - 1] + root @ rng.normal(size=4)
    return x


def ranges(x: np.ndarray, rng: np.random.Generator, dt: float = 0.2, std: float = 0.1) -> Data:
    """Ranges to all anchors at all times."""
    n, J = len(x), len(ANCHORS)
    step, anchor = np.repeat(np.arange(n), J), np.tile(np.arange(J), n)
    place = np.hstack((ANCHORS, np.zeros((J, 1))))[anchor]
    z = np.linalg.norm(x[step, :2] - place[:, :2], axis=1) + std * rng.normal(size=n * J)
    time_ns = np.rint(np.arange(n) * dt * 1e9).astype(np.int64)
    none = np.full(n * J, -1), np.zeros((n * J, 3)), np.zeros(n * J), np.zeros((n * J, 2))
    return Data(time_ns, J, step, anchor, place, z, np.full(n * J, std), *none, ())


def problem(data: Data, params: Params) -> Problem:
    known = params.device_height_std == 0
    layout = Layout.of(data, params, known)
    height = 0.0, params.device_height_std
    motion = Motion.of(data, params, layout, np.array([3.0, 2.5]), 10.0, height)
    return Problem(data, params, motion, 0.0)


def told(n: int, rng: np.random.Generator) -> tuple[Increment, ...]:
    """Increments of odometry, one of them missing and one with a heading."""
    found = []
    for k in range(n):
        A = rng.normal(size=(3, 3))
        gone = k == n // 2
        found.append(
            Increment(
                rng.normal(size=2),
                0.1 * rng.normal(),
                0.01 * (A @ A.T + np.eye(3)),
                0.0 if gone else 1.0,
                0.3 if k == 1 else np.nan,
                0.02 if k == 1 else np.inf,
            )
        )
    return tuple(found)


def test_the_slope_is_that_of_the_cost_by_finite_differences() -> None:
    rng = np.random.default_rng(3)
    data = ranges(walk(6, rng), rng)
    # the first anchor's distance is taken off those of the last, whose noise it shares
    last = data.anchor == 3
    other = np.where(last[:, None], [0.0, 0.0, 1.5], 0.0)
    reference, shared = np.where(last, 0, -1), np.where(last, 0.2, 0.0)
    data = replace(data, increments=told(6, rng), place=data.place + UP)
    offset = rng.normal(size=(24, 2))
    data = replace(data, reference=reference, other=other, shared=shared, offset=offset)
    params = replace(
        PLAIN, tail=3.0, range_bias_std=0.2, range_scale_std=0.05, device_height_std=1.0
    )
    own = problem(data, params)
    assert own.layout.size == 4 + 3 + 4 + 1
    x = rng.normal(size=(6, own.layout.size))
    # what hardly changes would cost so much that differences drown in rounding
    x[:, 5:] = x[0, 5:] + 1e-4 * x[:, 5:]
    _, slope = own.normal(x)
    for k, i in np.ndindex(x.shape):
        step = np.zeros_like(x)
        step[k, i] = 1e-5
        downhill = (own.cost(x - step) - own.cost(x + step)) / 2e-5
        assert slope[k, i] == pytest.approx(downhill, rel=1e-4, abs=1e-3), (k, i)


def test_the_minimum_is_that_of_least_squares() -> None:
    rng = np.random.default_rng(4)
    data = ranges(walk(12, rng), rng)
    own = problem(data, PLAIN)
    x, _ = own.minimise(np.tile(own.motion.mean, (12, 1)))
    root = np.linalg.cholesky(inv(STEP * white_acceleration(0.2))).T
    F = np.eye(4) + 0.2 * np.eye(4, k=2)

    def residuals(flat: np.ndarray) -> np.ndarray:
        y = flat.reshape(12, 4)
        d = np.linalg.norm(y[data.step, :2] - data.place[:, :2], axis=1)
        first = (y[0] - [3.0, 2.5, 0.0, 0.0]) / [10.0, 10.0, 1.0, 1.0]
        steps = (y[1:] - y[:-1] @ F.T) @ root.T
        return np.concatenate(((data.z - d) / 0.1, first, steps.ravel()))

    found = least_squares(residuals, np.tile(own.motion.mean, 12), xtol=1e-12, ftol=1e-12)
    np.testing.assert_allclose(x[:, :2].ravel(), found.x.reshape(12, 4)[:, :2].ravel(), atol=2e-3)
    P = inv(found.jac.T @ found.jac).reshape(12, 4, 12, 4)
    # the covariance is scaled by what the residuals say, so it is compared by its shape
    ours = own.covariance(x)
    share = np.array([ours[k, 0, 0] / P[k, 0, k, 0] for k in range(12)])
    assert 0.5 < share.mean() < 2.0
    np.testing.assert_allclose(share, share.mean(), rtol=0.25)


def noise(kind: str, size: int, rng: np.random.Generator) -> np.ndarray:
    """Errors of ranges in units of what is told."""
    if kind == "gaussian":
        return rng.normal(size=size)
    if kind == "half as large":
        return 0.5 * rng.normal(size=size)
    wide = rng.random(size) < 0.15
    return np.where(wide, 8.0, 1.0) * rng.normal(size=size)


@pytest.mark.parametrize("kind", ["gaussian", "half as large", "long tails"])
def test_covariances_are_honest_whatever_the_noise(kind: str) -> None:
    rng = np.random.default_rng(5)
    values = []
    for _ in range(6):
        true = walk(150, rng)
        data = ranges(true, rng, std=0.1)
        clean = np.linalg.norm(true[data.step, :2] - data.place[:, :2], axis=1)
        data = replace(data, z=np.abs(clean + 0.1 * noise(kind, len(clean), rng)))
        own = problem(data, replace(PLAIN, tail=4.0))
        x, _ = own.minimise(np.where(np.arange(4) < 2, true, 0.0))
        e = (x - true)[:, :2, None]
        P = own.covariance(x)[:, :2, :2]
        values.append(float((e * np.linalg.solve(P, e)).sum((1, 2)).mean()))
    # 6 x 150 times that depend on each other over some ten: the mean of 2 is known to 0.2
    assert np.mean(values) == pytest.approx(2.0, abs=0.9)


def recording(data: Data, kinds: tuple[str, ...] = ("A0", "A1", "A2", "A3")) -> Recording:
    """The ranges as a recording."""
    J = len(ANCHORS)
    sensors = {"D": Sensor.device(0)}
    sensors |= {name: Sensor.static("anchor", p) for name, p in zip(kinds, ANCHORS, strict=True)}
    n = len(data.z)
    scan = {
        "mode": np.full(n, ACTIVE, np.uint8),
        "tx": np.zeros(n, np.int32),
        "rx": (data.anchor + 1).astype(np.int32),
    }
    stream = Stream(
        "uwb", tuple(sensors), {}, data.time_ns[data.step], np.arange(n + 1), scan,
        {"distance": data.z, "std": data.std},
    )  # fmt: skip
    assert len(sensors) == J + 1
    return Recording(Meta("walk"), sensors, {"uwb": stream})


def test_a_walk_is_found_without_a_start_and_with_long_tails() -> None:
    rng = np.random.default_rng(6)
    true = walk(200, rng)
    data = ranges(true, rng)
    wild = rng.random(len(data.z)) < 0.2
    data = replace(data, z=data.z + np.where(wild, rng.uniform(0.5, 4.0, len(wild)), 0.0))
    rec = recording(data)
    params = Params(learn=())
    steps = list(range_ls.estimate(rec.setup(), rec.scans(), params, np.random.default_rng(0)))
    assert [int(s.objects.time_ns[0]) for s in steps] == data.time_ns.tolist()
    p = np.array([s.objects.columns("device_x", "device_y")[0] for s in steps])
    rms = float(np.sqrt(((p - true[:, :2]) ** 2).sum(1).mean()))
    # four clean ranges of an instant fix a position to sqrt(2) 0.1 m / sqrt(2)
    assert rms < 0.15


def test_an_offset_that_nobody_told_is_found_by_the_evidence() -> None:
    rng = np.random.default_rng(7)
    true = walk(120, rng)
    data = ranges(true, rng)
    rec = recording(replace(data, z=data.z + 0.5))
    params = Params(range_bias_std=0.0)
    first = next(range_ls.estimate(rec.setup(), rec.scans(), params, np.random.default_rng(0)))
    found = first.meta.provenance["found"]
    assert found["explained_by"].get("nothing", 0.0) < 0.01
    assert found["learning_gain"] > 100


def test_a_device_that_moves_past_one_anchor_is_uncertain() -> None:
    rng = np.random.default_rng(8)
    data = ranges(walk(30, rng), rng)
    one = data.anchor == 0
    columns = {name: getattr(data, name)[one] for name in PER_RANGE}
    rec = recording(replace(data, **columns))
    params = Params(learn=())
    steps = list(range_ls.estimate(rec.setup(), rec.scans(), params, np.random.default_rng(0)))
    P = np.array([s.objects.covariance[0] for s in steps])
    assert np.sqrt(np.trace(P[:, :2, :2], axis1=1, axis2=2)).min() > 0.3

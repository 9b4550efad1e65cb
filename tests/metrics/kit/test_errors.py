"""Errors, their root mean square, their distribution and consistency, by hand and by law."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from echoset.metrics import cdf, nees, rmse
from echoset.metrics.kit.alignment import ScoredObject, interpolate, pairs
from echoset.metrics.kit.bootstrap import block_stderr, block_weights
from echoset.models.errors import InputError, ParameterError
from echoset.models.geometry.extent import from_axes, squared_wasserstein
from echoset.models.parameters import resolve
from echoset.models.records import Estimates, Recording, Scores, Truth

Make = Callable[..., Estimates]


def pick(scores: Scores, metric: str, part: str) -> tuple[list[float], float]:
    """Values per time, and the aggregate."""
    keys = zip(scores.metric, scores.part, scores.time, scores.value, strict=True)
    mine = [(t, v) for m, p, t, v in keys if (m, p) == (metric, part)]
    return [v for t, v in mine if t == t], next((v for t, v in mine if t != t), np.nan)


def test_rmse_by_hand(recording: Recording, estimate: Make) -> None:
    off = np.array([[0, 0, 3, 4], [0, 0, 0, 0], [1, 0, 0, 1]])
    scores = rmse.METRIC.score(estimate([1.0, 2.5, 7.25], off), recording, rmse.METRIC.Params())
    values, whole = pick(scores, "rmse", "device")
    np.testing.assert_allclose(values, [5, 0, 1], atol=1e-12)
    np.testing.assert_allclose(whole, np.sqrt(26 / 3))
    values, whole = pick(scores, "rmse", "centre")
    np.testing.assert_allclose([*values, whole], [0, 0, 1, np.sqrt(1 / 3)], atol=1e-12)
    assert "extent" not in scores.part
    assert pick(scores, "rmse-left-out", "")[1] == 0
    assert set(scores.recording) == {"walk-s1-0000"} and set(scores.estimator) == {"e"}


def test_truth_is_interpolated_over_short_gaps_only(recording: Recording, estimate: Make) -> None:
    times = [-0.5, 0.0, 0.5, 10.0, 10.5]
    aligned = pairs(estimate(times), recording, ScoredObject())
    np.testing.assert_array_equal(aligned.time, [0.0, 0.5, 10.0])
    assert aligned.left_out == 2
    aligned = pairs(estimate(times), recording, ScoredObject(max_gap=0.9))
    np.testing.assert_array_equal(aligned.time, [0.0, 10.0])
    with pytest.raises(InputError, match="no step"):
        pairs(estimate([11.0]), recording, ScoredObject())


def test_window(recording: Recording, estimate: Make) -> None:
    made = estimate(np.arange(10))
    np.testing.assert_array_equal(pairs(made, recording, ScoredObject(skip=4)).time, range(4, 10))
    inside = ScoredObject(start=3.0, stop=5.0)
    np.testing.assert_array_equal(pairs(made, recording, inside).time, [3, 4, 5])
    with pytest.raises(ParameterError, match="stop"):
        ScoredObject(start=2.0, stop=1.0)


def test_extent_turns_the_shorter_way(recording: Recording) -> None:
    n = 11
    angle = np.resize([np.radians(85.0), np.radians(-85.0)], n)
    axes = np.tile([0.4, 0.2], (n, 1))
    objects = replace(
        recording.truth.objects, extent_kind="ellipse", semi_axes=axes, rotation=angle
    )
    between, known = interpolate(
        replace(recording, truth=Truth(objects)), np.array([500_000_000]), ScoredObject()
    )
    assert known.all()
    np.testing.assert_allclose(np.cos(2 * between.rotation), -1)


def test_parts(recording: Recording, estimate: Make) -> None:
    ellipse = {"semi_axes": np.full((11, 2), 0.3), "rotation": np.zeros(11)}
    with pytest.raises(InputError, match="extent"):
        rmse.METRIC.score(estimate([1.0]), recording, rmse.METRIC.Params(parts=("extent",)))
    with pytest.raises(ParameterError, match="parts"):
        resolve(rmse.METRIC.Params, ("test", {"parts": ("wheel",)}))
    objects = replace(recording.truth.objects, extent_kind="ellipse", **ellipse)
    circle = {"extent_kind": "circle", "semi_axes": np.full((1, 2), 0.7), "rotation": np.zeros(1)}
    scores = rmse.METRIC.score(
        estimate([1.0], **circle), replace(recording, truth=Truth(objects)), rmse.METRIC.Params()
    )
    np.testing.assert_allclose(pick(scores, "rmse", "extent")[1], 0.4 * np.sqrt(2))


def test_several_objects_or_no_truth_are_refused(recording: Recording, estimate: Make) -> None:
    made = estimate([1.0, 2.0])
    two = replace(made.objects, time_ns=made.objects.time_ns[:1], row_offset=np.array([0, 2]))
    with pytest.raises(InputError, match="several"):
        pairs(replace(made, objects=two), recording, ScoredObject())
    with pytest.raises(InputError, match="truth"):
        pairs(made, replace(recording, truth=None), ScoredObject())
    labels = replace(recording.truth.objects, label=np.arange(11) % 2)
    with pytest.raises(InputError, match=r"\[0, 1\]"):
        pairs(made, replace(recording, truth=Truth(labels)), ScoredObject())


def test_step_without_estimate_is_left_out(recording: Recording, estimate: Make) -> None:
    made = estimate([1.0, 2.0])
    gap = replace(
        made.objects,
        time_ns=np.array([1, 2, 3]) * 10**9,
        row_offset=np.array([0, 1, 1, 2]),
        state=made.objects.state + np.array([[0, 0, 0, 0], [1, 0, 1, 0]]),
    )
    aligned = pairs(replace(made, objects=gap), recording, ScoredObject())
    assert aligned.left_out == 1
    scores = rmse.METRIC.score(replace(made, objects=gap), recording, rmse.METRIC.Params())
    np.testing.assert_allclose(pick(scores, "rmse", "device")[0], [0, 0], atol=1e-12)


def test_gaussian_wasserstein_against_the_matrix_root() -> None:
    rng = np.random.default_rng(3)
    a, b = rng.uniform(0.1, 1, (2, 50, 2))
    r, s = rng.uniform(-4, 4, (2, 50))
    np.testing.assert_allclose(
        np.sqrt(squared_wasserstein(from_axes(a, r), from_axes(b, r))),
        np.linalg.norm(a - b, axis=1),
    )

    def root(M: np.ndarray) -> np.ndarray:
        w, V = np.linalg.eigh(M)
        return (V * np.sqrt(w)[:, None, :]) @ V.swapaxes(1, 2)

    A, B = from_axes(a, r), from_axes(b, s)
    cross = root(root(A) @ B @ root(A))
    square = np.trace(A + B - 2 * cross, axis1=1, axis2=2)
    np.testing.assert_allclose(squared_wasserstein(A, B), square, atol=1e-12)


def test_cdf_counts(recording: Recording, estimate: Make) -> None:
    off = np.zeros((4, 4))
    off[:, 3] = [0.0, 0.5, 1.0, 2.0]
    params = cdf.METRIC.Params(thresholds=(2.0, 0.25, 0.75), parts=("device",))
    scores = cdf.METRIC.score(estimate([1, 2, 3, 4], off), recording, params)
    assert scores.part == ("device<=0.25", "device<=0.75", "device<=2")
    np.testing.assert_allclose(scores.value, [0.25, 0.5, 1.0])
    assert scores.n.tolist() == [4, 4, 4] and np.isnan(scores.time).all()


def test_nees_is_chi_square(recording: Recording, estimate: Make) -> None:
    rng = np.random.default_rng(5)
    n = 5000
    root = np.array([[0.3, 0.0], [0.1, 0.2]])
    off = np.zeros((n, 4))
    off[:, 2:] = rng.normal(size=(n, 2)) @ root.T
    P = np.zeros((n, 4, 4))
    P[:, 2:, 2:], P[:, :2, :2] = root @ root.T, np.eye(2)
    made = estimate(np.linspace(0, 10, n), off, covariance=P)
    scores = nees.METRIC.score(made, recording, nees.METRIC.Params(parts=("device",)))
    # Mean 2, variance 4; inside the 95 % bounds with probability 0.95.
    assert abs(pick(scores, "nees", "device")[1] - 2) < 4.5 * 2 / np.sqrt(n)
    inside = pick(scores, "nees-inside", "device")[1]
    assert abs(inside - 0.95) < 4.5 * np.sqrt(0.95 * 0.05 / n)
    first = off[0, 2:] @ np.linalg.inv(root @ root.T) @ off[0, 2:]
    np.testing.assert_allclose(pick(scores, "nees", "device")[0][0], first, rtol=1e-9)
    # With 2 degrees of freedom the distribution is 1 - exp(-x / 2).
    np.testing.assert_allclose(nees.bounds(), [-2 * np.log(0.975), -2 * np.log(0.025)])
    with pytest.raises(InputError, match="singular"):
        nees.METRIC.score(
            estimate([1.0], covariance=np.zeros((1, 4, 4))), recording, nees.METRIC.Params()
        )
    with pytest.raises(InputError, match="covariance"):
        nees.METRIC.score(estimate([1.0]), recording, nees.METRIC.Params())


def test_block_bootstrap() -> None:
    weights = block_weights(103, 10, 50)
    assert (weights.sum(1) == 103).all()
    rng = np.random.default_rng(7)
    x = rng.normal(size=40_000)
    # Independent Gaussian errors: the standard error of the root mean square is 1 / sqrt(2 n).
    # 400 resamples and 2,000 blocks know it to about 5 %.
    white = block_stderr(x**2, 20, 400)
    assert abs(white * np.sqrt(2 * len(x)) - 1) < 4.5 * 0.05
    # Each error four times: a quarter of the information, which only long blocks show.
    slow = block_stderr(np.repeat(x[:10_000], 4) ** 2, 40, 400)
    assert abs(slow * np.sqrt(2 * 10_000) - 1) < 4.5 * 0.06
    assert np.isnan(block_stderr(np.ones(10), 6, 10)) and np.isnan(block_stderr(np.ones(9), 0, 9))
    assert block_stderr(x[:500] ** 2, 5, 20) == block_stderr(x[:500] ** 2, 5, 20)

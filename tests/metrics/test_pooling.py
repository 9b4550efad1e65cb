"""Pooling against the same sums over all steps at once, and segments of time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from echoset.metrics.kit.table import Key, rows
from echoset.metrics.pooling import pool
from echoset.metrics.segments import parse, segments
from echoset.models.errors import InputError, ParameterError
from echoset.models.names import scenario
from echoset.models.records import Scores


def campaign(errors: list[np.ndarray], estimator: str = "e", name: str = "s") -> Scores:
    """What ``rmse`` and ``cdf`` write for recordings with these errors at 1, 2, ... s."""
    tables = []
    for run, e in enumerate(errors):
        key: Key = (f"{name}-s1-{run:04d}", estimator, "rmse", "device")
        tables += [
            rows(key, np.arange(1.0, len(e) + 1), e),
            rows(key, np.nan, np.sqrt(np.mean(e**2)), len(e), 0.123),
            rows((*key[:2], "cdf", "device<=1"), np.nan, np.mean(e <= 1), len(e)),
        ]
    return replace(Scores.join(tables), provenance={"a": 1})


def get(scores: Scores, metric: str, time: float = np.nan) -> tuple[float, int, float]:
    same = (scores.time == time) | (np.isnan(scores.time) & np.isnan(time))
    (i,) = np.flatnonzero(same & (np.array(scores.metric) == metric))
    return float(scores.value[i]), int(scores.n[i]), float(scores.stderr[i])


def test_pooled_values_are_those_over_all_steps() -> None:
    rng = np.random.default_rng(1)
    errors = [rng.exponential(size=n) for n in (4, 6, 3)]
    pooled = pool(campaign(errors))
    every = np.concatenate(errors)
    np.testing.assert_allclose(get(pooled, "rmse")[:2], [np.sqrt(np.mean(every**2)), 3])
    np.testing.assert_allclose(get(pooled, "cdf")[:2], [np.mean(every <= 1), 3])
    at = [np.sqrt(np.mean([e[k] ** 2 for e in errors if len(e) > k])) for k in range(6)]
    for k, n in enumerate((3, 3, 3, 2, 1, 1)):
        np.testing.assert_allclose(get(pooled, "rmse", k + 1.0)[:2], [at[k], n])
    assert np.isnan(get(pooled, "rmse", 6.0)[2])
    np.testing.assert_allclose(get(pooled, "rmse-mean")[:2], [np.mean(at), 3])
    assert set(pooled.recording) == {"*"} and pooled.provenance == {"a": 1}


def test_standard_error_over_recordings() -> None:
    rng = np.random.default_rng(2)
    squares = rng.exponential(size=(200, 1))
    value, _, stderr = get(pool(campaign(list(np.sqrt(squares)))), "rmse")
    # Delta method; 1,000 resamples know a standard deviation to 1 / sqrt(2000), the rest is the
    # curvature of the root, of the order 1 / n.
    expected = squares.std() / np.sqrt(200) / (2 * value)
    assert abs(stderr / expected - 1) < 4.5 / np.sqrt(2000) + 0.02


def test_one_recording_keeps_its_own_standard_error() -> None:
    pooled = pool(campaign([np.array([1.0, 2.0])]))
    assert get(pooled, "rmse")[2] == 0.123 and np.isnan(get(pooled, "rmse", 1.0)[2])


def test_groups() -> None:
    e = [np.ones(2), np.ones(2)]
    both = Scores.join([campaign(e, name="s"), campaign(e, "f"), campaign(e, name="t")])
    assert set(pool(both, by_scenario=True).recording) == {"s-*", "t-*"}
    assert set(pool(both).estimator) == {"e", "f"}
    again = pool(pool(both))
    np.testing.assert_array_equal(again.value, pool(both).value)
    assert len(pool(Scores((), (), (), (), *(np.zeros(0),) * 4))) == 0
    names = ("uwb-olos-s12-0003", "labyrinth", "uwb-olos-*", "a-s1")
    assert [scenario(n) for n in names] == ["uwb-olos", "labyrinth", "uwb-olos", "a-s1"]


def test_pooled_rows_beside_their_recordings() -> None:
    one = campaign([np.array([1.0, 2.0]), np.array([3.0, 1.0])])
    both = pool(Scores.join([one, pool(one)]), by_scenario=True)
    assert set(both.recording) == {"s-*"} and len(both) == len(pool(one))
    other = replace(pool(one), value=2 * pool(one).value)
    assert set(pool(Scores.join([one, other]), by_scenario=True).recording) == {"s-*", "*"}


def test_equal_values_pool_exactly() -> None:
    value = float(np.sqrt(0.1))
    by_count = [pool(campaign([np.array([value])] * n)) for n in (3, 7)]
    for scores in by_count:
        assert (scores.stderr[np.isnan(scores.time)] == 0).all()
    np.testing.assert_array_equal(by_count[0].value, by_count[1].value)


def test_scored_twice() -> None:
    once = campaign([np.ones(2)])
    np.testing.assert_array_equal(pool(Scores.join([once, once])).n, pool(once).n)
    with pytest.raises(InputError, match="more than once"):
        pool(Scores.join([once, replace(once, value=2 * once.value)]))


def test_segments() -> None:
    errors = [np.array([1.0, 2.0, 3.0, 4.0]), np.array([5.0, 6.0, 7.0, 8.0])]
    cut = pool(segments(campaign(errors), parse("2:3,4:9,90:99")))
    found = dict(zip(cut.part, cut.value, strict=True))
    np.testing.assert_allclose(found["device@2:3"], np.sqrt(np.mean([4, 9, 36, 49])))
    np.testing.assert_allclose(found["device@4:9"], np.sqrt(np.mean([16, 64])))
    assert "device@90:99" not in found
    for text in ("", "1", "1:2:3", "a:b", "2:1", "nan:1"):
        with pytest.raises(ParameterError, match="segment"):
            parse(text)


def test_standard_error_where_few_recordings_err() -> None:
    """One of R recordings errs: its root mean square is that of a binomial number of draws."""
    for count, error in ((5, 1.7), (7, 0.001), (10, 2.3), (11, 0.001)):
        pooled = pool(campaign([np.full(3, error), *[np.zeros(3)] * (count - 1)]))
        drawn = np.arange(count + 1)
        p = binom.pmf(drawn, count, 1 / count)
        root = error * np.sqrt(drawn / count)
        mean = p @ root
        variance, fourth = p @ (root - mean) ** 2, p @ (root - mean) ** 4
        spread = np.sqrt((fourth - variance**2) / 1000) / (2 * np.sqrt(variance))
        assert abs(get(pooled, "rmse")[2] - np.sqrt(variance)) < 4.5 * spread
        assert get(pooled, "rmse")[0] == pytest.approx(error / np.sqrt(count), rel=1e-12)

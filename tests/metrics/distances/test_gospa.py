"""GOSPA and the normalised variant of OSPA against all partial assignments."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations, permutations

import numpy as np
import pytest

from echoset.metrics.distances import gospa, ospa_normalised
from echoset.metrics.kit.alignment import Scored
from echoset.metrics.kit.sets import sets

BOTH = {"gospa": gospa.gospa, "normalised": ospa_normalised.ospa_normalised}


def value(scene, metric, x, y, order=2.0, cutoff=10.0):
    """The metric and its parts between two lists of points."""
    estimates, recording = scene([dict(enumerate(x))], [dict(enumerate(y))])
    found = BOTH[metric](sets(estimates, recording, Scored()), order, cutoff)
    return {part: v[0] for part, v in found.items()}


def assignments(x, y, order, cutoff) -> Iterator[tuple[float, int]]:
    """Sum of d^p and number of pairs of every partial assignment within the cut-off."""
    for size in range(min(len(x), len(y)) + 1):
        for rows in combinations(range(len(x)), size):
            for columns in permutations(range(len(y)), size):
                d = [np.hypot(*np.subtract(x[i], y[j])) for i, j in zip(rows, columns, strict=True)]
                if max(d, default=0.0) < cutoff:
                    yield sum(e**order for e in d), size


def by_enumeration(metric, x, y, order, cutoff):
    total = len(x) + len(y)
    least = min(
        (power + cutoff**order / 2 * (total - 2 * size))
        / (1 if metric == "gospa" else max(total - size, 1))
        for power, size in assignments(x, y, order, cutoff)
    )
    return least ** (1 / order)


def draw(rng):
    return [tuple(p) for p in rng.uniform(0, 12, (rng.integers(0, 5), 2))]


@pytest.mark.parametrize("metric", BOTH)
@pytest.mark.parametrize("order", [1.0, 2.0, 3.5])
def test_equal_to_the_least_over_all_assignments(scene, metric, order):
    rng = np.random.default_rng(5)
    for _ in range(60):
        x, y, cutoff = draw(rng), draw(rng), rng.uniform(3, 12)
        expected = by_enumeration(metric, x, y, order, cutoff)
        found = value(scene, metric, x, y, order, cutoff)
        assert np.isclose(found[""], expected, rtol=1e-13)
        powers = [found[part] ** order for part in ("localisation", "missed", "false")]
        assert np.isclose(sum(powers), found[""] ** order, rtol=1e-13)


def test_gospa_by_hand(scene):
    one, two = [(0.0, 0.0)], [(0.0, 3.0), (100.0, 0.0)]
    found = value(scene, "gospa", one, two)
    parts = {"": np.sqrt(9 + 50), "localisation": 3.0, "missed": 0.0, "false": np.sqrt(50)}
    assert found == pytest.approx(parts, rel=1e-15)
    assert value(scene, "gospa", two, one)["missed"] == pytest.approx(np.sqrt(50), rel=1e-15)
    assert value(scene, "gospa", two, [], cutoff=20.0)[""] == pytest.approx(20.0, rel=1e-15)
    assert value(scene, "gospa", [], [])[""] == 0.0


def test_gospa_is_a_metric(scene):
    rng = np.random.default_rng(6)
    for _ in range(60):
        x, y, z = draw(rng), draw(rng), draw(rng)
        assert value(scene, "gospa", x, x)[""] == 0.0
        xy, yz, xz = (value(scene, "gospa", a, b)[""] for a, b in ((x, y), (y, z), (x, z)))
        assert xy == pytest.approx(value(scene, "gospa", y, x)[""], rel=1e-14)
        assert xz <= xy + yz + 1e-12


def test_normalised_by_hand(scene):
    one, two = [(0.0, 0.0)], [(0.0, 3.0), (100.0, 0.0)]
    assert value(scene, "normalised", one, two)[""] == pytest.approx(np.sqrt((9 + 50) / 2))
    assert value(scene, "normalised", [], [])[""] == 0.0
    for x, y in ((two, []), ([], one)):
        assert value(scene, "normalised", x, y)[""] == pytest.approx(10 / np.sqrt(2), rel=1e-15)


def test_normalised_leaves_pairs_alone_that_raise_the_ratio(scene):
    """At 9 m of 10 a pair costs 81 for one object, apart they cost 100 for two."""
    x, y = [(0.0, 0.0)], [(9.0, 0.0)]
    assert value(scene, "gospa", x, y)[""] == pytest.approx(9.0)
    assert value(scene, "normalised", x, y)[""] == pytest.approx(np.sqrt(50))
    assert value(scene, "normalised", x, y)["missed"] == pytest.approx(5.0)


def test_scores_and_their_roots_of_mean_squares(scene):
    truth = [{7: (0.0, 0.0)}, {7: (1.0, 0.0), 8: (50.0, 0.0)}, {}]
    estimated = [{1: (0.0, 1.0)}, {1: (1.0, 2.0)}, {4: (0.0, 0.0)}]
    scores = gospa.METRIC.score(*scene(truth, estimated), gospa.METRIC.Params(cutoff=4.0))
    found = {
        (m, p): v
        for m, p, t, v in zip(scores.metric, scores.part, scores.time, scores.value, strict=True)
        if np.isnan(t)
    }
    assert found["gospa", ""] == pytest.approx((1 + np.sqrt(12) + np.sqrt(8)) / 3, rel=1e-14)
    assert found["gospa-rms", ""] == pytest.approx(np.sqrt(21 / 3), rel=1e-14)
    for part, square in {"localisation": 5, "missed": 8, "false": 8}.items():
        assert found["gospa-rms", part] == pytest.approx(np.sqrt(square / 3), rel=1e-14)
    normalised = ospa_normalised.METRIC.score(
        *scene(truth, estimated), ospa_normalised.METRIC.Params()
    )
    assert set(normalised.metric) == {"ospa-normalised", "ospa-normalised-left-out"}
    assert ospa_normalised.METRIC.Params().cutoff == 5.0

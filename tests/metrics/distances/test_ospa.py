"""OSPA against numbers by hand, all permutations, and the axioms of a metric."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from echoset.metrics.distances import ospa
from echoset.metrics.kit.alignment import Scored
from echoset.metrics.kit.sets import sets
from echoset.models.errors import ParameterError
from echoset.models.parameters import resolve


def value(scene, x, y, order=2.0, cutoff=10.0, part=""):
    """OSPA of two lists of points."""
    estimates, recording = scene([dict(enumerate(x))], [dict(enumerate(y))])
    return ospa.ospa(sets(estimates, recording, Scored()), order, cutoff)[part][0]


def by_permutations(x, y, order, cutoff):
    """The definition, word by word, for distances cut off at c."""
    x, y = sorted((x, y), key=len)
    if not y:
        return 0.0
    d = [[min(np.hypot(*np.subtract(a, b)), cutoff) ** order for b in y] for a in x]
    least = min(
        sum(d[i][j] for i, j in enumerate(chosen)) for chosen in permutations(range(len(y)), len(x))
    )
    return ((least + cutoff**order * (len(y) - len(x))) / len(y)) ** (1 / order)


def draw(rng):
    return [tuple(p) for p in rng.uniform(0, 12, (rng.integers(0, 6), 2))]


def test_numbers_by_hand(scene):
    one, far = [(0.0, 0.0)], [(3.0, 4.0)]
    assert value(scene, one, far) == 5.0
    assert value(scene, one, far, cutoff=2.0) == 2.0
    two = [(0.0, 3.0), (100.0, 0.0)]
    assert value(scene, one, two) == np.sqrt((9 + 100) / 2)
    assert value(scene, one, two, part="localisation") == np.sqrt(9 / 2)
    assert value(scene, one, two, part="cardinality") == np.sqrt(100 / 2)
    assert value(scene, one, two, order=1.0) == (3 + 10) / 2


def test_empty_sets(scene):
    assert value(scene, [], []) == 0.0
    for x, y in (([], [(1.0, 2.0)]), ([(1.0, 2.0), (3.0, 4.0)], [])):
        assert value(scene, x, y) == 10.0
        assert value(scene, x, y, part="localisation") == 0.0


@pytest.mark.parametrize("order", [1.0, 2.0, 3.5])
def test_equal_to_the_definition_over_all_permutations(scene, order):
    rng = np.random.default_rng(3)
    for _ in range(60):
        x, y, cutoff = draw(rng), draw(rng), rng.uniform(2, 12)
        expected = by_permutations(x, y, order, cutoff)
        assert np.isclose(value(scene, x, y, order, cutoff), expected, rtol=1e-13)


def test_axioms_of_a_metric(scene):
    rng = np.random.default_rng(4)
    for _ in range(60):
        x, y, z = draw(rng), draw(rng), draw(rng)
        assert value(scene, x, x) == 0.0
        xy, yz, xz = value(scene, x, y), value(scene, y, z), value(scene, x, z)
        assert xy == pytest.approx(value(scene, y, x), rel=1e-14)
        assert xz <= xy + yz + 1e-12
        assert xy > 0 or x == y


def test_scores_of_a_recording(scene):
    truth = [{7: (0.0, 0.0)}, {7: (1.0, 0.0), 8: (50.0, 0.0)}, {}]
    estimated = [{1: (0.0, 1.0)}, {1: (1.0, 2.0)}, {}]
    estimates, recording = scene(truth, estimated)
    scores = ospa.METRIC.score(estimates, recording, ospa.METRIC.Params(cutoff=4.0))
    assert set(scores.metric) == {"ospa", "ospa-left-out"}
    whole = [i for i, part in enumerate(scores.part) if part == "" and scores.metric[i] == "ospa"]
    assert scores.time[whole].tolist()[:3] == [0, 1, 2] and np.isnan(scores.time[whole[3]])
    expected = [1.0, np.sqrt((4 + 16) / 2), 0.0]
    np.testing.assert_allclose(scores.value[whole], [*expected, np.mean(expected)], rtol=1e-14)
    assert scores.n[whole].tolist() == [1, 1, 1, 3]


def test_parameters():
    for wrong in ({"order": 0.5}, {"cutoff": 0.0}, {"block": -1}, {"max_gap": -1.0}):
        with pytest.raises(ParameterError):
            resolve(ospa.METRIC.Params, ("test", wrong))

"""OSPA(2) against its definition over labelled tracks, and exact limits."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest

from echoset.metrics.distances import ospa
from echoset.metrics.distances.ospa2 import METRIC, Params, measure, ospa2
from echoset.metrics.kit.alignment import Scored
from echoset.metrics.kit.sets import sets
from echoset.models.errors import ParameterError
from echoset.models.parameters import resolve


def track_distance(f, g, order, cutoff):
    """p-th power of the mean distance of two tracks {step: position}."""
    lifetime = sorted(set(f) | set(g))
    apart = [
        min(np.hypot(*np.subtract(f[k], g[k])), cutoff) if k in f and k in g else cutoff
        for k in lifetime
    ]
    return np.mean(np.power(apart, order))


def definition(truth, estimated, k, window, order, cutoff):
    tracks = []
    for steps in (truth, estimated):
        found = {}
        for t in range(max(0, k - window + 1), k + 1):
            for label, position in steps[t].items():
                found.setdefault(label, {})[t] = position
        tracks.append(list(found.values()))
    x, y = sorted(tracks, key=len)
    if not y:
        return 0.0
    d = [[track_distance(f, g, order, cutoff) for g in y] for f in x]
    least = min(sum(d[i][j] for i, j in enumerate(c)) for c in permutations(range(len(y)), len(x)))
    return ((least + cutoff**order * (len(y) - len(x))) / len(y)) ** (1 / order)


def draw(rng, labels):
    return [
        {n: tuple(rng.uniform(0, 6, 2)) for n in labels if rng.random() < 0.7} for _ in range(8)
    ]


@pytest.mark.parametrize("window", [1, 3, 20])
@pytest.mark.parametrize("order", [1.0, 2.0])
def test_equal_to_the_definition(scene, window, order):
    rng = np.random.default_rng(7)
    for _ in range(10):
        truth, estimated = draw(rng, [5, 3, 9]), draw(rng, [2, 3, 11, 40])
        measured = measure(*scene(truth, estimated), Params(order=order, cutoff=4.0))
        found = ospa2(measured, order, 4.0, window)
        expected = [definition(truth, estimated, k, window, order, 4.0) for k in range(8)]
        np.testing.assert_allclose(found[""], expected, rtol=1e-12)
        parts = found["localisation"] ** order + found["cardinality"] ** order
        np.testing.assert_allclose(parts, found[""] ** order, rtol=1e-12)


def test_a_window_of_one_step_is_ospa(scene):
    rng = np.random.default_rng(8)
    pair = scene(draw(rng, range(5)), draw(rng, range(4)))
    aligned, measured = sets(*pair, Scored()), measure(*pair, Params(cutoff=4.0))
    for part, values in ospa.ospa(aligned, 2.0, 4.0).items():
        np.testing.assert_allclose(ospa2(measured, 2.0, 4.0, 1)[part], values, atol=1e-12)


def test_swapped_labels_cost_though_the_sets_are_equal(scene):
    truth = [{1: (0.0, 0.0), 2: (50.0, 0.0)}] * 4
    swapped = [{7: (0.0, 0.0), 8: (50.0, 0.0)}] * 2 + [{8: (0.0, 0.0), 7: (50.0, 0.0)}] * 2
    pair = scene(truth, swapped)
    aligned, measured = sets(*pair, Scored()), measure(*pair, Params(order=1.0))
    assert ospa.ospa(aligned, 1.0, 10.0)[""].tolist() == [0, 0, 0, 0]
    np.testing.assert_allclose(ospa2(measured, 1.0, 10.0, 4)[""], [0, 0, 10 / 3, 5], rtol=1e-14)


def test_empty_steps_and_parameters(scene):
    scores = METRIC.score(*scene([{}, {}], [{}, {1: (0.0, 0.0)}]), Params())
    whole = [v for m, p, v in zip(scores.metric, scores.part, scores.value, strict=True) if not p]
    assert whole == [0.0, 10.0, 5.0, 0.0]
    with pytest.raises(ParameterError):
        resolve(Params, ("test", {"window": 0}))

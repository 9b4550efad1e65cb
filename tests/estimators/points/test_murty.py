"""The k best assignments against all assignments there are."""

from itertools import permutations

import numpy as np
import pytest

from echoset.estimators.points.kernels import murty
from echoset.estimators.points.kernels.compiled import murty as compiled

BOTH = pytest.mark.parametrize("k_best", [murty.k_best, compiled.k_best])


def brute(costs, k, gap):
    """All feasible assignments of all problems, by cost, cut to k and to the gap."""
    G, n, m = costs.shape
    found = []
    for g in range(G):
        for columns in permutations(range(m), n):
            cost = sum(costs[g, i, c] for i, c in enumerate(columns))
            if cost < np.inf:
                found.append((cost, g, columns))
    found.sort()
    return [f for f in found if f[0] <= found[0][0] + gap][:k]


def case(seed):
    rng = np.random.default_rng(seed)
    G, n = rng.integers(1, 4), rng.integers(0, 5)
    costs = rng.normal(0, 5, (G, n, n + rng.integers(0, 3)))
    costs[rng.random(costs.shape) < rng.choice([0.0, 0.3, 0.7])] = np.inf
    return costs, int(rng.choice([1, 7, 10_000])), float(rng.choice([4.0, np.inf]))


@BOTH
def test_equals_brute_force_with_forbidden_pairs(k_best):
    sizes = []
    for seed in range(200):
        costs, k, gap = case(seed)
        expected = brute(costs, k, gap)
        problem, columns, cost = k_best(costs, k, gap)
        assert problem.tolist() == [g for _, g, _ in expected]
        assert columns.tolist() == [list(c) for _, _, c in expected]
        assert np.allclose(cost, [c for c, _, _ in expected], rtol=1e-12, atol=1e-12)
        sizes.append(len(expected))
    # Impossible problems, single answers and long lists were all among them.
    assert min(sizes) == 0 and 1 in sizes and max(sizes) > 100


def tracks(rng, count, detections, problems):
    """Costs as a filter has them: few pairs in gates, a column of its own for every miss."""
    costs = np.full((problems, count, detections + count), np.inf)
    pair = rng.normal(-3, 4, (problems, count, detections))
    costs[:, :, :detections] = np.where(rng.random(pair.shape) < 0.3, pair, np.inf)
    costs[:, np.arange(count), detections + np.arange(count)] = rng.normal(size=count)
    return costs


def test_twin_equals_definition_on_larger_problems():
    for seed in range(40):
        rng = np.random.default_rng(seed)
        costs = tracks(rng, rng.integers(6, 15), rng.integers(6, 20), rng.integers(1, 6))
        for a, b in zip(murty.k_best(costs, 60), compiled.k_best(costs, 60), strict=True):
            assert np.allclose(a, b, rtol=1e-12)


@BOTH
def test_equal_costs_give_every_assignment_once(k_best):
    problem, columns, cost = k_best(np.ones((1, 3, 4)), 100)
    assert len({tuple(c) for c in columns.tolist()}) == len(columns) == 24
    assert (problem == 0).all() and (cost == 3.0).all()

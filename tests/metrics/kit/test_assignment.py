"""Pairs below a cut-off and their best assignment, against loops and enumeration."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from echoset.metrics.kit import assignment
from echoset.metrics.kit.assignment import CandidatePairs, assign, matched, near


def ragged(rng: np.random.Generator, steps: int, most: int) -> tuple[np.ndarray, np.ndarray]:
    offset = np.concatenate(([0], np.cumsum(rng.integers(0, most + 1, steps))))
    return rng.uniform(0, 10, (offset[-1], 2)), offset


def all_near(a, a_offset, b, b_offset, cutoff):
    found = []
    for step in range(len(a_offset) - 1):
        for i in range(a_offset[step], a_offset[step + 1]):
            for j in range(b_offset[step], b_offset[step + 1]):
                d = np.hypot(*(a[i] - b[j]))
                if d < cutoff:
                    found.append((step, i, j, d))
    return found


def test_near_finds_what_a_loop_finds_in_blocks_of_any_size(monkeypatch):
    rng = np.random.default_rng(1)
    tables = [(*ragged(rng, 12, 5), *ragged(rng, 12, 6)) for _ in range(20)]
    for block in (1, 7, 1 << 20):
        monkeypatch.setattr(assignment, "_BLOCK", block)
        for table in tables:
            pairs = near(*table, 4.0)
            rows = list(zip(pairs.step, pairs.first, pairs.second, strict=True))
            expected = all_near(*table, 4.0)
            assert rows == [row[:3] for row in expected]
            np.testing.assert_allclose(pairs.distance, [row[3] for row in expected], rtol=1e-14)


def best(pairs: CandidatePairs, gain: np.ndarray) -> float:
    """Largest sum of gains over all sets of pairs without a common end."""
    most = 0.0
    for size in range(len(pairs) + 1):
        for chosen in combinations(range(len(pairs)), size):
            ends = [pairs.first[list(chosen)], pairs.second[list(chosen)]]
            if all(len(set(e)) == size for e in ends):
                most = max(most, gain[list(chosen)].sum())
    return most


def test_assign_is_optimal_among_all_assignments():
    rng = np.random.default_rng(2)
    contested = 0
    for _ in range(100):
        table = (*ragged(rng, 2, 3), *ragged(rng, 2, 3))
        pairs = near(*table, 8.0)
        gain = rng.uniform(-0.2, 1.0, len(pairs))
        chosen = assign(pairs, gain)
        assert (np.diff(chosen) > 0).all() and (gain[chosen] > 0).all()
        for ends in (pairs.first[chosen], pairs.second[chosen]):
            assert len(set(ends)) == len(ends)
        assert np.isclose(gain[chosen].sum(), best(pairs, gain), rtol=1e-12)
        contested += len(pairs) > len(chosen)
    assert contested > 50


def test_nothing_to_assign():
    none, offset = np.zeros((0, 2)), np.zeros(4, np.int64)
    one, where = np.ones((1, 2)), np.array([0, 0, 1, 1])
    for a, a_offset, b, b_offset in ((none, offset, none, offset), (one, where, none, offset)):
        pairs = near(a, a_offset, b, b_offset, 1.0)
        assert len(pairs) == 0 and len(assign(pairs, pairs.distance)) == 0
        power, count = matched(pairs, 2.0, 1.0, 3)
        assert power.tolist() == [0, 0, 0] and count.tolist() == [0, 0, 0]


def test_the_cut_off_itself_is_too_far():
    a, b, offset = np.zeros((1, 2)), np.array([[3.0, 4.0]]), np.array([0, 1])
    assert len(near(a, offset, b, offset, 5.0)) == 0
    assert near(a, offset, b, offset, 5.0001).distance.tolist() == [5.0]

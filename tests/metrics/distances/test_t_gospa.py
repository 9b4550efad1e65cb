"""T-GOSPA against enumeration of assignments, its programme as the paper writes it, and limits."""

from __future__ import annotations

from itertools import permutations, product

import numpy as np
import pytest
from scipy.optimize import linprog

from echoset.metrics.distances import gospa
from echoset.metrics.distances.ospa2 import measure
from echoset.metrics.distances.t_gospa import METRIC, PARTS, Params, t_gospa
from echoset.metrics.kit.sets import sets
from echoset.models.errors import ParameterError
from echoset.models.parameters import resolve


def tracks(steps):
    """Tracks {step: position} of a scene."""
    found = {}
    for k, step in enumerate(steps):
        for label, position in step.items():
            found.setdefault(label, {})[k] = np.array(position)
    return list(found.values())


def costs(truth, estimated, steps, p, c):
    """Base costs (steps, n + 1, m + 1): of all pairs, and in the last row and column of none."""
    x, y = tracks(truth), tracks(estimated)
    D = np.zeros((steps, len(x) + 1, len(y) + 1))
    for k in range(steps):
        D[k, :-1, -1] = [c**p / 2 if k in f else 0.0 for f in x]
        D[k, -1, :-1] = [c**p / 2 if k in g else 0.0 for g in y]
        for i, f in enumerate(x):
            for j, g in enumerate(y):
                both = k in f and k in g
                apart = min(np.hypot(*(f[k] - g[k])), c) ** p if both else 0.0
                D[k, i, j] = apart if both else D[k, i, -1] + D[k, -1, j]
    return D


def enumerated(D, gamma, p):
    """Least cost over all sequences of assignments."""
    n, m = D.shape[1] - 1, D.shape[2] - 1
    choices = {
        tuple(j if j < m else -1 for j in chosen) for chosen in permutations(range(m + n), n)
    }
    best = np.inf
    for sequence in product(choices, repeat=len(D)):
        total = 0.0
        for k, chosen in enumerate(sequence):
            total += sum(D[k, i, j] for i, j in enumerate(chosen))
            total += sum(D[k, -1, j] for j in range(m) if j not in chosen)
            if k:
                pairs, before = ({(i, j) for i, j in enumerate(s) if j >= 0}
                                 for s in (chosen, sequence[k - 1]))  # fmt: skip
                total += gamma**p / 2 * len(pairs ^ before)
        best = min(best, total)
    return best


def programme(D, gamma, p):
    """The linear programme over all weights, dummies included, as the paper writes it."""
    T, n, m = len(D), D.shape[1] - 1, D.shape[2] - 1
    size = (T, n + 1, m + 1)
    W = np.arange(np.prod(size)).reshape(size)
    changes = np.arange((T - 1) * n * m).reshape(T - 1, n, m) + W.size
    total = W.size + changes.size
    cost = np.concatenate((D.ravel(), np.full(changes.size, gamma**p / 2)))
    equal, above = [], []
    for k in range(T):
        for line in (*W[k, :-1], *W[k, :, :-1].T):
            row = np.zeros(total)
            row[line] = 1
            equal.append(row)
        for i, j in product(range(n), range(m)) if k else ():
            for sign in (-1, 1):
                row = np.zeros(total)
                row[[W[k, i, j], W[k - 1, i, j], changes[k - 1, i, j]]] = sign, -sign, -1
                above.append(row)
    solved = linprog(
        cost, A_ub=np.array(above), b_ub=np.zeros(len(above)), A_eq=np.array(equal),
        b_eq=np.ones(len(equal)), bounds=(0, None),
    )  # fmt: skip
    return solved.fun


def draw(rng, labels, steps, reach=6):
    return [
        {n: tuple(rng.uniform(0, reach, 2)) for n in labels if rng.random() < 0.75}
        for _ in range(steps)
    ]


@pytest.mark.parametrize("p", [1.0, 2.0])
def test_two_tracks_in_three_steps_by_enumeration(scene, p):
    rng = np.random.default_rng(3)
    for _ in range(25):
        truth, estimated = draw(rng, [5, 3], 3), draw(rng, [2, 9], 3)
        found = t_gospa(measure(*scene(truth, estimated), Params(order=p, cutoff=4.0)), p, 4.0, 1.0)
        assert found[""].sum() == pytest.approx(
            enumerated(costs(truth, estimated, 3, p, 4.0), 1.0, p), abs=1e-9
        )


@pytest.mark.parametrize("p", [1.0, 2.0])
@pytest.mark.parametrize("reach", [6, 15])
def test_many_tracks_by_the_whole_programme(scene, p, reach):
    """Near tracks that are one problem, and far ones that fall into several with gaps in time."""
    rng = np.random.default_rng(4)
    for _ in range(8):
        truth, estimated = draw(rng, [5, 3, 8], 7, reach), draw(rng, [2, 9, 3, 4], 7, reach)
        measured = measure(*scene(truth, estimated), Params(order=p, cutoff=4.0))
        found = t_gospa(measured, p, 4.0, 1.5)
        expected = programme(costs(truth, estimated, 7, p, 4.0), 1.5, p)
        assert found[""].sum() == pytest.approx(expected, abs=1e-7)
        np.testing.assert_allclose(sum(found[part] for part in PARTS), found[""], rtol=1e-12)


def test_a_swap_of_labels_costs_a_switch_of_both(scene):
    """Each of two pairs is given up and begun anew: four changes of gamma / 2."""
    truth = [{1: (0.0, 0.0), 2: (50.0, 0.0)}] * 6
    swapped = [{7: (0.0, 0.0), 8: (50.0, 0.0)}] * 3 + [{8: (0.0, 0.0), 7: (50.0, 0.0)}] * 3
    found = t_gospa(measure(*scene(truth, swapped), Params()), 1.0, 10.0, 2.0)
    assert found["switch"].tolist() == [0, 0, 0, 4, 0, 0]
    assert found["missed"].sum() == found["false"].sum() == found["localisation"].sum() == 0


def test_switches_for_nothing_are_gospa_step_by_step(scene):
    rng = np.random.default_rng(5)
    pair = scene(draw(rng, range(5), 9), draw(rng, range(4), 9))
    measured = measure(*pair, Params(cutoff=4.0))
    found = t_gospa(measured, 1.0, 4.0, 1e-9)
    expected = gospa.gospa(sets(*pair, Params()), 1.0, 4.0)
    np.testing.assert_allclose(found[""], expected[""], atol=1e-6)
    for part in ("localisation", "missed", "false"):
        np.testing.assert_allclose(found[part], expected[part], atol=1e-6)


def test_pairs_are_found_at_the_best_time_though_both_tracks_have_gaps(scene):
    """One true track, seen as two in turn: given up and begun, gamma in all, or one never used."""
    near, none = (0.0, 0.0), {}
    truth = [{1: near}] * 4
    estimated = [{7: near}, none, none, {8: near}]
    found = t_gospa(measure(*scene(truth, estimated), Params()), 1.0, 10.0, 2.0)
    assert found[""].sum() == 2 * 10 / 2 + 2
    found = t_gospa(measure(*scene(truth, estimated), Params()), 1.0, 10.0, 40.0)
    assert found[""].sum() == 3 * 10 / 2 + 10 / 2


def test_scores_are_means_of_powers(scene):
    rng = np.random.default_rng(6)
    pair = scene(draw(rng, range(3), 5), draw(rng, range(3), 5))
    scores = METRIC.score(*pair, Params(order=2.0, cutoff=4.0))
    powers = t_gospa(measure(*pair, Params(order=2.0, cutoff=4.0)), 2.0, 4.0, 2.0)
    columns = scores.metric, scores.part, scores.value, scores.time
    for part in ("", *PARTS):
        own = [
            value
            for metric, of, value, time in zip(*columns, strict=True)
            if metric == "t-gospa" and of == part and np.isnan(time)
        ]
        assert own == [pytest.approx(np.sqrt(powers[part].mean()), abs=1e-12)]


def test_nothing_at_all_and_parameters(scene):
    scores = METRIC.score(*scene([{}, {}], [{}, {1: (0.0, 0.0)}]), Params())
    whole = [v for p, v in zip(scores.part, scores.value, strict=True) if not p]
    assert whole == [0.0, 5.0, 2.5, 0.0]
    with pytest.raises(ParameterError):
        resolve(Params, ("test", {"switch": 0}))

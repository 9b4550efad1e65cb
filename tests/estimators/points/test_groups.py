"""Groups of tracks: twins, and the filter by groups against one group and pairs of marginals."""

from itertools import product

import numpy as np
import pytest

from echoset.estimators.points import mbm
from echoset.estimators.points.context import Context
from echoset.estimators.points.kernels import bernoulli, groups
from echoset.estimators.points.kernels.compiled import groups as compiled

MODEL = {
    "p_detect": 0.9,
    "clutter_rate": 4.0,
    "clutter_region": (0.0, 400.0, 0.0, 100.0),
    "std_position": 1.0,
    "birth_rate": 0.2,
    "birth_std_velocity": (2.0, 2.0),
}
EXACT = {
    "gate": 1e9,
    "min_existence": 0.0,
    "min_weight": 1e-200,
    "max_hypotheses": 20_000,
    "merge_distance": 0.0,
}


def mixture(rng, sizes=(1, 3, 2, 2), rows=(1, 6, 4, 3)):
    """Groups of some tracks in some hypotheses, of which tracks have up to three Bernoullis."""
    T, C, G = sum(sizes), len(sizes), max(rows)
    group = rng.permutation(np.repeat(np.arange(C), sizes))
    w, table, L = np.zeros((G, C)), np.full((G, T), -1), 0
    for c, n in enumerate(rows):
        w[:n, c] = -np.sort(-rng.dirichlet(np.ones(n)))
    for t, c in enumerate(group):
        pick = rng.integers(-1, 3, rows[c])
        table[: rows[c], t] = np.where(pick < 0, -1, L + pick)
        L += 3
    local = bernoulli.newborn(rng.random(L), rng.normal(size=(L, 4)), np.tile(np.eye(4), (L, 1, 1)))
    parent = np.tile(np.arange(G)[:, None], (1, C))
    return bernoulli.Mixture(
        local, np.arange(T), np.zeros((T, 4)), w, table, group, parent, np.arange(C), np.arange(C)
    )


def equal(one, other):
    for a, b in zip(one, other, strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-14)


@pytest.mark.parametrize("seed", range(12))
def test_twins_are_as_the_definitions(seed):
    rng = np.random.default_rng(seed)
    x, M = mixture(rng), 6
    pairs = rng.integers(0, 4, 5), rng.integers(0, M, 5)
    one, other = (m.together(*pairs, 4, M) for m in (groups, compiled))
    equal(one, other)
    into, of = one
    for k, gap in ((100, np.inf), (4, np.inf), (100, 2.0)):
        one, other = (m.join(x.w, into, k, gap) for m in (groups, compiled))
        equal(one, other)
    row, w, _ = one

    x = x.rows(row, w, into[x.group], into)
    gain = np.where(
        rng.random((len(x.local), M)) < 0.5, rng.normal(0, 3, (len(x.local), M)), -np.inf
    )
    gain = np.vstack((gain, np.full(M, -np.inf)))
    miss = np.append(-rng.random(len(x.local)), 0.0)
    for k, gap in ((1000, np.inf), (7, np.inf), (1000, 3.0)):
        args = x.w, x.table, x.group, gain, miss, of, k, gap
        (cost, *one), (cost_2, *other) = groups.best(*args), compiled.best(*args)
        equal([cost], [cost_2])
        # Of what costs the same any may come first.
        apart = np.where(np.isinf(cost), 1e6 + np.arange(len(cost))[:, None], cost)
        clear = np.abs(np.diff(apart, axis=0, prepend=-1e6, append=1e9))
        clear = (clear[:-1] > 1e-9) & (clear[1:] > 1e-9)
        assert (one[0] == other[0])[clear].all()
        assert (one[1] == other[1])[clear[:, x.group]].all()
    for dependence in (1e-12, 0.1, 0.3, 1.0):
        args = x.w, x.table, x.group, x.local.r, dependence
        equal([groups.split(*args)], [compiled.split(*args)])
    again = x.table[rng.integers(0, len(x.table), 12)], x.w[rng.integers(0, len(x.w), 12)]
    equal(groups.distinct(again[1], again[0], x.group), compiled.distinct(*again[::-1], x.group))


def test_groups_that_become_one_are_all_pairs_of_theirs():
    x = mixture(np.random.default_rng(3), (1, 2), (3, 4))
    row, w, share = compiled.join(x.w, np.zeros(2, np.int64), 100, np.inf)
    expected = sorted((a * b, i, j) for (i, a), (j, b) in product(
        enumerate(x.w[:3, 0]), enumerate(x.w[:4, 1])))[::-1]  # fmt: skip
    np.testing.assert_allclose(w[:, 0], [p for p, _, _ in expected], rtol=1e-12)
    assert row.tolist() == [[i, j] for _, i, j in expected] and share[0] == pytest.approx(1.0)
    assert compiled.join(x.w, np.zeros(2, np.int64), 5, np.inf)[2][0] == pytest.approx(
        sum(p for p, _, _ in expected[:5])
    )


def test_tracks_that_are_independent_part():
    """Two groups made one by the product of their hypotheses are two again, with the same law."""
    for seed in range(10):
        x = bernoulli.prune(mixture(np.random.default_rng(seed), (2, 2), (4, 3)), 0.0, 100)[0]
        into = np.zeros(2, np.int64)
        row, w, _ = compiled.join(x.w, into, 1000, np.inf)
        one = x.rows(row, w, into[x.group], into)
        parted, _ = bernoulli.prune(one, 0.0, 100, 1e-12)
        assert parted.w.shape[1] >= 2
        for c in range(2):
            tracks = np.flatnonzero(x.group == c)
            law = {tuple(r): p for r, p in zip(x.table[:, tracks], x.w[:, c], strict=True) if p}
            # The group may have parted further: by all combinations of the parts'.
            parts = [np.flatnonzero(parted.group == g) for g in np.unique(parted.group[tracks])]
            mine: dict[tuple, float] = {}
            for rows in product(
                *(range((parted.w[:, parted.group[p[0]]] > 0).sum()) for p in parts)
            ):
                picked, weight = np.full(len(x.label), -1), 1.0
                for g, p in zip(rows, parts, strict=True):
                    picked[p] = parted.table[g, p]
                    weight *= parted.w[g, parted.group[p[0]]]
                mine[tuple(picked[tracks])] = mine.get(tuple(picked[tracks]), 0.0) + weight
            assert len(law) <= len(mine)
            np.testing.assert_allclose(sorted(law.values()), sorted(mine.values()), atol=1e-12)


def paths(rng, steps):
    """Two targets that come near each other, two others far away, and clutter around them."""
    starts = np.array([[20.0, 50.0], [30.0, 50.0], [200.0, 30.0], [350.0, 70.0]])
    speed = np.array([[1.5, 0.1], [-1.0, 0.0], [1.0, 1.0], [0.0, -1.0]])
    for k in range(steps):
        seen = rng.random(4) < 0.9
        z = (starts + k * speed + rng.normal(size=(4, 2)))[seen]
        yield np.vstack((z, [[240.0 + 9 * k, 20.0]])) if k % 2 else z


def laws(recording, params):
    """The mixture of labels after every scan: existence, mean and second moment of each track."""
    context, state = Context.of(recording.setup(), params), mbm.init()
    for scan in recording.scans():
        state, _ = mbm.step(state, [scan], context)
        x, a = state.mixture, state.mixture.local
        weight = x.weight() * x.existence()
        second = (a.P + a.m[:, :, None] * a.m[:, None, :]).reshape(-1, 16)
        value = np.column_stack((np.ones(len(a)), a.m, second))
        value = np.vstack((value, np.zeros(21)))[x.table]
        law = np.einsum("gt,gtv->tv", weight, value)
        best = np.sort(x.label[x.table[0] >= 0])
        yield dict(zip(x.label.tolist(), law, strict=True)), mbm._numbers(x), best


def test_groups_are_the_same_as_one_group(make_recording):
    """Nothing cut: law of every track, number of targets and best hypothesis, scan by scan."""
    recording = make_recording(list(paths(np.random.default_rng(1), 4)))
    # Who is farther away than this gate is impossible to the twelfth digit.
    cuts = {**EXACT, "gate": 80.0, "min_existence": 1e-14}
    one, many = (
        laws(recording, mbm.Params(**MODEL, **cuts, backlog=1.0, group_dependence=d))
        for d in (None, 1e-13)
    )
    found = 0
    for (a, numbers, best), (b, numbers_2, best_2) in zip(one, many, strict=True):
        assert numbers["groups"][0] == 1
        found = max(found, numbers_2["groups"][0])
        for label in a:
            np.testing.assert_allclose(a[label], b.get(label, 0 * a[label]), rtol=1e-9, atol=1e-9)
        for name in ("cardinality_mean", "cardinality_variance"):
            assert numbers[name][0] == pytest.approx(numbers_2[name][0], abs=1e-9)
        assert best.tolist() == best_2.tolist()
    assert found >= 3


def test_tracks_of_a_crowd_have_the_marginals_of_all_associations():
    """Each of a row of tracks may have made either detection beside it: sums along the row."""
    T, p = groups.MOST + 5, 0.9
    rng = np.random.default_rng(8)
    r, free, left, right = rng.uniform(0.2, 0.9, T), rng.uniform(1, 2, T + 1), *rng.random((2, T))
    log_hit = np.full((T, T + 1), -np.inf)
    log_hit[np.arange(T), np.arange(T)], log_hit[np.arange(T), np.arange(T) + 1] = (
        np.log(p * left),
        np.log(p * right),
    )
    weight = np.stack((1 - r * p, r * p * left / free[:-1], r * p * right / free[1:]), 1)
    ahead, behind = np.ones((T + 1, 3)), np.ones((T + 1, 3))
    allowed = np.ones((3, 3))
    allowed[2, 1] = 0.0
    for t in range(T):
        ahead[t + 1] = (ahead[t] * weight[t]) @ allowed
        ahead[t + 1] /= ahead[t + 1].sum()
    for t in range(T)[::-1]:
        behind[t] = allowed @ (weight[t] * behind[t + 1])
        behind[t] /= behind[t].sum()
    law = ahead[:-1] * weight * behind[1:]
    law /= law.sum(1, keepdims=True)

    one = np.arange(T)
    local = bernoulli.newborn(r, np.tile(one[:, None] + 0.5, (1, 4)), np.tile(np.eye(4), (T, 1, 1)))
    w, table = np.ones((1, T)), one[None]
    x = bernoulli.Mixture(local, one, local.m, w, table, one, np.zeros((1, T), int), one, one)
    found = bernoulli.associate(x, log_hit, np.full(T, p), np.log(free), 100, np.log(1e12), True)
    assert found.over == 1 and found.loose.all()
    after = bernoulli.missed(local, np.full(T, p)).take(found.prior)
    hit = found.detection >= 0
    after.r[hit], after.m[hit] = 1.0, found.detection[hit, None]
    y = bernoulli.matched(bernoulli.replace(found.mixture, local=after), found.loose)
    gone = (1 - p) * r / (1 - r * p)
    parts = law * np.stack((gone, np.ones(T), np.ones(T)), 1)
    where = np.stack((one + 0.5, one, one + 1.0), 1)
    mean = (parts * where).sum(1) / parts.sum(1)
    spread = (parts * (where - mean[:, None]) ** 2).sum(1) / parts.sum(1)
    picked = y.table[0]
    assert (y.table[1:] < 0).all()
    np.testing.assert_allclose(y.local.r[picked], parts.sum(1), atol=1e-9)
    np.testing.assert_allclose(y.local.m[picked, 0], mean, atol=1e-8)
    np.testing.assert_allclose(y.local.P[picked, 0, 0], 1 + spread, atol=1e-8)
    np.testing.assert_allclose(found.taken[1:-1], law[:-1, 2] + law[1:, 1], atol=1e-9)

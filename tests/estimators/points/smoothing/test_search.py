"""The search for trajectories against enumeration of all of them."""

from itertools import combinations

import numpy as np
import pytest
from scipy.special import logsumexp
from support.births import at_the_first_scan_alone

from echoset.estimators.points import mbm, pmb, search
from echoset.estimators.points.kernels import search as definition
from echoset.estimators.points.kernels.compiled import search as compiled
from echoset.models.errors import ParameterError
from echoset.models.motion import constant_velocity, white_acceleration

P_D, P_S, CLUTTER, AREA = 0.6, 0.9, 1.5, 100.0**2
F, Q = constant_velocity(1.0)[0], 0.3 * white_acceleration(1.0)
BIRTHS = (
    (0.4, 40.0, 40.0, 1.0, 1.0, 3.0, 3.0, 1.0, 1.0),
    (0.3, 40.0, 55.0, 1.0, -1.0, 3.0, 3.0, 1.0, 1.0),
)
BASE = {
    "p_detect": P_D,
    "p_survive": P_S,
    "clutter_rate": CLUTTER,
    "clutter_region": (0.0, 100.0, 0.0, 100.0),
    "std_position": 1.0,
    "birth": "components",
    "birth_components": BIRTHS,
    "acceleration_density": 0.3,
    "smooth": "search",
}


@pytest.fixture(autouse=True)
def first_scan_only(monkeypatch):
    """Births at the first scan alone, so that each first detection is of one component."""
    at_the_first_scan_alone(monkeypatch, mbm)


@pytest.fixture
def seen(make_recording, monkeypatch):
    """What a search is given of a recording."""

    def batch(Z, **changes):
        found = []

        def keep(data, start, rng):
            found.append((data, start))
            return start

        params, recording = mbm.Params(**{**BASE, **changes}), make_recording(Z)
        with monkeypatch.context() as patch:
            patch.setattr(search, "search", keep)
            rng = np.random.default_rng(1)
            list(mbm.estimate(recording.setup(), recording.scans(), params, rng))
        return found[0]

    return batch


def crossing(rng, n):
    """One detection or two a scan of two targets that cross."""
    found = []
    x = [np.array(birth[1:5]) for birth in BIRTHS]
    for k in range(n):
        seen = [m[:2] + rng.normal(size=2) for m in x]
        found.append(np.array(seen if k == 0 else [seen[k % 2]]))
        x = [F @ m + np.linalg.cholesky(Q) @ rng.normal(size=4) for m in x]
    return found


def moments(birth, n):
    """Mean (2 n,) and covariance of all detections of a target that is born in the first scan."""
    means, S = [np.array(birth[1:5])], np.zeros((4 * n, 4 * n))
    S[:4, :4] = np.diag(np.square(birth[5:]))
    for k in range(1, n):
        means.append(F @ means[-1])
        now, before = slice(4 * k, 4 * k + 4), slice(4 * k - 4, 4 * k)
        S[now, : 4 * k] = F @ S[before, : 4 * k]
        S[: 4 * k, now] = S[now, : 4 * k].T
        S[now, now] = F @ S[before, before] @ F.T + Q
    H = np.kron(np.eye(n), np.eye(2, 4))
    return H @ np.concatenate(means), H @ S @ H.T + np.eye(2 * n)


def log_weight(birth, z, times, n):
    """Of a target of a birth that is detected at ``times`` alone, over that of clutter there.

    All times of its death in ``n`` scans are summed.
    """
    m, V = moments(birth, n)
    at = np.ravel([[2 * k, 2 * k + 1] for k in times])
    e, V = np.ravel(z) - m[at], V[np.ix_(at, at)]
    log_l = -0.5 * (e @ np.linalg.solve(V, e) + np.linalg.slogdet(2 * np.pi * V)[1])
    lives = [
        np.log(P_S) * k + np.log(1 - P_D) * (k + 1 - len(times))
        + (np.log(1 - P_S) if k < n - 1 else 0.0)
        for k in range(times[-1], n)
    ]  # fmt: skip
    w = np.log(birth[0]) + np.log(P_D) * len(times) + logsumexp(lives)
    return float(w + log_l - len(times) * np.log(CLUTTER / AREA))


def blocks(Z):
    """Log weights of all trajectories, by which detections they take: numbers with these bits."""
    n, when, z = len(Z), np.repeat(np.arange(len(Z)), [len(z) for z in Z]), np.concatenate(Z)
    found = {}
    for size in range(1, n + 1):
        for some in combinations(range(len(z)), size):
            times = when[list(some)].tolist()
            if len(set(times)) == size:
                key = sum(1 << i for i in some)
                found[key] = logsumexp([log_weight(b, z[list(some)], times, n) for b in BIRTHS])
    return found


def sets(log_w, count):
    """All sets of trajectories that share no detection, and their log weights."""

    def grown(free, own, total):
        yield own, total
        for key in log_w:
            # In rising order of their first bits, so that each set comes once.
            if key & free == key and (not own or key & -key > own[-1] & -own[-1]):
                yield from grown(free & ~key, (*own, key), total + log_w[key])

    return dict(grown((1 << count) - 1, (), 0.0))


def best(log_w, count):
    """The log weight of the best set, detection by detection."""
    top = np.zeros(1 << count)
    for free in range(1, 1 << count):
        first = free & -free
        top[free] = top[free ^ first]
        for key, w in log_w.items():
            if key & first and key & free == key:
                top[free] = max(top[free], w + top[free & ~key])
    return top[-1]


def test_the_weight_of_a_trajectory_is_its_integral(seen):
    """Over the states, and over the time of death."""
    Z = crossing(np.random.default_rng(3), 6)
    data, _ = seen(Z)
    for times in ([0, 2, 4], [0], [0, 4], [0, 2, 4, 5]):
        taken = np.full(6, -1)
        taken[times] = data.offset[:-1][times]
        own = log_weight(BIRTHS[0], data.z[taken[times]], times, 6)
        other = log_weight(BIRTHS[1], data.z[taken[times]], times, 6)
        # The first detection may be of the other one: what it says is of both, by moments.
        assert other < own - 12
        assert compiled.weigh(data, taken).gain.sum() == pytest.approx(own, abs=1e-3)


def test_the_twin_is_the_definition(seen):
    rng = np.random.default_rng(4)
    Z = crossing(rng, 8)
    data, _ = seen(Z, hide_rate=0.2, scene=(0.0, 48.0, 0.0, 100.0))
    data = data._replace(sector=np.tile([0.2, 1.0, 5.0, 65.0], (8, 1)), pose=np.tile(
        [1.0, 2.0, np.cos(0.3), np.sin(0.3)], (8, 1)))  # fmt: skip
    hit = 0
    for _ in range(30):
        taken = np.where(rng.random(8) < 0.6, data.offset[:-1], -1)
        a, b = definition.weigh(data, taken), compiled.weigh(data, taken)
        hit += np.isfinite(a.gain).all() and (a.gain != 0).sum() > 2
        there = a.r != definition.OFF
        assert (there == (b.r != definition.OFF)).all()
        for x, y in zip(a, b, strict=True):
            np.testing.assert_allclose(x[there], y[there], rtol=1e-9, atol=1e-9)
    assert hit


@pytest.mark.parametrize("seed", range(3))
def test_the_search_finds_the_best_of_all_sets(seen, seed):
    """Of ten scans of two targets, from no trajectory and from what the filter kept."""
    Z = crossing(np.random.default_rng(seed), 10)
    data, start = seen(Z)
    top = best(blocks(Z), len(data.z))
    for before in (start, start[:0]):
        found = search.search(data, before, np.random.default_rng(7))
        total = sum(compiled.weigh(data, taken).gain.sum() for taken in found)
        assert total == pytest.approx(top, abs=0.02)


def test_the_moves_keep_the_posterior(seen):
    """How often each set of trajectories of four scans is visited, against enumeration."""
    Z = crossing(np.random.default_rng(11), 4)
    Z = [z + np.random.default_rng(k).normal(size=z.shape) for k, z in enumerate(Z)]
    data, _ = seen(Z)
    found = sets(blocks(Z), len(data.z))
    total = logsumexp(list(found.values()))
    S, N, n = 4, len(data.z), 40_000
    ways, spare = search.places(8, S, N, 4), search.places(2, S, 0, 4)
    rng, top = np.random.default_rng(5), np.full((8, S), -1)
    visits = []
    for _ in range(n):
        compiled.moves(data, ways, spare, top, np.ones(5), rng.random(5 * (8 + 2 * S)))
        own = [sum(1 << int(i) for i in row[row >= 0]) for row in ways.taken if row.max() >= 0]
        visits.append(tuple(sorted(own, key=lambda key: key & -key)))
    likely = sorted(found, key=found.get, reverse=True)[:6]
    assert 0.02 < np.exp(found[likely[1]] - total) < 0.5
    for key in likely:
        hits = np.array([visit == key for visit in visits], float)
        error = hits.reshape(100, -1).mean(1).std(ddof=1) / 10
        assert hits.mean() == pytest.approx(np.exp(found[key] - total), abs=4.5 * error + 1e-3)


def test_one_target_without_clutter_is_the_smoother(make_recording):
    rng, x = np.random.default_rng(8), np.array(BIRTHS[0][1:5])
    Z = []
    for _ in range(12):
        Z.append((x[:2] + rng.normal(size=2))[None])
        x = F @ x + np.linalg.cholesky(Q) @ rng.normal(size=4)
    own = {"birth_components": BIRTHS[:1], "p_detect": 1.0, "p_survive": 1.0, "clutter_rate": 1e-6}
    steps = {}
    for smooth in ("search", "whole"):
        params, recording = mbm.Params(**{**BASE, **own, "smooth": smooth}), make_recording(Z)
        steps[smooth] = list(
            mbm.estimate(recording.setup(), recording.scans(), params, np.random.default_rng(1))
        )
    for a, b in zip(steps["search"], steps["whole"], strict=True):
        assert len(a.objects.label) == 1
        np.testing.assert_allclose(a.objects.state, b.objects.state, atol=1e-9)
        np.testing.assert_allclose(a.objects.covariance, b.objects.covariance, atol=1e-9)


def test_retrodicted_is_straight_back(make_recording):
    """Two scans before the first detection, not three."""
    rng, x = np.random.default_rng(8), np.array([40.0, 40.0, 1.0, 1.0])
    Z = [np.zeros((0, 2))] * 4
    for _ in range(8):
        Z.append((x[:2] + rng.normal(size=2))[None])
        x = F @ x
    changes = {"birth": "detections", "retrodict": 2.0, "clutter_rate": 0.1, "birth_rate": 0.1}
    params, recording = mbm.Params(**{**BASE, **changes}), make_recording(Z)
    steps = list(mbm.estimate(recording.setup(), recording.scans(), params, rng))
    assert [len(one.objects.label) for one in steps] == [0, 0] + [1] * 10
    back = np.linalg.inv(F)
    for k in (3, 2):
        then, now = steps[k + 1].objects, steps[k].objects
        np.testing.assert_allclose(now.state[0], back @ then.state[0], rtol=1e-6)
        P = back @ (then.covariance[0] + Q) @ back.T
        np.testing.assert_allclose(now.covariance[0], P, rtol=1e-5, atol=1e-5)


def test_who_is_lost_is_found(make_recording):
    """A filter gives up two targets that cross and are missed for long; nobody is born later."""
    rng = np.random.default_rng(12)
    states = [np.array([20.0, 20.0, 2.0, 2.0]), np.array([20.0, 80.0, 2.0, -2.0])]
    births = tuple((0.1, *x, 2.0, 2.0, 1.0, 1.0) for x in states)
    Z = []
    for k in range(30):
        seen = [x[:2] + rng.normal(size=2) for x in states]
        Z.append(np.array([z for z in seen if k in (0, 29) or rng.random() < 0.6]))
        states = [F @ x for x in states]
    missing = {}
    for smooth in ("search", "whole"):
        params = mbm.Params(
            **{**BASE, "birth_components": births, "max_coast": 2.5, "smooth": smooth}
        )
        recording = make_recording(Z)
        steps = list(
            mbm.estimate(recording.setup(), recording.scans(), params, np.random.default_rng(1))
        )
        missing[smooth] = sum(2 - len(one.objects.label) for one in steps)
    assert missing["search"] == 0 < missing["whole"]


def test_equal_seeds_give_equal_bytes(make_recording):
    recording = make_recording(crossing(np.random.default_rng(6), 10))
    runs = [
        list(
            mbm.estimate(
                recording.setup(), recording.scans(), mbm.Params(**BASE), np.random.default_rng(3)
            )
        )
        for _ in range(2)
    ]
    for a, b in zip(*runs, strict=True):
        assert a.objects.state.tobytes() == b.objects.state.tobytes()


def test_who_cannot_search_says_so():
    with pytest.raises(ParameterError, match="smooth"):
        pmb.Params(p_detect=0.9, clutter_rate=1.0, smooth="search")
    with pytest.raises(ParameterError, match="poisson"):
        mbm.Params(p_detect=0.9, clutter_rate=1.0, smooth="search", poisson=False)
    with pytest.raises(ParameterError, match="one motion"):
        mbm.Params(p_detect=0.9, clutter_rate=1.0, smooth="search", motion="imm",
                   manoeuvres=((0.1, 0.1),))  # fmt: skip

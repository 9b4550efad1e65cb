"""Several sensors at one time: the posterior of all, whatever their names."""

from dataclasses import replace
from itertools import combinations, permutations, product

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from echoset.estimators.points import mbm, phd
from echoset.estimators.points.kernels.association import marginals

BASE = {
    "p_detect": 0.9,
    "clutter_rate": 2.0,
    "clutter_region": (0.0, 100.0, 0.0, 100.0),
    "std_position": 1.0,
    "birth": "components",
    "gate": 1e9,
}
BIRTHS = (
    (0.8, 30.0, 30.0, 0.0, 0.0, 3.0, 3.0, 1.0, 1.0),
    (0.5, 36.0, 30.0, 0.0, 0.0, 4.0, 3.0, 1.0, 1.0),
)


def together(make_recording, *scans):
    """One time, seen by as many sensors, by names in their order."""
    parts = [make_recording([z]) for z in scans]
    streams = {f"s{k}": p.streams["radar"] for k, p in enumerate(parts)}
    return replace(parts[0], streams=streams)


def run(module, recording, **changes):
    begun = {"poisson": False} if module is mbm else {}
    params = module.Params(**{**BASE, **begun, **changes})
    return list(module.estimate(recording.setup(), recording.scans(), params, None))


def partitions(scans):
    """All ways to group detections, at most one of each scan in a group."""
    if not scans:
        yield []
        return
    *before, last = scans
    for groups in partitions(before):
        for count in range(min(len(groups), last) + 1):
            for z in combinations(range(last), count):
                for to in permutations(range(len(groups)), count):
                    more = [dict(g) for g in groups]
                    for detection, group in zip(z, to, strict=True):
                        more[group][len(before)] = detection
                    alone = [{len(before): i} for i in range(last) if i not in z]
                    yield more + alone


def enumeration(births, scans, region):
    """Mean and variance of the number of targets, and its mean in a box, given a Poisson prior.

    Every group of detections is one target, or, if it is but one, clutter; what none has detected
    stays Poisson.
    """
    kappa, p = 2.0 / 100**2, 0.9
    priors = [(c[0], np.array(c[1:3]), np.diag(np.square(c[5:7]))) for c in births]

    def mass(group):
        """Weight of a group as one target, and its share in the region, by the joint Gaussian."""
        total, inside = 0.0, 0.0
        z = [np.asarray(scans[k][i], float) for k, i in group.items()]
        factor = p ** len(z) * (1 - p) ** (len(scans) - len(z))
        for w, m, P in priors:
            n = len(z)
            H = np.tile(np.eye(2), (n, 1))
            S = H @ P @ H.T + np.eye(2 * n)
            K = P @ H.T @ np.linalg.inv(S)
            q = w * factor
            q *= multivariate_normal.pdf(np.concatenate(z), H @ m, S)
            m, P = m + K @ (np.concatenate(z) - H @ m), P - K @ S @ K.T
            total += q
            inside += q * box(m, P, region)
        return total, inside

    def box(m, P, region):
        x0, x1, y0, y1 = region
        cdf = multivariate_normal(m, P).cdf
        return cdf([x1, y1]) - cdf([x0, y1]) - cdf([x1, y0]) + cdf([x0, y0])

    missed = sum(w for w, _, _ in priors) * (1 - p) ** len(scans)
    missed_in = sum(w * box(m, P, region) for w, m, P in priors) * (1 - p) ** len(scans)
    weights, number, inside = [], [], []
    for groups in partitions([len(z) for z in scans]):
        parts = [(mass(g), kappa if len(g) == 1 else 0.0) for g in groups]
        if min((a + c for (a, _), c in parts), default=1.0) == 0:
            continue
        weights.append(np.prod([a + c for (a, _), c in parts]))
        r = np.array([a / (a + c) for (a, _), c in parts])
        number.append((r.sum(), (r * (1 - r)).sum()))
        inside.append(sum(b / (a + c) for (a, b), c in parts))
    w = np.array(weights) / np.sum(weights)
    n = np.array(number)
    mean = w @ n[:, 0]
    variance = w @ (n[:, 1] + (n[:, 0] - mean) ** 2)
    return mean + missed, variance + missed, w @ np.array(inside) + missed_in


def test_one_detects_and_one_misses(make_recording):
    """A birth of weight 1, seen by one of two: near 1, by either name."""
    birth = (1.0, 50.0, 50.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0)
    region = (0.0, 100.0, 0.0, 100.0)
    found = {}
    for name, scans in (("ab", ([[50, 50]], [])), ("ba", ([], [[50, 50]]))):
        recording = together(make_recording, *scans)
        for module in (phd, mbm):
            changes = {"regions": {"B": region}} if module is phd else {}
            step = run(module, recording, birth_components=(birth,), **changes)[0]
            found[module.__name__, name] = step.steps
        mean, variance, _ = enumeration((birth,), scans, region)
        mine = found[phd.__name__, name]
        assert mine["cardinality_mean"][0] == pytest.approx(mean, rel=1e-6)
        assert mine["cardinality_variance"][0] == pytest.approx(variance, rel=1e-6)
        assert mine["region_mean_B"][0] == pytest.approx(mean, rel=1e-6)
        assert mine["region_variance_B"][0] == pytest.approx(variance, rel=1e-6)
        assert found[mbm.__name__, name]["cardinality_mean"][0] == pytest.approx(1.0, abs=0.02)


SCANS = [[30.5, 30.0], [36.0, 29.0]], [[30.0, 31.0]], [[35.5, 30.0], [70.0, 70.0]]


@pytest.mark.parametrize("count", [1, 2, 3])
def test_the_posterior_of_a_poisson_prior_by_enumeration(make_recording, count):
    region = (0.0, 33.0, 0.0, 100.0)
    scans = [np.array(z) for z in SCANS[:count]]
    mean, variance, inside = enumeration(BIRTHS, scans, region)
    for order in permutations(range(count)):
        recording = together(make_recording, *(scans[k] for k in order))
        s = run(phd, recording, birth_components=BIRTHS, regions={"B": region})[0].steps
        assert s["cardinality_mean"][0] == pytest.approx(mean, rel=0.01)
        assert s["region_mean_B"][0] == pytest.approx(inside, rel=0.02)
        assert s["cardinality_variance"][0] == pytest.approx(variance, abs=0.05)


@pytest.mark.parametrize("module", [phd, mbm])
def test_names_of_sensors_do_not_matter(make_recording, module):
    rng = np.random.default_rng(4)
    scans = [[rng.uniform(0, 100, (4, 2)) for _ in range(3)] for _ in range(8)]
    path = np.array([[20.0, 20.0], [70.0, 40.0]]) + np.arange(8)[:, None, None] * [2.0, 1.0]
    scans = [
        [np.vstack((z, x[rng.random(2) < 0.7] + rng.normal(size=2))) for z in many]
        for many, x in zip(scans, path, strict=True)
    ]
    found = []
    for order in ((0, 1, 2), (2, 0, 1)):
        parts = [make_recording([many[k] for many in scans]).streams["radar"] for k in order]
        recording = replace(make_recording([[]]), streams={f"s{k}": p for k, p in enumerate(parts)})
        model = {"birth": "detections", "birth_rate": 0.1, "p_detect": 0.7, "clutter_rate": 4.0}
        found.append(run(module, recording, gate=30.0, **model))
    for a, b in zip(*found, strict=True):
        assert len(a.objects.label) == len(b.objects.label)
        one, other = (np.sort(s.objects.state[:, 0]) for s in (a, b))
        np.testing.assert_allclose(one, other, atol=0.3)
        mean = [s.steps["cardinality_mean"][0] for s in (a, b)]
        assert mean[0] == pytest.approx(mean[1], abs=0.1)


@pytest.mark.parametrize("module", [phd, mbm])
def test_more_sensors_find_more(make_recording, module):
    """At p_d 0.6 a target is seen by any of K sensors in 1 - 0.4^K of the steps."""
    rng, share = np.random.default_rng(5), {}
    for count in (1, 2, 4):
        streams = {}
        for k in range(count):
            scans = []
            for t in range(60):
                x = np.array([[20.0 + t, 50.0]])[: int(rng.random() < 0.6)]
                scans.append(np.vstack((x + rng.normal(size=x.shape), rng.uniform(0, 100, (2, 2)))))
            streams[f"s{k}"] = make_recording(scans).streams["radar"]
        recording = replace(make_recording([[]]), streams=streams)
        steps = run(module, recording, birth="detections", p_detect=0.6, gate=30.0,
            std_acceleration=0.1, birth_rate=0.05)  # fmt: skip
        hit = [
            len(s.objects.state) > 0
            and np.hypot(*(s.objects.state[:, :2] - (20.0 + t, 50.0)).T).min() < 4
            for t, s in enumerate(steps)
        ]
        share[count] = np.mean(hit[5:])
    assert share[2] >= 0.84 - 0.05 and share[4] >= 0.97 - 0.03


def test_marginals_of_small_problems_by_enumeration():
    """Exact where pairs make no circle; else near."""
    rng = np.random.default_rng(6)
    for pairs, tolerance in (
        ([(0, 0), (0, 1), (1, 1), (1, 2), (2, 2)], 1e-8),
        ([(0, 0), (0, 1), (1, 0), (1, 1)], 0.08),
    ):
        t, z = np.array(pairs).T
        odds = rng.gamma(1.0, 2.0, len(pairs))
        total, found = 0.0, np.zeros(len(pairs))
        for chosen in product([False, True], repeat=len(pairs)):
            on = np.flatnonzero(chosen)
            if len(set(t[on])) == len(set(z[on])) == len(on):
                weight = np.prod(odds[on])
                total += weight
                found[on] += weight
        p, none = marginals(t, z, odds, int(t.max()) + 1, int(z.max()) + 1)
        np.testing.assert_allclose(p, found / total, atol=tolerance)
        np.testing.assert_allclose(np.bincount(t, p) + none, 1.0, rtol=1e-12)

"""What has no effect: the order of rows, names of sensors, one scan or its halves."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from echoset.estimators.points import mbm, phd
from echoset.models.motion import white_acceleration
from echoset.models.radar.detection import View, polar

FILTERS = pytest.mark.parametrize(
    ("module", "changes"),
    [(phd, {}), (mbm, {"poisson": False}), (mbm, {"poisson": True, "backlog": 0.0})],
)
MODEL = {
    "p_detect": 0.8, "clutter_rate": 6.0, "std_range": 1.0, "std_azimuth": 0.01,
    "birth_rate": 0.1, "birth_std_velocity": (3.0, 3.0), "p_survive": 0.99, "gate": 30.0,
    "time_unit": 1.0, "acceleration_density": 0.05,
}  # fmt: skip
VIEW = View(-0.8, 0.8, 0.0, 200.0)
SCANS = 30


def scene(seed):
    """Three targets, one of which crosses the middle of the view, and clutter."""
    rng = np.random.default_rng(seed)
    start = np.array([[60.0, 40.0], [100.0, -30.0], [120.0, -50.0]])
    speed = np.array([[1.0, -0.5], [1.0, 2.0], [-1.0, -0.5]])
    scans = []
    for k in range(SCANS):
        seen = (start + k * speed)[rng.random(3) < 0.8]
        z = np.stack(polar(seen), 1) + rng.normal(size=seen.shape) * (1.0, 0.01)
        false = rng.uniform([0.0, -0.8], [200.0, 0.8], (rng.poisson(6.0), 2))
        scans.append(np.vstack((z, false)))
    return scans, start + np.arange(SCANS)[:, None, None] * speed


def stream(make_recording, scans, view=VIEW):
    bounds = {f"view_{k}": np.full(len(scans), getattr(view, k)) for k in View.__slots__}
    return make_recording(scans, "range_bearing", scan=bounds)


def run(module, recording, **changes):
    params = module.Params(**{**MODEL, **changes})
    return list(module.estimate(recording.setup(), recording.scans(), params, None))


def same(one, other, atol):
    """Whether the estimates of a step are the same set of states."""
    if len(one.objects.label) != len(other.objects.label):
        return False
    a, b = (s.objects.state[np.lexsort(s.objects.state[:, :2].round(1).T)] for s in (one, other))
    return np.allclose(a, b, atol=atol)


@FILTERS
def test_the_order_of_rows(make_recording, module, changes):
    scans, _ = scene(1)
    rng = np.random.default_rng(2)
    plain = run(module, stream(make_recording, scans), **changes)
    for how in (lambda z: rng.permutation(z), lambda z: z[np.argsort(z[:, 1])]):
        other = run(module, stream(make_recording, [how(z) for z in scans]), **changes)
        for a, b in zip(plain, other, strict=True):
            assert same(a, b, 1e-6)
            assert a.steps["cardinality_mean"][0] == pytest.approx(b.steps["cardinality_mean"][0])


def compared(one, other, truth):
    """Share of targets found by each, mean error, and the difference of the stated numbers."""
    found = np.zeros((2, len(truth), truth.shape[1]))
    error = np.full(found.shape, np.nan)
    for i, steps in enumerate((one, other)):
        for k, step in enumerate(steps):
            d = np.hypot(*(step.objects.state[:, None, :2] - truth[k]).transpose(2, 0, 1))
            near = d.min(axis=0, initial=np.inf)
            found[i, k] = near < 8
            error[i, k] = np.where(near < 8, near, np.nan)
    number = [[s.steps["cardinality_mean"][0] for s in steps] for steps in (one, other)]
    return found[:, 5:].mean((1, 2)), np.nanmean(error[:, 5:], (1, 2)), np.mean(number, 1)


@FILTERS
def test_a_view_in_two_halves(make_recording, module, changes):
    """Two sensors of one place that share a view are one: each target is seen as often.

    But for the border between them, where some of a target's mass is in either.
    """
    for seed in (1, 2):
        scans, truth = scene(seed)
        whole = run(module, stream(make_recording, scans), **changes)
        halves = {
            "a": stream(make_recording, [z[z[:, 1] < 0] for z in scans], View(-0.8, 0.0, 0, 200)),
            "b": stream(make_recording, [z[z[:, 1] >= 0] for z in scans], View(0.0, 0.8, 0, 200)),
        }
        streams = {k: r.streams["radar"] for k, r in halves.items()}
        recording = replace(halves["a"], streams=streams)
        parted = run(module, recording, **changes, clutter_rate=3.0)
        share, error, number = compared(whole, parted, truth)
        assert abs(share[0] - share[1]) < 0.06
        assert abs(error[0] - error[1]) < 0.15
        assert abs(number[0] - number[1]) < 0.15
        alike = np.mean([same(a, b, 1.5) for a, b in zip(whole, parted, strict=True)])
        assert alike > 0.7


@FILTERS
def test_detections_shared_out_by_two_sensors_of_one_field(make_recording, module, changes):
    """Two looks at once of all that each sees are no more and no less than both one by one."""
    scans, truth = scene(3)
    more, _ = scene(4)
    names = {}
    for order in ("ab", "ba"):
        parts = [stream(make_recording, z).streams["radar"] for z in (scans, more)]
        recording = stream(make_recording, scans)
        streams = dict(zip(order, parts, strict=True))
        recording = replace(recording, streams={k: streams[k] for k in sorted(streams)})
        names[order] = run(module, recording, **changes)
    share, error, number = compared(names["ab"], names["ba"], truth)
    assert share[0] > 0.93 and abs(share[0] - share[1]) < 0.03
    assert abs(error[0] - error[1]) < 0.05
    assert abs(number[0] - number[1]) < 0.05


@pytest.mark.parametrize("distance", [1.0, 3.0])
@FILTERS
def test_nees_at_the_edge_of_the_view(make_recording, module, changes, distance):
    """One that moves inwards beside the border: as sure as it may be, in its 99 % band."""
    edge, runs, total = 0.6, 60, 0.0
    rng, view = np.random.default_rng(9), View(-edge, edge, 0.0, 300.0)
    along = np.array([np.cos(edge), np.sin(edge)])
    for _ in range(runs):
        start = 100.0 * along + distance * np.array([along[1], -along[0]])
        x = np.concatenate((start, 3.0 * along))
        birth = (1.0, *x, 1e-3, 1e-3, 1e-3, 1e-3)
        scans = [polar(x[None, :2])]
        for _ in range(5):
            noise = rng.multivariate_normal(np.zeros(4), 0.02 * white_acceleration(1.0))
            x = np.concatenate((x[:2] + x[2:], x[2:])) + noise
            h = np.stack(polar(x[None, :2]), 1)
            scans.append(h + rng.normal(size=(1, 2)) * (1.0, 0.01))
        scans[0] = np.stack(scans[0], 1) + rng.normal(size=(1, 2)) * (1.0, 0.01)
        model = {"p_detect": 0.95, "clutter_rate": 1e-9, "p_survive": 1.0, "gate": 1e9,
                 "birth": "components", "birth_components": (birth,), "time_unit": 1e9,
                 "acceleration_density": 0.02}  # fmt: skip
        last = run(module, stream(make_recording, scans, view), **model, **changes)[-1].objects
        best = last.existence.argmax()
        e = last.state[best] - x
        total += e @ np.linalg.solve(last.covariance[best], e)
    low, high = chi2.ppf([0.005, 0.995], 4 * runs)
    assert low < total < high

"""Births, survival and motion over time, at any rate of scans: closed forms and NEES."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from echoset.estimators.points import mbm, phd
from echoset.estimators.points.context import Context
from echoset.estimators.points.model.targets import (
    Interval,
    TargetParams,
    elapse,
    newborn,
    settled,
)
from echoset.models.motion import white_acceleration

SECOND = 10**9
BASE = {
    "p_detect": 0.9,
    "clutter_rate": 1.0,
    "clutter_region": (-500.0, 500.0, -500.0, 500.0),
    "std_position": 1.0,
    "gate": 50.0,
}
FILTERS = pytest.mark.parametrize(
    ("module", "changes"), [(phd, {}), (mbm, {"poisson": False}), (mbm, {"poisson": True})]
)


def run(module, recording, **changes):
    params = module.Params(**{**BASE, **changes})
    return list(module.estimate(recording.setup(), recording.scans(), params, None))


def at_times(make_recording, seconds, scans):
    found = make_recording(scans)
    time_ns = np.rint(np.asarray(seconds) * SECOND).astype(np.int64)
    return replace(found, streams={"radar": replace(found.streams["radar"], time_ns=time_ns)})


def test_white_acceleration_adds_the_same_in_one_step_or_many():
    F = np.eye(4) + 0.3 * np.eye(4, k=2)
    parts = F @ white_acceleration(0.2) @ F.T + white_acceleration(0.3)
    np.testing.assert_allclose(parts, white_acceleration(0.5), rtol=1e-12)


@pytest.mark.parametrize("steps", [0.5, 1.0, 7.0, 12.5, 3600.0])
def test_births_in_a_gap_are_as_many_as_are_alive(steps):
    """b (1 - p^n) / (1 - p), and their spread is that of their ages, by sampling."""
    c = (0.01, 5.0, 6.0, 1.0, 0.0, 2.0, 2.0, 3.0, 1.0)
    params = TargetParams(birth="components", birth_components=(c,), p_survive=0.99, time_unit=1.0,
        std_acceleration=0.0, diffusion=0.0)  # fmt: skip
    w, m, P = newborn(params, elapse(params, 0, round(steps * SECOND)))
    assert w.sum() == pytest.approx(0.01 * (1 - 0.99**steps) / 0.01)
    if steps > 1:
        rng = np.random.default_rng(1)
        n = int(np.ceil(steps))
        stop = np.minimum(np.arange(n) + 1, steps)
        alive = 0.99 ** np.arange(n) - 0.99**stop
        age = rng.choice(n, 200_000, p=alive / alive.sum())
        v = 1.0 + 3.0 * rng.normal(size=len(age))
        x = 5.0 + 2.0 * rng.normal(size=len(age)) + v * age
        mean = w @ m[:, 0] / w.sum()
        var = w @ (P[:, 0, 0] + (m[:, 0] - mean) ** 2) / w.sum()
        assert mean == pytest.approx(x.mean(), abs=5 * x.std() / len(x) ** 0.5 + 0.002 * x.std())
        assert var == pytest.approx(x.var(), rel=0.03)


@FILTERS
def test_no_target_exists_more_than_once_after_a_gap(make_recording, module, changes):
    birth = (0.2, 0.0, 0.0, 0.0, 0.0, 30.0, 30.0, 2.0, 2.0)
    z = [[[0.0, 0.0]]] * 3 + [[[20.0, 0.0]], [[21.0, 0.0]]]
    recording = at_times(make_recording, [0, 1, 2, 14, 15], z)
    for born in ({"birth": "detections", "birth_rate": 0.2},
                 {"birth": "components", "birth_components": (birth,)}):  # fmt: skip
        for step in run(module, recording, time_unit=1.0, **born, **changes):
            assert (step.objects.existence <= 1).all()
            assert 0 <= step.steps["cardinality_mean"][0] < 4


def test_births_at_detections_are_those_of_the_gap_before(make_recording):
    """Ten steps before the second scan, one after it."""
    recording = at_times(make_recording, [0, 10, 11], [[], [[0.0, 0.0]], []])
    params = phd.Params(**BASE, birth_rate=0.02, time_unit=1.0, p_survive=0.9)
    context, state = Context.of(recording.setup(), params), phd.init()
    waiting = []
    for scan in recording.scans():
        state, _ = phd.step(state, [scan], context)
        waiting.append(state.waiting[0].sum())
    assert waiting[1] == pytest.approx(0.02 * (1 - 0.9**10) / (1 - 0.9))


@pytest.mark.parametrize(("module", "changes"), [(phd, {}), (mbm, {"poisson": False})])
def test_sensors_of_one_time_share_the_births(make_recording, module, changes):
    one = make_recording([[[0.0, 0.0], [100.0, 0.0]]])
    for count in (1, 3):
        streams = {f"s{k}": one.streams["radar"] for k in range(count)}
        recording = replace(one, streams=streams)
        params = module.Params(**BASE, birth_rate=0.2, **changes)
        context = module.Context.of(recording.setup(), params)
        state, _ = module.step(module.init(), recording.scans(), context)
        assert state.waiting[0].sum() == pytest.approx(0.2)


def test_several_streams_share_no_step(make_recording):
    one = make_recording([[]])
    both = replace(one, streams=dict.fromkeys("ab", one.streams["radar"]))
    params = phd.Params(**BASE, std_acceleration=2.0)
    alone, joint = settled(params, one), settled(params, both)
    assert (alone.time_unit, alone.acceleration_density) == (0.0, 0.0)
    assert (joint.time_unit, joint.acceleration_density) == (1.0, 4.0)


@pytest.mark.parametrize("together", [False, True])
@pytest.mark.parametrize("count", [1, 2, 4])
@FILTERS
def test_nees_of_radars_in_turn_and_together(make_recording, module, changes, count, together):
    """White acceleration of density 1: the sum of NEES over runs, one step each, is chi-square."""
    rng, total, n = np.random.default_rng(7), 0.0, 0
    for _ in range(60):
        steps, period = 8, 1.0
        offset = [0.0] * count if together else np.arange(count) * period / count
        times = np.add.outer(np.arange(steps) * period, offset)
        x, now, states = np.array([0.0, 0.0, 3.0, -2.0]), 0.0, np.zeros((steps, count, 4))
        for k, j in np.ndindex(steps, count):
            dt, now = times[k, j] - now, times[k, j]
            noise = rng.multivariate_normal(np.zeros(4), white_acceleration(dt)) if dt else 0.0
            x = np.concatenate((x[:2] + dt * x[2:], x[2:])) + noise
            states[k, j] = x
        streams = {}
        for j in range(count):
            z = states[:, j, :2] + rng.normal(size=(steps, 2))
            found = at_times(make_recording, times[:, j], z[:, None])
            streams[f"s{j}"] = found.streams["radar"]
        recording = replace(found, streams=streams)
        birth = (1.0, 0.0, 0.0, 3.0, -2.0, 1e-3, 1e-3, 1e-3, 1e-3)
        model = {"p_detect": 1.0, "clutter_rate": 1e-9, "p_survive": 1.0, "birth": "components",
                 "birth_components": (birth,), "time_unit": 1e9, "gate": 1e9}  # fmt: skip
        if count == 1:
            model["acceleration_density"] = 1.0
        last = run(module, recording, **model, **changes)[-1].objects
        best = last.existence.argmax()
        e = last.state[best] - states[-1, -1]
        total += e @ np.linalg.solve(last.covariance[best], e)
        n += 4
    low, high = chi2.ppf([0.001, 0.999], n)
    assert low < total < high


@FILTERS
def test_a_pause_of_a_day_ends_tracks_and_keeps_covariances_positive(
    make_recording, module, changes
):
    z = [[[float(k), 0.0]] for k in range(4)]
    recording = at_times(make_recording, [0, 1, 2, 100_000], z)
    for unit in (0.0, 1.0):
        for step in run(module, recording, birth="detections", time_unit=unit, **changes):
            P = step.objects.covariance
            assert (np.linalg.eigvalsh(P) > 0).all() and np.isfinite(P).all()
            assert np.sqrt(P[:, 0, 0]).max(initial=0) < 1e6


def test_an_interval_of_nothing_changes_nothing():
    params = TargetParams(p_survive=0.5, time_unit=1.0, std_acceleration=3.0)
    gone = elapse(params, 5, 5)
    assert isinstance(gone, Interval) and gone.steps == 0
    np.testing.assert_array_equal(gone.F, np.eye(4))
    np.testing.assert_array_equal(gone.survival(params, np.zeros((2, 4))), [1.0, 1.0])
    assert len(newborn(params, gone)[0]) == 0

"""True and estimated sets at the same times, numbers of objects, and means with standard errors."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from echoset.metrics import cardinality
from echoset.metrics.kit.alignment import Scored
from echoset.metrics.kit.series import mean_stderr
from echoset.metrics.kit.sets import sets
from echoset.models.errors import InputError
from echoset.models.records import Objects, Truth

SECOND = 10**9
TRUTH = [{1: (0.0, 0.0), 2: (5.0, 5.0)}, {2: (6.0, 7.0), 3: (9.0, 9.0)}, {}, {3: (1.0, 1.0)}]


def at(estimates, times):
    """The estimates at other times [s]."""
    time = np.round(np.asarray(times) * 1e9).astype(np.int64)
    return replace(estimates, objects=replace(estimates.objects, time_ns=time))


def test_between_two_times_stand_the_objects_of_both(scene):
    estimates, recording = scene(TRUTH, [{}] * 6)
    times = [0.0, 0.25, 1.0, 1.5, 2.0, 2.5]
    aligned = sets(at(estimates, times), recording, Scored())
    truth = aligned.truth
    assert np.split(truth.label, truth.row_offset[1:-1])[0].tolist() == [1, 2]
    assert aligned.counts[0].tolist() == [2, 1, 2, 0, 0, 0]
    np.testing.assert_allclose(aligned.position_truth[2], [5.25, 5.5], rtol=1e-15)
    assert truth.label[2:5].tolist() == [2, 2, 3]
    assert aligned.time.tolist() == times and aligned.left_out == 0


def test_steps_without_truth_are_left_out_and_counted(scene):
    estimates, recording = scene(TRUTH, [{4: (0.0, k)} for k in range(5)])
    aligned = sets(at(estimates, [-1.0, 0.0, 0.5, 3.0, 3.5]), recording, Scored(max_gap=0.9))
    assert aligned.time.tolist() == [0.0, 3.0] and aligned.left_out == 3
    assert aligned.steps.tolist() == [1, 3]
    assert aligned.position_estimate.tolist() == [[0, 1], [0, 3]]
    later = sets(at(estimates, range(5)), recording, Scored(start=1.0, stop=2.0))
    assert later.time.tolist() == [1.0, 2.0] and later.left_out == 0


def test_what_cannot_be_scored(scene):
    estimates, recording = scene([{}], [{}])
    assert sets(estimates, recording, Scored()).counts[0].tolist() == [0]
    with pytest.raises(InputError, match="no truth"):
        sets(estimates, replace(recording, truth=None), Scored())
    with pytest.raises(InputError, match="no step"):
        sets(at(estimates, [7.0]), recording, Scored())
    none, _ = scene([], [])
    with pytest.raises(InputError, match="no step"):
        sets(none, recording, Scored())
    renamed = replace(estimates.objects, state_names=("x", "depth"))
    with pytest.raises(InputError, match="x y"):
        sets(replace(estimates, objects=renamed), recording, Scored())


def test_cardinality(scene):
    estimates, recording = scene(TRUTH, [{}, {1: (0.0, 0.0)}, {1: (0.0, 0.0)}, {}])
    mean = np.array([2.5, 1.5, 0.5, 0.5])
    estimates = replace(estimates, steps={"cardinality_mean": mean})
    scores = cardinality.METRIC.score(estimates, recording, cardinality.METRIC.Params(skip=1))
    rows = zip(scores.metric, scores.part, scores.time, scores.value, strict=True)
    found = {(m, p): v for m, p, t, v in rows if np.isnan(t)}
    assert found["cardinality", "true"] == 1.0
    assert found["cardinality", "estimated"] == pytest.approx(2 / 3)
    assert found["cardinality", "error"] == pytest.approx(-1 / 3)
    assert found["cardinality-absolute", "error"] == pytest.approx(1.0)
    assert found["cardinality", "mean-error"] == pytest.approx((-0.5 + 0.5 - 0.5) / 3)
    assert found["cardinality-absolute", "mean-error"] == pytest.approx(0.5)


def test_standard_error_is_that_over_all_choices_of_blocks():
    values = np.random.default_rng(9).normal(size=6)
    circle = np.concatenate((values, values))
    means = [np.mean([circle[s : s + 2] for s in starts]) for starts in product(range(6), repeat=3)]
    assert mean_stderr(values, 2) == pytest.approx(np.std(means), rel=1e-13)
    assert mean_stderr(values, 1) == pytest.approx(np.std(values) / np.sqrt(6), rel=1e-13)
    assert np.isnan(mean_stderr(values, 0)) and np.isnan(mean_stderr(values, 4))


def own_times(seconds: float) -> Objects:
    """Three objects on lines, each seen every second at ``k`` thirds of it: (label, t)."""
    label = np.arange(3 * seconds) % 3
    time = np.arange(3 * seconds) * SECOND // 3
    state = np.stack((label.astype(float), time / SECOND), 1)
    offset = np.arange(len(time) + 1)
    return Objects(time.astype(np.int64), offset, label, ("x", "y"), ("m", "m"), state)


def test_objects_with_times_of_their_own_are_all_there(scene):
    estimates, recording = scene([{}], [{}] * 9)
    recording = replace(recording, truth=Truth(own_times(10)))
    times = np.linspace(1.0, 8.9, 9)
    aligned = sets(at(estimates, times), recording, Scored())
    assert aligned.counts[0].tolist() == [3] * 9 and aligned.left_out == 0
    assert sorted(aligned.truth.label[:3]) == [0, 1, 2]
    np.testing.assert_allclose(aligned.position_truth[:, 1], np.repeat(aligned.time, 3), rtol=1e-9)


def test_gap_follows_from_the_rate_of_the_reference(scene):
    rng = np.random.default_rng(4)
    estimates, recording = scene([{1: (0.0, 0.0)}] * 400, [{}] * 390)
    truth = recording.truth.objects
    jitter = np.round(rng.normal(0, 3e6, 400)).astype(np.int64)
    recording = replace(recording, truth=Truth(replace(truth, time_ns=truth.time_ns + jitter)))
    aligned = sets(at(estimates, np.arange(390) + 0.5), recording, Scored())
    assert aligned.left_out == 0 and (aligned.counts[0] == 1).all()
    slow = replace(truth, time_ns=truth.time_ns * 10 + jitter)
    recording = replace(recording, truth=Truth(slow))
    assert sets(at(estimates, np.arange(390) + 0.5), recording, Scored()).left_out == 0


def test_hole_in_the_life_of_an_object_is_no_interval(scene):
    steps = [{1: (0.0, 0.0), 2: (1.0, float(k))} if k != 5 else {1: (0.0, 0.0)} for k in range(12)]
    estimates, recording = scene(steps, [{}] * 4)
    aligned = sets(at(estimates, [3.5, 4.5, 5.0, 5.5]), recording, Scored())
    assert aligned.counts[0].tolist() == [2, 1, 1, 1]
    own = Scored(max_gap=2.0, own_times=True)
    bridged = sets(at(estimates, [3.5, 4.5, 5.0, 5.5]), recording, own)
    assert bridged.counts[0].tolist() == [2, 2, 2, 2]
    np.testing.assert_allclose(bridged.position_truth[3], [1.0, 4.5])

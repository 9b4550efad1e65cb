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

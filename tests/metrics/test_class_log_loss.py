"""The logarithmic score of classes, by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from echoset.metrics.accuracy import LEAST, LOG_LOSS
from echoset.models.errors import InputError

TRUTH = [{1: (0.0, 0.0), 2: (20.0, 0.0)}] * 2
SEEN = [{1: (1.0, 0.0), 2: (21.0, 0.0), 3: (50.0, 0.0)}, {1: (1.0, 0.0), 2: (26.0, 0.0)}]
P = np.array([[0.8, 0.2], [0.7, 0.3], [0.1, 0.9], [0.0, 1.0], [0.5, 0.5]])


def classed(record, index, names=("pedestrian", "vehicle"), p=None):
    return replace(
        record, class_names=names, class_index=np.array(index, np.int64), class_probability=p
    )


@pytest.fixture
def pair(scene):
    estimates, recording = scene(TRUTH, SEEN)
    truth = replace(recording.truth, objects=classed(recording.truth.objects, [0, 1, 0, 1]))
    return estimates, replace(recording, truth=truth)


def score(pair, p, names=("pedestrian", "vehicle")):
    estimates, recording = pair
    objects = classed(estimates.objects, p.argmax(1), names, p)
    found = LOG_LOSS.score(replace(estimates, objects=objects), recording, LOG_LOSS.Params())
    return found, found.value[np.isnan(found.time)].tolist()


def test_by_hand(pair):
    """A pedestrian at 0.8 and a vehicle at 0.3; then one at 0; the far one is left out."""
    scores, (mean,) = score(pair, P)
    assert mean == pytest.approx(-(np.log(0.8) + np.log(0.3) + np.log(LEAST)) / 3)
    assert scores.n[np.isnan(scores.time)].tolist() == [3]
    np.testing.assert_allclose(
        scores.value[~np.isnan(scores.time)],
        [-(np.log(0.8) + np.log(0.3)) / 2, -np.log(LEAST)],
    )


def test_saying_nothing_is_log_two(pair):
    assert score(pair, np.full((5, 2), 0.5))[1] == pytest.approx([np.log(2)])


def test_classes_are_compared_by_name(pair):
    names = ("dog", "vehicle", "pedestrian")
    other = np.column_stack((np.zeros(5), P[:, 1], P[:, 0]))
    assert score(pair, other, names)[1] == pytest.approx(score(pair, P)[1])


def test_without_probabilities(pair):
    estimates, recording = pair
    objects = classed(estimates.objects, [0, 0, 1, 0, 1])
    with pytest.raises(InputError, match="the estimates have no probabilities of classes"):
        LOG_LOSS.score(replace(estimates, objects=objects), recording, LOG_LOSS.Params())

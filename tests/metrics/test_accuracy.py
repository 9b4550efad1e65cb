"""Classes of estimates against those of the objects they are assigned to, counted by hand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from echoset.metrics import accuracy, capacity
from echoset.models.errors import InputError
from echoset.models.radar.multibeam import BaseStation
from echoset.models.records import Sensor, Stream

NAMES = ("pedestrian", "vehicle")
TRUTH = [{1: (0.0, 0.0), 2: (20.0, 0.0)}] * 2
SEEN = [{1: (1.0, 0.0), 2: (21.0, 0.0), 3: (50.0, 0.0)}, {1: (1.0, 0.0), 2: (26.0, 0.0)}]


def classed(record, index, names=NAMES):
    return replace(record, class_names=names, class_index=np.array(index, np.int64))


@pytest.fixture
def pair(scene):
    estimates, recording = scene(TRUTH, SEEN)
    truth = replace(recording.truth, objects=classed(recording.truth.objects, [0, 1, 0, 1]))
    return estimates, replace(recording, truth=truth)


def values(scores):
    rows = zip(scores.metric, scores.part, scores.time, scores.value, scores.n, strict=True)
    return {(m, p): (v, n) for m, p, t, v, n in rows if np.isnan(t)}


def test_shares_by_hand(pair):
    estimates, recording = pair
    # Rows of step 1: a right pedestrian, a vehicle called pedestrian, a false one; step 2: a right
    # pedestrian, and a vehicle that is 6 m off: not assigned.
    estimates = replace(estimates, objects=classed(estimates.objects, [0, 0, 1, 0, 1]))
    found = values(accuracy.METRIC.score(estimates, recording, accuracy.METRIC.Params()))
    assert found["accuracy", ""] == (pytest.approx(2 / 3), 3)
    assert found["confusion", "pedestrian:pedestrian"] == (1.0, 2)
    assert found["confusion", "vehicle:pedestrian"] == (1.0, 1)
    assert found["confusion", "vehicle:vehicle"] == (0.0, 1)
    assert found["accuracy-unassigned", "missed"][0] == 0.5
    assert found["accuracy-unassigned", "false"][0] == 1.0


def test_classes_are_compared_by_name(pair):
    estimates, recording = pair
    other = classed(estimates.objects, [1, 0, 0, 1, 0], ("vehicle", "pedestrian", "dog"))
    found = values(
        accuracy.METRIC.score(
            replace(estimates, objects=other), recording, accuracy.METRIC.Params()
        )
    )
    assert found["accuracy", ""] == (1.0, 3)
    dog = classed(estimates.objects, [2, 0, 0, 1, 0], ("vehicle", "pedestrian", "dog"))
    found = values(
        accuracy.METRIC.score(replace(estimates, objects=dog), recording, accuracy.METRIC.Params())
    )
    assert found["confusion", "pedestrian:other"] == (0.5, 2)


def test_without_classes(pair):
    estimates, recording = pair
    with pytest.raises(InputError, match="the estimates have no classes"):
        accuracy.METRIC.score(estimates, recording, accuracy.METRIC.Params())


def test_capacity_counts_the_stations_used(pair):
    estimates, recording = pair
    station = BaseStation()
    model = {k: getattr(station, k) for k in BaseStation.__match_args__}
    none = np.zeros(0, np.int64)
    stream = Stream("range_angle_map", ("S",), model, none, np.zeros(1, np.int64), {}, {})
    sensors = {"S": Sensor.static("radar", np.zeros(2))}
    recording = replace(recording, sensors=sensors, streams={f"S{k}": stream for k in range(6)})
    provenance = {**estimates.meta.provenance, "parameters": {"stations": 3}}
    three = replace(estimates, meta=replace(estimates.meta, provenance=provenance))
    found = [
        capacity.METRIC.score(e, recording, capacity.METRIC.Params()).value[0]
        for e in (estimates, three)
    ]
    by_hand = 380.16e6 * np.log2(1 + np.array([0.7, 1.0]) * 10**0.81)
    assert found == pytest.approx([by_hand[0], by_hand.mean()], rel=1e-12)


def test_capacity_needs_maps(pair):
    with pytest.raises(InputError, match="no station"):
        capacity.METRIC.score(*pair, capacity.METRIC.Params())

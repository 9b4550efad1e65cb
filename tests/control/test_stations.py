"""Conditions over shared soft maps, and what the truth in place of a part changes."""

from dataclasses import replace

import numpy as np
import pytest

import echoset
from echoset.campaign.scenarios import find
from echoset.control import stations
from echoset.control.stations import REPLACED, Condition
from echoset.formats.windows import concatenate
from echoset.models.parameters import resolve
from echoset.models.random import generator
from echoset.simulate import jsc

SCANS = 24


@pytest.fixture(scope="module")
def recording():
    params = resolve(jsc.Params, *find("jsc-6bs").layers, ("here", {"scans": SCANS}))
    return jsc.simulate(params, generator(11, "simulate", "few"), "few")


@pytest.fixture(scope="module")
def soft(recording):
    return stations.soft_maps(recording, Condition("phd", "tuned", "adaptive", 6).params(recording))


def joined(steps):
    return replace(concatenate(steps), meta=steps[0].meta)


def error(estimates, recording):
    scores = echoset.score(estimates, recording, "ospa-normalised", start=0.55)
    return scores.value[np.isnan(scores.time)][0]


def test_there_are_the_36_conditions_of_figure_3():
    found = list(stations.conditions("tuned"))
    assert len({c.name for c in found}) == len(found) == 36
    assert [c.stations for c in found] == sorted(c.stations for c in found)


@pytest.mark.parametrize("name", ["phd", "mbm"])
def test_a_condition_is_what_the_command_does(name, recording, soft):
    condition = Condition(name, "tuned", "4", 6)
    mine = joined(stations.estimate(recording, condition, soft)).objects
    preset = stations.FILTERS[name].PRESETS["tuned"]
    both = {"gate_pedestrian": 4.0, "gate_vehicle": 4.0, "stations": 6}
    theirs = echoset.estimate(recording, name, **{**preset, **both}).objects
    np.testing.assert_array_equal(mine.row_offset, theirs.row_offset)
    np.testing.assert_array_equal(mine.state, theirs.state)
    np.testing.assert_array_equal(mine.class_index, theirs.class_index)


@pytest.mark.parametrize("part", REPLACED[1:])
def test_the_truth_stands_in_for_a_part(part, recording, soft):
    condition = Condition("mbm", "tuned", "adaptive", 6)
    found = joined(stations.without(recording, condition, soft, part))
    assert len(found.objects.time_ns) == SCANS
    if part in ("clustering", "tracking"):
        assert error(found, recording) < 0.8
    if part == "identification":
        scores = echoset.score(found, recording, "accuracy", start=0.55)
        aggregate = [
            v
            for m, p, t, v in zip(
                scores.metric, scores.part, scores.time, scores.value, strict=True
            )
            if (m, p) == ("accuracy", "") and np.isnan(t)
        ]
        assert aggregate[0] > 0.9


def test_track_before_detect_is_what_the_command_does(recording):
    mine = joined(stations.before_detection(recording, 3))
    theirs = echoset.estimate(recording, "tbd", stations=3)
    np.testing.assert_array_equal(mine.objects.state, theirs.objects.state)
    assert mine.meta.provenance["estimator"] == "tbd 3"
    assert error(mine, recording) < 0.5
    later = joined(stations.before_detection(recording, 3, "whole"))
    assert later.meta.provenance["estimator"] == "tbd smooth 3"
    assert error(later, recording) < 0.5


def test_templates_are_what_the_command_does(recording):
    mine = joined(stations.alone(recording, Condition("mbm", "templates", "adaptive", 3)))
    theirs = echoset.estimate(recording, "mbm", stations=3)
    np.testing.assert_array_equal(mine.objects.state, theirs.objects.state)
    assert mine.meta.provenance["estimator"] == "mbm templates adaptive 3"

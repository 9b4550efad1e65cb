"""What is learnt of sensors, on scenes where it is known."""

import logging
from dataclasses import replace

import numpy as np
import pytest

from echoset.estimators.points import learn as module
from echoset.estimators.points import pmb_filter
from echoset.estimators.run import Estimation
from echoset.models.records import Meta, Recording, Sensor, Stream

SECOND = 10**9
SIDE = 300.0
GUESS = {
    "p_detect": 0.9, "clutter_rate": 3.0, "std_position": 2.0, "acceleration_density": 0.05,
    "clutter_region": [-SIDE, SIDE, -SIDE, SIDE], "birth_std_velocity": [8.0, 8.0],
    "time_unit": 1.0, "birth_rate": 0.05,
}  # fmt: skip


def scene(seed=1, seconds=60.0, targets=6, **b):
    """Two radars over targets that go straight; of ``b`` what is given differs."""
    rng = np.random.default_rng(seed)
    start, v = rng.uniform(-150, 150, (targets, 2)), rng.normal(size=(targets, 2)) * 4
    sensors, streams = {}, {}
    for name, own in (("a", {}), ("b", b)):
        own = {"latency": 0.0, "registration": (0.0, 0.0), "p_detect": 0.9, "clutter": 3.0,
               "std": 2.0, **own}  # fmt: skip
        time = np.arange(0.3 if name == "b" else 0.0, seconds, 1.0)
        scans = []
        for t in time - own["latency"]:
            x = (start + t * v)[rng.random(targets) < own["p_detect"]]
            x = x + own["registration"] + own["std"] * rng.normal(size=x.shape)
            scans.append(np.vstack((x, rng.uniform(-SIDE, SIDE, (rng.poisson(own["clutter"]), 2)))))
        rows = dict(zip("xy", np.concatenate(scans).T.copy(), strict=True))
        offset = np.cumsum([0, *map(len, scans)])
        stamps = np.rint(time * SECOND).astype(np.int64)
        streams[name] = Stream("position", (name,), {}, stamps, offset, {}, rows)
        sensors[name] = Sensor.static("radar", np.zeros(2))
    return Recording(Meta("two"), sensors, streams)


def found(recording, *what, **guess):
    asked = Estimation("pmb", (("here", {**GUESS, "learn": list(what), **guess}),))
    run = asked.on(recording.setup(), "two")
    list(run.steps(recording.scans()))
    return run.found


def test_the_evidence_is_that_of_a_poisson_process_of_the_known(make_recording):
    """One target, a detection of it and one of clutter."""
    recording = make_recording([[[1.0, 2.0], [50.0, 50.0]]])
    params = pmb_filter.Params(
        p_detect=0.9, clutter_rate=2.0, clutter_region=(-100.0, 100.0, -100.0, 100.0),
        std_position=1.0, birth_rate=0.0, gate=1e9,
    )  # fmt: skip
    state = pmb_filter.init(params)
    known = pmb_filter.Tracks(
        np.zeros(1, np.int64), np.array([0.8]), np.zeros((1, 4)), 3.0 * np.eye(4)[None]
    )
    context = module.Context.of(recording.setup(), params)
    state, _ = module.step(replace(state, tracks=known), list(recording.scans()), context)
    # The first scan is a step, in which the target survives and has no time to move.
    r, clutter = 0.8 * 0.99, 2.0 / 200**2
    l = np.exp(-np.array([5.0, 5000.0]) / 8) / (2 * np.pi * 4)
    expected = np.log(clutter + r * 0.9 * l).sum() - r * 0.9 - 2.0
    assert state.evidence == pytest.approx(expected, abs=1e-9)


def test_a_latency_and_offsets_are_found():
    got = found(scene(latency=1.4, registration=(4.0, -3.0)), "latency", "registration")
    assert got["b.latency"] == pytest.approx(1.4, abs=0.15)
    assert got["b.registration"] == pytest.approx((4.0, -3.0), abs=1.0)
    assert got["evidence_gained"] > 50
    assert got.keys() == {"b.latency", "b.registration", "evidence_gained"}


def test_who_is_less_late_makes_the_other_late():
    got = found(scene(latency=-1.2), "latency")
    assert got["a.latency"] == pytest.approx(1.2, abs=0.15) and "b.latency" not in got


def test_rates_and_accuracy_are_found():
    truth = {"p_detect": 0.6, "clutter": 8.0, "std": 4.0}
    got = found(scene(**truth, seconds=40.0), "p_detect", "clutter_rate", "accuracy")
    # 40 scans of 6 targets.
    assert got["b.p_detect"] == pytest.approx(0.6, abs=4.5 * np.sqrt(0.6 * 0.4 / 240))
    assert got["b.clutter_rate"] == pytest.approx(8.0, rel=4.5 / np.sqrt(8 * 40) + 0.05)
    assert got["b.std_position"] == pytest.approx(4.0, rel=4.5 / np.sqrt(2 * 2 * 144) + 0.05)


def test_what_is_right_stays():
    assert found(scene(seed=4), "latency", "registration") == {}


def test_one_sensor_has_nothing_to_be_late_against(caplog):
    recording = scene()
    alone = replace(recording, streams={"a": recording.streams["a"]})
    with caplog.at_level(logging.WARNING):
        assert found(alone, "latency") == {}
    assert "latency and registration are not learnt" in caplog.text


def test_estimates_are_those_of_what_was_learnt():
    recording = scene(latency=1.5, seconds=30.0)
    asked = Estimation("pmb", (("here", {**GUESS, "learn": ["latency"], "learn_span": 20.0}),))
    run = asked.on(recording.setup(), "two")
    steps = list(run.steps(recording.scans()))
    told = {**GUESS, "sensors": {"b": {"latency": run.found["b.latency"]}}}
    other = Estimation("pmb", (("here", told),)).on(recording.setup(), "two")
    for a, b in zip(steps, other.steps(recording.scans()), strict=True):
        np.testing.assert_array_equal(a.objects.state, b.objects.state)


@pytest.mark.parametrize(("rate", "guess"), [(0.4, 0.05), (0.1, 1.0)])
def test_how_often_targets_appear_is_found(make_recording, rate, guess):
    """Of a Poisson process, to what the number that appeared tells of its rate."""
    rng = np.random.default_rng(3)
    begin = np.sort(rng.uniform(0, 100, rng.poisson(rate * 100)))
    life = rng.exponential(20.0, len(begin))
    x, v = rng.uniform(-200, 200, (len(begin), 2)), 3 * rng.normal(size=(len(begin), 2))
    scans = []
    for t in range(100):
        here = (begin <= t) & (t < begin + life)
        z = (x + (t - begin)[:, None] * v)[here & (rng.random(len(begin)) < 0.9)]
        z = z[(np.abs(z) < SIDE).all(1)]
        z = z + 2 * rng.normal(size=z.shape)
        scans.append(np.vstack((z, rng.uniform(-SIDE, SIDE, (rng.poisson(3.0), 2)))))
    own = {"birth_rate": guess, "p_survive": 0.95, "backlog": 1.0, "learn_span": 300.0}
    got = found(make_recording(scans), "birth_rate", **own)
    assert got.keys() == {"birth_rate", "evidence_gained"}
    # Who dies before a detection is seldom known of, and steps are not finer than a twentieth.
    many = len(begin) / 100
    assert got["birth_rate"] == pytest.approx(many, abs=4.5 * np.sqrt(many / 100))

"""Scenarios ``crowd`` and ``rendezvous``: who is there when, and how they move."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from echoset.models import registry
from echoset.models.checks import check
from echoset.models.errors import ParameterError
from echoset.models.parameters import resolve
from echoset.simulate import crowd, rendezvous

Z = 4.5
"""Tolerances in standard errors."""


def simulate(scenario, seed=1, **parameters):
    params = scenario.Params(**parameters)
    return scenario.simulate(params, np.random.default_rng(seed), "run")


def lives(objects, count):
    """First and last step (N,), from 1, of each target."""
    step = np.repeat(np.arange(1, len(objects.time_ns) + 1), np.diff(objects.row_offset))
    own = [step[objects.label == label] for label in range(count)]
    return np.array([[s[0], s[-1]] for s in own]).T


def test_a_crowd_comes_in_the_first_half_and_a_fourth_goes_in_the_last_quarter():
    n = 2000
    truth = simulate(crowd, targets=n, clutter_rate=0.0).truth.objects
    first, last = lives(truth, n)
    assert (first == 1).sum() >= n // 2 and first.max() == 50
    late = first[n // 2 :]
    assert abs(late.mean() - 25.5) < Z * np.sqrt((50**2 - 1) / 12 / len(late))
    assert (last == 100).sum() >= 3 * n // 4
    gone = last[3::4]
    assert gone.min() == 75
    assert abs(gone.mean() - 87.5) < Z * np.sqrt((26**2 - 1) / 12 / len(gone))
    assert np.abs(truth.state[:, :2]).max() <= 1000
    fresh = np.unique(truth.label, return_index=True)[1]
    assert np.abs(truth.state[fresh, :2]).max() <= 800


def test_a_crowd_walks_by_white_acceleration():
    """In an area that nobody can leave, increments have the law of the motion."""
    wide = (-1e6, 1e6, -1e6, 1e6)
    truth = simulate(crowd, targets=300, clutter_region=wide, clutter_rate=0.0).truth.objects
    one = truth.state[truth.label == 0]
    assert len(one) == 100
    states = [truth.state[truth.label == label] for label in range(300)]
    v = np.concatenate([np.diff(s[:, 2:], axis=0) for s in states])
    x = np.concatenate([np.diff(s[:, :2], axis=0) - s[:-1, 2:] for s in states])
    n = len(v)
    for sample, variance in ((v, 0.25), (x, 0.25 / 3)):
        assert (np.abs((sample**2).mean(0) - variance) < Z * variance * np.sqrt(2 / n)).all()
    start = np.array([s[0, 2:] for s in states])
    assert (np.abs((start**2).mean(0) - 36) < Z * 36 * np.sqrt(2 / 300)).all()


def test_a_crowd_without_room_is_refused():
    with pytest.raises(ParameterError, match="targets"):
        simulate(crowd, clutter_region=(-1.0, 1.0, -1.0, 1.0))


def test_objects_meet_in_the_middle_step_with_one_velocity():
    count = 3000
    every = {"first": (1,) * count, "last": (81,) * count, "clutter_rate": 0.0}
    state = simulate(rendezvous, birth_weight=0.0, **every).truth.objects.state
    state = state.reshape(81, count, 4)
    np.testing.assert_array_equal(state[40, :, 2:], 2.0)
    for k, t in ((40, 0), (0, 40), (80, 40)):
        variance = np.full(2, 4 + 0.09 * t**3 / 3)
        mean = state[k, :, :2].mean(0) - 2.0 * (k - 40)
        assert (np.abs(mean) < Z * np.sqrt(variance / count)).all()
        spread = np.abs(state[k, :, :2].var(0) - variance)
        assert (spread < Z * variance * np.sqrt(2 / count)).all()


def test_a_rendezvous_states_where_objects_may_appear():
    recording = simulate(rendezvous)
    check(recording)
    truth, model = recording.truth.objects, recording.streams["radar"].model
    first, last = lives(truth, 6)
    assert first.tolist() == [1, 1, 11, 11, 21, 21] and last.tolist() == [61, 61, 71, 71, 81, 81]
    fresh = np.unique(truth.label, return_index=True)[1]
    births = np.array(model["birth_components"])
    assert model["birth"] == "components"
    np.testing.assert_array_equal(births[:, 0], 0.01)
    np.testing.assert_array_equal(births[:, 1:5], np.rint(truth.state[fresh]))
    np.testing.assert_array_equal(births[:, 5:], 2.0)
    assert "birth" not in simulate(rendezvous, birth_weight=0.0).streams["radar"].model


def test_nobody_at_a_rendezvous():
    recording = simulate(rendezvous, first=(), last=(), clutter_rate=0.0)
    check(recording)
    assert not len(recording.truth.objects.label)


def test_the_file_states_the_defaults_of_every_parameter():
    module = registry.load("echoset.scenarios", "rendezvous")
    path = Path(module.__file__).parent / "scenarios" / "rendezvous.yaml"
    content = yaml.safe_load(path.read_text())
    assert content["scenario"] == "rendezvous"
    assert list(content["parameters"]) == list(module.Params.__dataclass_fields__)
    assert resolve(module.Params, ("yaml", content["parameters"])) == module.Params()


@pytest.mark.parametrize(
    "wrong",
    [{"first": (0,)}, {"last": (5,)}, {"birth_std": 0.0}, {"spread": -1.0}, {"p_detect": 1.5}],
)
def test_impossible_parameters(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        resolve(rendezvous.Params, ("here", wrong))

"""Scenario ``manoeuvre``: circles in turns, halved speeds in stops, straight lines between."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from echoset.models import registry
from echoset.models.checks import check
from echoset.models.errors import ParameterError
from echoset.models.parameters import resolve
from echoset.simulate import manoeuvre


def states(**parameters):
    params = manoeuvre.Params(**{"noise_density": 0.0, "targets": 40, **parameters})
    recording = manoeuvre.simulate(params, np.random.default_rng(1), "run")
    check(recording)
    return recording.truth.objects.state.reshape(params.steps, params.targets, 4)


def test_turns_are_circles_to_either_side():
    x = states(stops=())
    v = x[:, :, 2] + 1j * x[:, :, 3]
    change = np.angle(v[1:] / v[:-1])
    turning = np.zeros(99, bool)
    turning[[*range(19, 34), *range(59, 74)]] = True
    np.testing.assert_allclose(change[~turning], 0.0, atol=1e-12)
    np.testing.assert_allclose(np.abs(change[turning]), 0.15, rtol=1e-12)
    sides = np.sign(change[[25, 65]])
    assert {tuple(s) for s in sides.T} == {(a, b) for a in (-1, 1) for b in (-1, 1)}
    # A chord of a circle: 2 v / rate sin(rate dt / 2).
    way = np.hypot(*np.moveaxis(np.diff(x[:, :, :2], axis=0), 2, 0))
    expected = 2 * np.abs(v[:-1]) / 0.15 * np.sin(0.075)
    np.testing.assert_allclose(way[turning], expected[turning], rtol=1e-12)


def test_stops_halve_the_speed():
    x = states(turns=())
    speed = np.hypot(x[:, :, 2], x[:, :, 3])
    ratio = speed[1:] / speed[:-1]
    stopping = np.zeros(99, bool)
    stopping[44:49] = True
    np.testing.assert_allclose(ratio[stopping], 0.5, rtol=1e-12)
    np.testing.assert_allclose(ratio[~stopping], 1.0, rtol=1e-12)
    assert speed[0].min() >= 10 and speed[0].max() <= 20


def test_nobody():
    assert states(targets=0).shape == (100, 0, 4)


def test_the_file_states_the_defaults_of_every_parameter():
    module = registry.load("echoset.scenarios", "manoeuvre")
    path = Path(module.__file__).parent / "scenarios" / "manoeuvre.yaml"
    content = yaml.safe_load(path.read_text())
    assert content["scenario"] == "manoeuvre"
    assert list(content["parameters"]) == list(module.Params.__dataclass_fields__)
    assert resolve(module.Params, ("yaml", content["parameters"])) == module.Params()


@pytest.mark.parametrize(
    "wrong", [{"speed": (2.0, 1.0)}, {"turns": ((5, 4),)}, {"stops": ((0, 1),)}]
)
def test_impossible_parameters(wrong):
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        resolve(manoeuvre.Params, ("here", wrong))

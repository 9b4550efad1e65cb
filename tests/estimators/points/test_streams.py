"""Each stream by its own model: what one states, or the user says of one, is of that one alone."""

from dataclasses import replace

import numpy as np
import pytest

import echoset
from echoset.estimators import mbm, phd
from echoset.estimators.points.streams import OF_ONE, resolved
from echoset.models.errors import InputError, ParameterError
from echoset.models.parameters import sensor_model
from echoset.models.records import Sensor

MODULES = pytest.mark.parametrize("module", [phd, mbm])
NEAR = {"p_detect": 0.7, "clutter_rate": 1.0, "std_position": 0.5, "max_range": 50.0,
        "clutter_region": [-4.0, 4.0, -4.0, 4.0]}  # fmt: skip
FAR = {"p_detect": 0.9, "clutter_rate": 2.0, "std_position": 2.0}


@pytest.fixture
def both(make_recording):
    """A lidar that sees 50 m, and a radar beside it with a target at 100 m."""
    z = [np.array([[100.0 + k, 0.0]]) for k in range(10)]
    radar = make_recording(z, model={**FAR, "max_range": 200.0})
    lidar = make_recording([[]] * 10, model=NEAR).streams["radar"]
    sensors = {**radar.sensors, "lidar": Sensor.static("radar", np.zeros(2))}
    streams = {"radar": radar.streams["radar"], "lidar": replace(lidar, nodes=("lidar",))}
    return replace(radar, sensors=sensors, streams=streams)


def params(module, recording, *layers):
    stated = sensor_model(recording, module.Params)
    made = resolved(module.Params, recording, stated, layers)
    return module.context(recording.setup(), made).sensing


@MODULES
def test_the_view_of_one_does_not_blind_the_other(module, both):
    for names in (("lidar", "radar"), ("z-lidar", "a-radar")):
        streams = dict(zip(names, (both.streams["lidar"], both.streams["radar"]), strict=True))
        found = echoset.estimate(
            replace(both, streams=streams), module.__name__.rpartition(".")[2], birth_rate=0.2
        )
        last = found.objects.state[found.objects.row_offset[-2] :]
        assert len(last) == 1 and abs(last[0, 0] - 109) < 4


@MODULES
def test_layers_of_a_stream(module, both):
    own = params(module, both)
    assert own["radar"].clutter_region == () and own["lidar"].clutter_region == (-4, 4, -4, 4)
    assert (own["radar"].max_range, own["lidar"].max_range) == (200.0, 50.0)
    for p in (0.9, 0.7, 0.8):
        said = params(module, both, ("--set", {"p_detect": p}))
        assert said["radar"].p_detect == said["lidar"].p_detect == p
    one = {"p_detect": 0.8, "sensors": {"lidar": {"p_detect": 0.6}}}
    said = params(module, both, ("--config", one), ("--set", {"std_position": 1.0}))
    assert (said["radar"].p_detect, said["lidar"].p_detect) == (0.8, 0.6)
    assert said["radar"].std_position == said["lidar"].std_position == 1.0


@MODULES
@pytest.mark.parametrize(
    ("sensors", "message"),
    [
        ({"ladar": {"p_detect": 0.5}}, r"sensors.ladar: no such stream \(did you mean 'l?[ra]"),
        ({"lidar": {"p_detekt": 0.5}}, r"p_detekt: unknown parameter \(did you mean 'p_detect'"),
        ({"lidar": {"birth_rate": 0.5}}, "birth_rate: does not hold for single streams"),
        ({"lidar": {"sensors": {}}}, "sensors: does not hold for single streams"),
        ({"lidar": {"p_detect": 1.5}}, r"p_detect must be in \[0, 1\]"),
        ({"lidar": 3}, "sensors.lidar must be a mapping"),
    ],
)
def test_what_has_no_effect_is_refused(module, both, sensors, message):
    with pytest.raises(ParameterError, match=message):
        params(module, both, ("--set", {"sensors": sensors}))


@MODULES
def test_a_preset_may_speak_of_sensors_that_are_not_here(module, both):
    preset = ("--preset harbour", {"sensors": {"sonar": {"p_detect": 0.1}}})
    assert params(module, both, preset)["radar"].p_detect == 0.9


@MODULES
def test_what_one_states_the_other_does_not_lack_silently(module, both):
    silent = replace(both.streams["lidar"], model={"std_position": 1.0})
    with pytest.raises(InputError, match="p_detect"):
        params(module, replace(both, streams={**both.streams, "lidar": silent}))


def test_every_parameter_of_one_stream_has_an_effect_there():
    assert "sensors" not in OF_ONE and {"p_detect", "max_range", "clutter_cell"} <= set(OF_ONE)


@MODULES
def test_what_each_stream_is_told_need_not_be_told_for_all(module, make_recording):
    recording = make_recording([[[1.0, 2.0]]])
    told = {"p_detect": 0.7, "clutter_rate": 2.0, "std_position": 1.0}
    own = params(module, recording, ("--config", {"sensors": {"radar": told}}))["radar"]
    assert (own.p_detect, own.clutter_rate, own.std_position) == (0.7, 2.0, 1.0)
    two = replace(recording, streams={**recording.streams, "other": recording.streams["radar"]})
    with pytest.raises(InputError, match="p_detect"):
        params(module, two, ("--config", {"sensors": {"radar": told}}))

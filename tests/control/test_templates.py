"""Templates learnt from maps whose bodies are known, and what cannot be learnt from."""

from dataclasses import replace

import numpy as np
import pytest

from echoset.campaign.scenarios import find
from echoset.control import templates
from echoset.estimators.maps.tbd.params import BodyParams
from echoset.models.errors import InputError
from echoset.models.parameters import resolve
from echoset.models.random import generator
from echoset.simulate import jsc


def simulated(seed, **changes):
    params = resolve(jsc.Params, *find("jsc-6bs").layers, ("here", {"scans": 6, "dt": 0.5}))
    return jsc.simulate(replace(params, **changes), generator(seed, "templates", "r"), f"r{seed}")


def test_larger_and_brighter_vehicles_are_learnt():
    """Length within 8 %, the pedestrian's cross section within a third; likelier apart, too."""
    changes = {"vehicle_length": 5.8, "vehicle_width": 2.2, "rcs_pedestrian": 3.0}
    recordings = [simulated(s, **changes) for s in range(3)]
    found = templates.learn(recordings, templates.Params(scans=5))
    assert found.values["vehicle_length"] == pytest.approx(5.8, rel=0.08)
    assert found.values["vehicle_width"] == pytest.approx(2.2, rel=0.2)
    assert found.values["rcs_pedestrian"] == pytest.approx(3.0, rel=0.33)
    assert found.learnt_from == ("r0", "r1") and found.tried_on == ("r2",) and found.gain > 5


def test_the_likelihood_is_highest_about_the_truth():
    moments = templates.seen(simulated(4), 6)
    at = [
        templates.likelihood(moments, replace(BodyParams(), vehicle_length=4.5 * np.exp(s)))
        for s in (-0.2, 0.0, 0.2)
    ]
    assert at[1] > at[0] and at[1] > at[2]
    assert len(moments) == 6 and len(moments[0].kinds) == 8


def test_what_cannot_be_learnt_from():
    recording = simulated(5)
    with pytest.raises(InputError, match="no truth with classes and headings"):
        templates.learn([replace(recording, truth=None)], templates.Params())
    with pytest.raises(InputError, match="no stream of the kind range_angle_map"):
        templates.learn([replace(recording, streams={})], templates.Params())

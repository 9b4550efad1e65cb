"""A device that hardly walks on its object finds its place there all the same."""

from __future__ import annotations

from itertools import islice

import numpy as np
import pytest

from echoset.campaign.scenarios import find
from echoset.estimators.eopda import geo
from echoset.estimators.run import Estimation
from echoset.models.parameters import resolve
from echoset.models.random import generator

STEPS = 24


@pytest.mark.parametrize("seed", [1, 3, 4])
def test_a_start_in_the_wrong_place_is_left(seed: int) -> None:
    """A scene whose first ranges leave several places to the device: some runs stayed 0.5 m off."""
    found = find("uwb-olos")
    params = resolve(found.module.Params, *found.layers)
    name = "uwb-olos-s7-0000"
    record = found.module.simulate(params, generator(7, "simulate", name), name)
    preset = geo.ACTIVE_PASSIVE.PRESETS["tuned"]
    run = Estimation("eopda-geo", (("preset", preset),), seed).on(record.setup(), name)
    out = list(islice(run.steps(record.scans()), STEPS))
    p = np.array([e.objects.columns("device_x", "device_y")[0] for e in out])
    true = record.truth.objects.columns("device_x", "device_y")[: len(p)]
    assert np.hypot(*(p - true).T)[12:].max() < 0.2

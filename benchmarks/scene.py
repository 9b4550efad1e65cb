"""Recordings of packaged scenarios, made in memory."""

from __future__ import annotations

from echoset.campaign.scenarios import find
from echoset.models.parameters import resolve
from echoset.models.random import generator
from echoset.models.records import Recording


def simulated(scenario: str, name: str, seed: int = 1, **settings: object) -> Recording:
    """What ``echoset simulate SCENARIO --seed SEED --set ...`` writes as the recording ``name``."""
    found = find(scenario)
    params = resolve(found.module.Params, *found.layers, ("settings", settings))
    recording: Recording = found.module.simulate(params, generator(seed, "simulate", name), name)
    return recording

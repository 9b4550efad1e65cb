"""Recordings of targets that go straight where a test wants them."""

from __future__ import annotations

import numpy as np

from echoset.campaign.scenarios import find
from echoset.models.parameters import resolve
from echoset.simulate import jsc


def straight(kinds, place, heading, speed, seed, **changes):
    """Targets of classes ``kinds`` that pass ``place`` (n, 2) in the middle of the time."""
    params = resolve(jsc.Params, *find("jsc-6bs").layers, ("here", changes))
    rng, kinds = np.random.default_rng(seed), np.asarray(kinds)
    h, t = np.asarray(heading, float), params.time_ns / 1e9
    v = np.asarray(speed, float)[:, None] * np.stack((np.cos(h), np.sin(h)), 1)
    where = np.asarray(place, float)[:, None] + v[:, None] * (t - t.mean())[:, None]
    state = np.concatenate((where, np.repeat(v[:, None], len(t), 1)), 2)
    turn = np.repeat(h[:, None], len(t), 1)
    targets = jsc.Targets(kinds, state, turn, np.ones((len(kinds), 2)))
    return jsc.recorded(params, targets, rng, "straight")

"""Seeking anew: a false alarm is none of the evidence."""

from __future__ import annotations

import numpy as np
import pytest

from echoset.estimators.eopda import geo, position
from echoset.estimators.eopda.cloud.lost import Doubt, search
from echoset.estimators.eopda.filter import track
from echoset.estimators.eopda.links import NO_LINKS, Links
from echoset.estimators.eopda.state import Belief, Event, Height

ANCHORS = np.array([[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [6.0, 5.0, 0.0], [0.0, 5.0, 0.0]])


def event(k: int, rng: np.random.Generator) -> Event:
    """Ranges of 5 cm to a tag that walks at 0.5 m/s, ten events a second."""
    p = np.array([1.5 + 0.05 * k, 2.0, 0.0])
    z = np.linalg.norm(p - ANCHORS, axis=1) + 0.05 * rng.normal(size=4)
    to = np.arange(4)
    return Event(
        k * 10**8, ANCHORS, Links(0 * to + 4, to, np.arange(5), z, 0 * z + 0.05**2), NO_LINKS
    )


@pytest.mark.parametrize("module", ["position", "geo"])
def test_a_device_that_is_not_lost_is_not_found_anew(module: str) -> None:
    """The evidence of a start from the same events is no better: what is left is the prior's odds.

    The events are among those that the filter had before them: it can only know more.
    """
    rng = np.random.default_rng(1)
    if module == "position":
        target, params = position.DEVICE.target, position.Params(particles=1000, max_range=10.0)
    else:
        target = geo.CIRCLE
        params = geo.Params(particles=1000, max_range=10.0, mean_scatter=0.0, mean_clutter=1.0)
    before = Belief(Height(0.0, 0.0, 0.0, np.inf), np.zeros(0), np.zeros((0, 0)))
    doubt = Doubt()
    for step, own in zip(
        track(
            (event(k, np.random.default_rng(k)) for k in range(40)), target, params, before, rng, ""
        ),
        (event(k, np.random.default_rng(k)) for k in range(40)),
        strict=True,
    ):
        doubt = doubt.after(own, step.evidence, 0.0)
    _, odds = search(doubt, target, params, before, rng)
    assert odds < 0.01

"""Policies of a sensor that looks into one of several views at each step.

Found by the entry-point group ``echoset.policies``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..models.records import Array

Choice = Callable[[int, Array, Array], int]
"""From the step (0, 1, ...), and the mean and variance (B,) of the number of targets in the region
of each view after the step before, the index of the next view. Before the first step both are 0."""


@dataclass(frozen=True, slots=True)
class Policy:
    """A policy and one line about it."""

    SUMMARY: str
    choose: Choice


NAIVE = Policy("the views in turn", lambda step, mean, variance: step % len(mean))
VARIANCE = Policy(
    "where the number of targets is least certain, the first of equals",
    lambda step, mean, variance: int(variance.argmax()),
)

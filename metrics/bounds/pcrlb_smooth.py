"""Posterior Cramér-Rao bound in hindsight, for estimates from all ranges; see :mod:`.pcrlb`."""

from __future__ import annotations

from ...models.records import Estimates, Recording, Scores
from .pcrlb import FOR_SETS, PARTS, STREAMS, Params, bounds
from .smoothed import smoothed_bounds

SUMMARY = "posterior Cramér-Rao bound for smoothed estimates, blocked links without events"
QUADRATIC = ("pcrlb-smooth",)
__all__ = ["FOR_SETS", "STREAMS", "PARTS", "QUADRATIC", "SUMMARY", "Params", "score"]


def score(estimates: Estimates, recording: Recording, params: Params) -> Scores:
    """The scores of :func:`.pcrlb.score`, called ``pcrlb-smooth``, of the past and the future.

    Raises
    ------
    InputError : no UWB events, or the truth lacks device, centre or ellipse at an event
    """
    return bounds(recording, params, "pcrlb-smooth", blocked=False, known=smoothed_bounds)

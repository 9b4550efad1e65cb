"""Posterior Cramér-Rao bound as if no link had been blocked; see :mod:`.pcrlb`."""

from __future__ import annotations

from ...models.records import Estimates, Recording, Scores
from .pcrlb import FOR_SETS, PARTS, STREAMS, Params, bounds

SUMMARY = "posterior Cramér-Rao bound as if no link had been blocked"
QUADRATIC = ("pcrlb-star",)
__all__ = ["FOR_SETS", "STREAMS", "PARTS", "QUADRATIC", "SUMMARY", "Params", "score"]


def score(estimates: Estimates, recording: Recording, params: Params) -> Scores:
    """The scores of :func:`.pcrlb.score`, called ``pcrlb-star``, with the blocked links.

    Raises
    ------
    InputError : no UWB events, or the truth lacks device, centre or ellipse at an event
    """
    return bounds(recording, params, "pcrlb-star", blocked=True)

"""``pmb``: the filter :mod:`.points.pmb`, of detections or of what :mod:`.maps` makes of maps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ..models.records import Estimates, Recording, Scan
from .maps.detector import Chain
from .maps.params import MAPS, MapParams
from .points import pmb_filter
from .points.context import Context
from .points.model import sensing
from .points.pmb import run
from .points.streams import resolved
from .presets import Presets

__all__ = ["PRESETS", "STREAMS", "SUMMARY", "Params", "context", "estimate", "resolved", "run"]
SUMMARY = "Poisson multi-Bernoulli filter of detections or range-angle maps, by belief propagation"
STREAMS = (*sensing.STREAMS, MAPS)
PRESETS = Presets("echoset.estimators.points", "pmb")


@dataclass(frozen=True)
class Params(MapParams, pmb_filter.Params):
    """The filter's, and the way from maps to detections."""

    def __post_init__(self) -> None:
        pmb_filter.Params.__post_init__(self)
        MapParams.__post_init__(self)


def context(setup: Recording, params: Params) -> Context[Params]:
    """What stays for a recording.

    Raises
    ------
    InputError : fewer streams of maps than are to be fused; weights missing or damaged
    """
    return Context.of(setup, params, Chain.of(setup, params))


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """Yield the targets after each time, and how many there are in all and in the regions.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    """
    return run(context(setup, params), scans)

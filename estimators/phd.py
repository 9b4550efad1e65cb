"""``phd``: the filter :mod:`.points.phd`, of detections or of what :mod:`.maps` makes of maps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ..models.records import Estimates, Recording, Scan
from .maps.detector import Chain, files
from .maps.params import MAPS, MapParams
from .points import phd_filter, sensing
from .points.context import Context
from .points.phd import run
from .points.streams import resolved
from .presets import Presets

__all__ = [
    "PRESETS",
    "STREAMS",
    "SUMMARY",
    "Params",
    "context",
    "estimate",
    "files",
    "resolved",
    "run",
]
SUMMARY = "Gaussian-mixture PHD filter of detections or range-angle maps, with regions"
STREAMS = (*sensing.STREAMS, MAPS)
PRESETS = Presets("echoset.estimators.points", "phd")


@dataclass(frozen=True)
class Params(MapParams, phd_filter.Params):
    """The filter's, and the way from maps to detections."""

    def __post_init__(self) -> None:
        phd_filter.Params.__post_init__(self)
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
    """Yield the targets after each time, and their expected number in all and in the regions.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    EstimatorError : the weights are not finite
    """
    return run(context(setup, params), scans)

"""``phd``: the filter :mod:`.points.phd`, of detections or of what :mod:`.maps` makes of maps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..models.records import Estimates, Recording, Scan
from . import joined
from .joined import STREAMS, JoinedParams, context, files
from .points import phd_filter
from .points.phd import run
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
PRESETS = Presets("echoset.estimators.points", "phd")


@dataclass(frozen=True)
class Params(phd_filter.Params, JoinedParams):
    """The filter's, and the way from maps to detections."""

    def __post_init__(self) -> None:
        phd_filter.Params.__post_init__(self)
        JoinedParams.__post_init__(self)


resolved = partial(joined.resolved, PRESETS)


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """Yield the targets after each time, and their expected number in all and in the regions.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    EstimatorError : the weights are not finite
    """
    return joined.estimated(run, setup, scans, params)

"""``mbm``: the filter :mod:`.points.mbm`, of detections or of what :mod:`.maps` makes of maps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..models.records import Estimates, Recording, Scan
from . import joined
from .joined import STREAMS, JoinedParams, context, files
from .points import mbm_filter
from .points.mbm import run
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
SUMMARY = "Multi-Bernoulli mixture filter of detections or range-angle maps, Poisson or not"
PRESETS = Presets("echoset.estimators.points", "mbm")


@dataclass(frozen=True)
class Params(mbm_filter.Params, JoinedParams):
    """The filter's, and the way from maps to detections."""

    def __post_init__(self) -> None:
        mbm_filter.Params.__post_init__(self)
        JoinedParams.__post_init__(self)


resolved = partial(joined.resolved, PRESETS)


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """Yield the targets at each time, ``lag`` seconds late.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    EstimatorError : no hypothesis is possible
    """
    return joined.estimated(partial(run, rng=rng), setup, scans, params)

"""``pmb``: the filter :mod:`.points.pmb`, of detections or of what :mod:`.maps` makes of maps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..models.records import Estimates, Recording, Scan
from . import joined
from .joined import STREAMS, JoinedParams, context, files
from .points import pmb_filter
from .points.pmb import run
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
SUMMARY = "Poisson multi-Bernoulli filter of detections or range-angle maps, by belief propagation"
PRESETS = Presets("echoset.estimators.points", "pmb")


@dataclass(frozen=True)
class Params(pmb_filter.Params, JoinedParams):
    """The filter's, and the way from maps to detections."""

    def __post_init__(self) -> None:
        pmb_filter.Params.__post_init__(self)
        JoinedParams.__post_init__(self)


resolved = partial(joined.resolved, PRESETS)


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """Yield the targets after each time, and how many there are in all and in the regions.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    """
    return joined.estimated(run, setup, scans, params)

"""``mbm``: the filter :mod:`.points.mbm`, of detections or of what :mod:`.maps` makes of maps."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..models.parameters import Layer
from ..models.records import Estimates, Recording, Scan
from .maps.choice import with_default
from .maps.detector import Chain, files
from .maps.params import MAPS, MapParams
from .points import mbm_filter, streams
from .points.context import Context
from .points.mbm import run
from .points.model import sensing
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
STREAMS = (*sensing.STREAMS, MAPS)
PRESETS = Presets("echoset.estimators.points", "mbm")


@dataclass(frozen=True)
class Params(MapParams, mbm_filter.Params):
    """The filter's, and the way from maps to detections."""

    def __post_init__(self) -> None:
        mbm_filter.Params.__post_init__(self)
        MapParams.__post_init__(self)


def resolved(
    cls: type[Params], setup: Recording, stated: Sequence[Layer], layers: Sequence[Layer]
) -> Params:
    """The parameters of a recording; for maps by the preset ``tuned`` where none is given.

    Raises
    ------
    ParameterError : ``sensors`` names no stream, or what does not hold for single streams
    InputError : a parameter that has no default is not known for a stream
    """
    layers = with_default(setup, stated, layers, PRESETS["tuned"])
    return streams.resolved(cls, setup, stated, layers)


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
    """Yield the targets at each time, ``lag`` seconds late.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known; scans out of order
    EstimatorError : no hypothesis is possible
    """
    return run(context(setup, params), scans)

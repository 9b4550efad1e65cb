"""What filters of points are put together with: detections as they come, or as maps make them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from ..models.parameters import Layer
from ..models.records import Recording
from .maps.choice import with_default
from .maps.detector import Chain, files
from .maps.params import MAPS, MapParams
from .maps.templates import Templates
from .points import streams
from .points.context import Context, FilterParams
from .points.model import sensing
from .presets import Presets

__all__ = ["STREAMS", "JoinedParams", "context", "files", "resolved"]
STREAMS = (*sensing.STREAMS, MAPS)


@dataclass(frozen=True)
class JoinedParams(MapParams, FilterParams):
    """The way from maps to detections, and what every filter assumes."""


P = TypeVar("P", bound=JoinedParams)


def resolved(
    presets: Presets,
    cls: type[P],
    setup: Recording,
    stated: Sequence[Layer],
    layers: Sequence[Layer],
) -> P:
    """The parameters of a recording; for maps by a preset that suits them where none is given.

    Raises
    ------
    ParameterError : ``sensors`` names no stream, or what does not hold for single streams
    InputError : a parameter that has no default is not known for a stream
    """
    if "tuned" in presets:
        layers = with_default(setup, stated, layers, presets)
    return streams.resolved(cls, setup, stated, layers)


def context(setup: Recording, params: P) -> Context[P]:
    """What stays for a recording.

    Raises
    ------
    InputError : fewer streams of maps than are to be fused; weights missing or damaged; templates
        for a stream that does not state its waveform
    """
    source = Templates if params.detector == "templates" else Chain
    return Context.of(setup, params, source.of(setup, params))

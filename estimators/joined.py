"""What filters of points are put together with: detections as they come, or as maps make them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import TypeVar

from ..models.parameters import Layer
from ..models.records import Estimates, Recording, Scan
from .maps.choice import with_default
from .maps.detector import Chain, files
from .maps.params import MAPS, MapParams
from .maps.templates import Templates
from .points import streams
from .points.context import Context, FilterParams
from .points.learn import head, learn
from .points.model import sensing
from .presets import Presets

__all__ = ["STREAMS", "JoinedParams", "context", "estimated", "files", "resolved"]
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


def estimated(
    run: Callable[[Context[P], Iterable[Scan]], Iterator[Estimates]],
    setup: Recording,
    scans: Iterable[Scan],
    params: P,
) -> Iterator[Estimates]:
    """What a filter's ``run`` yields, once what is to be learnt has been.

    That stands in the provenance of the first.

    Raises
    ------
    InputError : fewer streams of maps than are to be fused; weights missing or damaged
    """
    if not params.learn:
        yield from run(context(setup, params), scans)
        return
    rest = iter(scans)
    first = head(rest, params.learn_span)
    params, found = learn(setup, first, params)
    about = replace(setup.meta, provenance={"found": found} if found else {})
    for estimates in run(context(setup, params), chain(first, rest)):
        yield replace(estimates, meta=about)

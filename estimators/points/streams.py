"""Which parameters hold for which stream of detections, and for what a source makes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import TypeVar

from ...models import parameters
from ...models.parameters import Layer, resolved_by_stream
from ...models.records import Recording
from .model.sensing import STREAMS, SensorParams
from .source import MADE

OF_ONE = tuple(f.name for f in fields(SensorParams) if f.name != "sensors")
"""Parameters that may differ from stream to stream."""
P = TypeVar("P", bound=SensorParams)


def resolved(cls: type[P], setup: Recording, stated: Sequence[Layer], layers: Sequence[Layer]) -> P:
    """The parameters of a recording, see :func:`echoset.models.parameters.resolved_by_stream`.

    All that is no detection stream is one, by the name of what a source makes.

    Raises
    ------
    ParameterError : ``sensors`` names no stream, or what does not hold for single streams
    InputError : a parameter that has no default is not known for a stream
    """
    kinds = sorted((name, s.kind) for name, s in setup.streams.items())
    groups = {name: [name] for name, kind in kinds if kind in STREAMS}
    others = [name for name, kind in kinds if kind not in STREAMS]
    groups |= {MADE: others} if others else {}
    return resolved_by_stream(cls, OF_ONE, groups, stated, layers)


def per_stream(params: P, setup: Recording) -> dict[str, P]:
    """The parameters as they hold for each stream, and for what a source makes."""
    return parameters.per_stream(params, (*sorted(setup.streams), MADE))

"""What stays while a filter of point targets runs over a recording."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from ...models.geometry.regions import polygons
from ...models.parameters import parameter
from ...models.records import Array, Recording
from .model.doppler import warn_unused
from .model.sensing import SensorParams
from .model.targets import TargetParams, settled
from .source import Nothing, Source
from .streams import per_stream

LEARNABLE = ("latency", "registration", "p_detect", "clutter_rate", "accuracy", "birth_rate")
"""What can be learnt of a sensor, accuracy being the noise of what it measures; and of targets."""


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class FilterParams(TargetParams, SensorParams):
    """What every filter assumes about sensors and targets, learns, and the regions it counts in."""

    TITLE = "learning and regions"

    learn: tuple[str, ...] = parameter(
        (),
        "",
        "what to learn of each sensor, and of targets birth_rate, from the recording itself before "
        "it is estimated; latency and registration are those against the first stream by name",
        within=LEARNABLE,
    )
    learn_span: float = parameter(
        120.0, "s", "how much of the recording is learnt from", within="(0, inf)"
    )
    regions: Any = parameter(
        {}, "m", "regions to count targets in: name to x_min, x_max, y_min, y_max or to corners"
    )

    def __post_init__(self) -> None:
        SensorParams.__post_init__(self)
        TargetParams.__post_init__(self)
        polygons(self.regions)


P = TypeVar("P", bound=FilterParams, covariant=True)
Given = TypeVar("Given", bound=FilterParams)


@dataclass(frozen=True, slots=True, eq=False)
class Context(Generic[P]):
    """What stays: the recording's setup, parameters (in all and by stream), corners of regions.

    ``source`` makes detections of scans that hold none.
    """

    setup: Recording
    params: P
    sensing: Mapping[str, P]
    regions: Mapping[str, Array]
    source: Source

    @staticmethod
    def of(
        setup: Recording, params: Given, source: Source | None = None, quiet: bool = False
    ) -> Context[Given]:
        """The context of a recording; what is not used is said, if it is not to be ``quiet``."""
        params = settled(params, setup)
        sensing = per_stream(params, setup)
        for name, stream in sorted(setup.streams.items()):
            if not quiet:
                warn_unused(name, stream.rows, sensing[name])
        return Context(setup, params, sensing, polygons(params.regions), source or Nothing())

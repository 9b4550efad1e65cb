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


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class FilterParams(TargetParams, SensorParams):
    """What every filter assumes about sensors and targets, and the regions that it counts in."""

    TITLE = "regions"

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
    def of(setup: Recording, params: Given, source: Source | None = None) -> Context[Given]:
        """The context of a recording."""
        params = settled(params, setup)
        sensing = per_stream(params, setup)
        for name, stream in sorted(setup.streams.items()):
            warn_unused(name, stream.rows, sensing[name])
        return Context(setup, params, sensing, polygons(params.regions), source or Nothing())

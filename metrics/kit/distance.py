"""Metrics on sets that are one distance at each step, and the parts that it consists of."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from ...models.records import Array, Scores
from ..protocol import Metric
from .measured import Measured, Names, of_sets
from .series import Distance, parts
from .sets import AlignedSets

Values = Callable[[AlignedSets, float, float], Mapping[str, Array]]
"""From sets, order and cut-off, the distance (n,) [m] at each step, called "", and its parts."""


def distance(
    name: str, summary: str, named: tuple[str, ...], values: Values, params: type[Any] = Distance
) -> Metric:
    """The metric ``name`` of the distance ``values``, whose parts are ``named``."""

    def summarise(names: Names, measured: Measured, params: Any) -> Scores:
        """The distance [m] and its parts per step, their means, and the steps left out."""
        return parts((*names, name), measured, measured.values, params.block)

    measure = of_sets(lambda aligned, params: values(aligned, params.order, params.cutoff))
    return Metric(summary, params, measure, summarise, PARTS=named, FOR_SETS=True)

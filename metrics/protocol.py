"""What a metric is: a module or object with these names."""

from __future__ import annotations

from typing import Any, Protocol

from ..models.records import Estimates, Recording, Scores


class Metric(Protocol):
    """A metric as the entry-point group ``echoset.metrics`` finds it.

    ``SUMMARY`` : one line for ``echoset list``
    ``PARTS`` : what it can score: ``device``, ``centre``, ``extent``, ...
    ``NEEDS_SCANS`` : whether it reads link events or scans; without them the recording may come
    with empty streams
    ``FOR_SETS`` : whether it scores sets of objects: not asked for by name, it is left out where
    there is one object, and one estimate, all the time
    ``QUADRATIC`` : those of its metric names that are roots of mean squares, so that pooling
    averages their squares
    ``Params`` : frozen dataclass of parameters (see :mod:`echoset.models.parameters`); those
    whose name stands in a stream's ``model`` take their value from there
    """

    SUMMARY: str
    PARTS: tuple[str, ...]
    NEEDS_SCANS: bool
    FOR_SETS: bool
    QUADRATIC: tuple[str, ...]
    Params: type[Any]

    def score(self, estimates: Estimates, recording: Recording, params: Any) -> Scores:
        """The scores of ``estimates`` against the truth of ``recording``.

        Raises
        ------
        InputError : there is no truth, or it or the estimates lack what the metric needs
        """
        ...

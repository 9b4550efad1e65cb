"""What a metric is: a module or object with these names."""

from __future__ import annotations

from typing import Any, Protocol

from ..models.records import Estimates, Recording, Scores


class Metric(Protocol):
    """A metric as the entry-point group ``echoset.metrics`` finds it.

    One that goes by steps also has ``measure`` and ``summarise`` (see :mod:`.measured`) and scores
    recordings of any length; one without gets estimates and recording whole.

    ``SUMMARY`` : one line for ``echoset list``
    ``PARTS`` : what it can score: ``device``, ``centre``, ``extent``, ...
    ``STREAMS`` : the stream kinds of which it needs one, and reads the scans; where there are none
    the recording may come with empty streams
    ``FOR_SETS`` : whether it scores sets of objects: not asked for by name, it is left out where
    there is one object, and one estimate, all the time
    ``QUADRATIC`` : those of its metric names that are roots of mean squares, so that pooling
    averages their squares
    ``Params`` : frozen dataclass of parameters (see :mod:`echoset.models.parameters`); those
    whose name stands in a stream's ``model`` take their value from there
    """

    SUMMARY: str
    PARTS: tuple[str, ...]
    STREAMS: tuple[str, ...]
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

"""A metric: an object with defaults for all but its own, or a module with such names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields
from typing import Any

from ..models import registry
from ..models.records import Estimates, Recording, Scores
from .kit.measured import Measure, Summarise, finish

GROUP = "echoset.metrics"
Whole = Callable[[Estimates, Recording, Any], Scores]


@dataclass(frozen=True, slots=True)
class Metric:
    """A metric as the entry-point group :data:`GROUP` finds it.

    ``SUMMARY`` : one line for ``echoset list``
    ``Params`` : frozen dataclass of parameters (see :mod:`echoset.models.parameters`); those
    whose name stands in a stream's ``model`` take their value from there
    ``measure``, ``summarise`` : those of a metric that goes by steps (see :mod:`.kit.measured`) and
    scores recordings of any length
    ``whole`` : the scores of one that does not, which gets estimates and recording whole
    ``ROWS`` : its metric names that do not begin with its own
    ``PARTS`` : what it can score: ``device``, ``centre``, ``extent``, ...
    ``STREAMS`` : the stream kinds of which it needs one, and reads the scans; where there are none
    the recording may come with empty streams
    ``FOR_SETS`` : whether it scores sets of objects: not asked for by name, it is left out where
    there is one object, and one estimate, all the time
    ``QUADRATIC`` : those of its metric names that are roots of mean squares, so that pooling
    averages their squares
    """

    SUMMARY: str
    Params: type[Any]
    measure: Measure | None = None
    summarise: Summarise | None = None
    whole: Whole | None = None
    ROWS: tuple[str, ...] = ()
    PARTS: tuple[str, ...] = ()
    STREAMS: tuple[str, ...] = ()
    FOR_SETS: bool = False
    QUADRATIC: tuple[str, ...] = ()

    def score(self, estimates: Estimates, recording: Recording, params: Any) -> Scores:
        """The scores of ``estimates`` against the truth of ``recording``.

        Raises
        ------
        InputError : there is no truth, or it or the estimates lack what the metric needs
        """
        if self.measure is None or self.summarise is None:
            assert self.whole is not None
            return self.whole(estimates, recording, params)
        names = recording.meta.name, estimates.estimator
        return finish(self.summarise, names, [self.measure(estimates, recording, params)], params)


def load(name: str) -> Metric:
    """The metric ``name``; of a module, the object made from its names, ``score`` for ``whole``.

    Raises
    ------
    ParameterError : no such metric, with the closest that there is
    """
    found = registry.load(GROUP, name)
    if isinstance(found, Metric):
        return found
    said = {
        f.name: getattr(found, f.name)
        for f in fields(Metric)
        if f.default is MISSING or hasattr(found, f.name)
    }
    return Metric(**{"whole": getattr(found, "score", None), **said})


def maker(row: str) -> str | None:
    """The metric whose rows are called ``row``, or None."""
    names = registry.names(GROUP)
    own = [name for name in names if row in load(name).ROWS]
    begun = [name for name in names if f"{row}-".startswith(f"{name}-")]
    return max(own or begun, key=len, default=None)

"""A metric at work on one file of estimates."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from ..models.checks import in_range
from ..models.errors import InputError
from ..models.parameters import Layer, as_dict, resolve, sensor_model
from ..models.records import Estimates, Objects, Recording, Scores
from .kit.alignment import Scored, settle
from .kit.measured import Measured, finish
from .protocol import load


class MetricRun:
    """A metric with its parameters, what it measured so far, and why it does not apply, if so."""

    def __init__(
        self, name: str, user: Iterable[Layer], estimates: Estimates, recording: Recording
    ) -> None:
        """The metric ``name`` with its parameters; it does not apply without a stream it needs."""
        self.name = name
        self.error: InputError | None = None
        self._metric = load(name)
        self.params: Any = resolve(
            self._metric.Params, *sensor_model(recording, self._metric.Params), *user
        )
        self._settled = self.params
        self._names = recording.meta.name, estimates.estimator
        self._measured: list[Measured] = []
        self._steps = 0
        self._table: Scores | None = None
        kinds = self._metric.STREAMS
        if kinds and not any(s.kind in kinds for s in recording.streams.values()):
            reason = f"{name} needs a stream of {' or '.join(kinds)}"
            self.error = InputError(f"{recording.meta.name}: {reason}")

    @property
    def by_steps(self) -> bool:
        """Whether it takes windows of steps."""
        return self._metric.measure is not None

    @property
    def gap(self) -> float:
        """The longest gap [s] of the truth that is interpolated, once it is settled."""
        return float(getattr(self._settled, "max_gap", None) or 0.0)

    def settle(self, start: Objects | None) -> None:
        """Settle all parameters that follow from the ``start`` of the truth."""
        if start is not None and isinstance(self.params, Scored):
            self._settled = settle(self.params, start)

    def measure(self, estimates: Estimates, recording: Recording) -> None:
        """Take the next window of steps, unless the metric is out or takes none."""
        if self.error is not None or self._metric.measure is None:
            return
        params = self._settled
        if getattr(params, "skip", 0):
            params = replace(params, skip=max(0, params.skip - self._steps))
        with self._refusals():
            self._measured.append(self._metric.measure(estimates, recording, params))
        self._steps += len(estimates.objects.time_ns)

    def score(self, estimates: Estimates, recording: Recording) -> None:
        """Take everything at once."""
        if self.error is None:
            with self._refusals():
                self._table = self._metric.score(estimates, recording, self.params)

    def finish(self, required: bool) -> Scores | None:
        """The scores, with the parameters as provenance; None where the metric does not apply.

        Raises
        ------
        InputError : it does not apply, but is ``required``
        """
        summarise = self._metric.summarise
        if self.error is None and self._table is None and summarise is not None:
            with self._refusals():
                self._table = finish(summarise, self._names, self._measured, self.params)
        if self.error is not None and required:
            raise self.error
        used = {"metrics": {self.name: as_dict(self.params)}}
        return None if self._table is None else replace(self._table, provenance=used)

    @contextmanager
    def _refusals(self) -> Iterator[None]:
        """Note why the metric does not apply; numbers whose squares overflow are such a reason."""
        reason = f"{self._names[0]}: {self.name} is not computed from numbers so large or small"
        try:
            with in_range(InputError, reason):
                yield
        except InputError as error:
            self.error = error


def score(name: str, user: Iterable[Layer], estimates: Estimates, recording: Recording) -> Scores:
    """The scores of a metric, its parameters from the layers of the recording and of the ``user``.

    Raises
    ------
    ParameterError : an unknown metric or parameter, or an impossible value
    InputError : there is no truth, or it or the estimates lack what the metric needs
    """
    run = MetricRun(name, user, estimates, recording)
    run.score(estimates, recording)
    found = run.finish(required=True)
    assert found is not None
    return found

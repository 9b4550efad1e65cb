"""One file of estimates against its truth: what a task of ``echoset score`` does."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from pathlib import Path

from .. import formats
from ..formats import scores as files
from ..formats.provenance import versions
from ..metrics import pooling
from ..metrics import segments as spans
from ..metrics.beside import TruthWindow, is_one_object
from ..metrics.gate import Gate
from ..metrics.protocol import GROUP, load
from ..metrics.run import MetricRun
from ..models import registry
from ..models.errors import InputError, ParameterError
from ..models.parameters import Layer, suggestion
from ..models.records import Estimates, Recording, Scores
from . import exits, inputs, log, progress, truth
from .batch.execution import Execution
from .batch.task import Whole
from .outputs import Target
from .progress import announce_compilation

Layers = dict[str, tuple[Layer, ...]]


@dataclass(frozen=True, slots=True)
class Task:
    """Estimates to be scored by metrics, each with its layers of parameters.

    Metrics that do not apply are left out unless all are ``required``; ``show`` the progress.
    """

    source: str
    truth: tuple[str, ...]
    metrics: Layers
    required: bool
    show: bool = False
    target: None = None

    @property
    def label(self) -> str:
        """The input as the user named it."""
        return inputs.label(self.source)

    @property
    def sources(self) -> tuple[str, ...]:
        """The estimates, and the recordings or folders of them."""
        return self.source, *self.truth

    def placed(self, execution: Execution) -> Task:
        """The task with the paths of the workers."""
        source, places = execution.place(self.source), execution.places(self.truth)
        return replace(self, source=source, truth=places)

    def decide(self) -> None:
        """It is always done."""

    def run(self) -> Scores:
        """The scores of the estimates."""
        return score(self)


def score(task: Task) -> Scores:
    """The scores of one file of estimates, which is read in windows.

    Raises
    ------
    InputError : it is damaged, has no truth, or lacks what a metric needs
    ParameterError : an impossible parameter
    """
    with ExitStack() as stack:
        source = stack.enter_context(inputs.spooled(task.source))
        found = stack.enter_context(closing(formats.open_windows(source, task.label)))
        estimates = found.head
        if isinstance(estimates, Recording):
            raise InputError(f"{task.label}: holds a recording, not estimates")
        place = None if found.has_recording else truth.find(estimates, task.label, task.truth)
        path, label = (source, task.label) if place is None else (place, str(place))
        beside = formats.open_windows(path, label, recording=place is None)
        about = stack.enter_context(closing(beside))
        recording = about.head
        assert isinstance(recording, Recording)
        announce_compilation()
        running = [
            MetricRun(name, user, estimates, recording) for name, user in task.metrics.items()
        ]
        _measure(running, found, about, task)
        whole = None
        for metric in running:
            if metric.error is None and not metric.by_steps:
                whole = whole or _whole(source, place, task.label)
                metric.score(*whole)
    tables = [m.finish(task.required) for m in running]
    refused = [m.error for m in running if m.error is not None]
    for metric in running:
        if metric.error is not None:
            log.logger.info("%s: without %s: %s", task.label, metric.name, metric.error)
    kept = [table for table in tables if table is not None]
    if not kept:
        raise refused[0]
    used = {name: p for t in kept for name, p in t.provenance["metrics"].items()}
    return replace(Scores.join(kept), provenance={"metrics": used, "versions": versions()})


@dataclass(frozen=True, slots=True)
class Table(Whole[Scores]):
    """All scores in one table, with segments and pooled rows, and whether it passes its gates.

    ``config`` is the file that some of the parameters were read from.
    """

    target: Target = field()
    segments: tuple[tuple[float, float], ...]
    pool: bool
    gates: tuple[Gate, ...]
    config: str | None

    @property
    def inputs(self) -> tuple[str | None]:
        """The file of parameters."""
        return (self.config,)

    def sources(self, tasks: Sequence[Task]) -> list[str | None]:
        """Estimates, then the recordings that they were made from, then the parameters."""
        used = [place for t in tasks if (place := truth.located(t.source, t.truth))]
        return list(dict.fromkeys([*(t.source for t in tasks), *map(str, used), self.config]))

    def finish(self, results: list[Scores]) -> int:
        """Write it, and tell which gates it does not pass."""
        table = Scores.join(results)
        if self.segments:
            table = spans.segments(table, self.segments)
        if self.pool:
            table = Scores.join([table, pooling.pool(table)])
        failures = [line for gate in self.gates for line in gate.failures(table)]
        with self.target.open() as opened:
            files.write(table, opened, self.target.format)
        for line in failures:
            log.error(f"gate: {line}")
        return exits.GATE if failures else 0


def _measure(
    running: Sequence[MetricRun], found: formats.Windows, about: formats.Windows, task: Task
) -> None:
    """Have the metrics that go by steps measure all windows.

    Where nobody asked for them, those for sets wait until there is more than one object.
    """
    gap = max((getattr(m.params, "max_gap", 0.0) for m in running), default=0.0)
    beside = TruthWindow(about.head, iter(about), min(int(gap * 1e9) + 1, 1 << 60))
    waiting: list[tuple[Estimates, Recording]] = []
    single = not task.required
    windows = progress.share(found, found, about) if task.show else found
    for window in windows:
        pair = window, beside.around(window.objects.time_ns)
        single = single and is_one_object(*pair)
        for metric in running:
            if not (single and metric.for_sets):
                for earlier in waiting if metric.for_sets else ():
                    metric.measure(*earlier)
                metric.measure(*pair)
        waiting = [*waiting, pair] if single else []
    beside.rest()
    for metric in running:
        metric.dropped = single and metric.for_sets


def _whole(source: Path, place: Path | None, label: str) -> tuple[Estimates, Recording]:
    """Estimates and recording at once, for metrics that need all of them."""
    estimates = formats.read(source, label)
    assert isinstance(estimates, Estimates)
    recording = estimates.recording if place is None else formats.read(place)
    assert isinstance(recording, Recording)
    return estimates, recording


def layers(names: Iterable[str], user: Iterable[Layer]) -> Layers:
    """The user's layers for each metric: those for all, then its own by ``<metric>.<name>``.

    Raises
    ------
    ParameterError : an unknown metric, or a parameter that none of the metrics has
    """
    fields = {name: set(load(name).Params.__dataclass_fields__) for name in names}
    found: dict[str, list[Layer]] = {name: [] for name in fields}
    metrics, parameters = set(registry.names(GROUP)), set[str]().union(*fields.values())
    for source, values in user:
        own = {
            key: value or {}
            for key, value in values.items()
            if (isinstance(value, dict) and key not in parameters)
            or (value is None and key in metrics)
        }
        shared = {key: value for key, value in values.items() if key not in own}
        for keys, among in ((own, metrics), (shared, parameters)):
            for key in keys:
                if key not in among:
                    kind = "metric" if keys is own else "parameter"
                    hint = suggestion(key, among)
                    raise ParameterError(f"{source}: unknown {kind} {key!r}{hint}")
        for name, mine in found.items():
            mine.append((source, {k: v for k, v in shared.items() if k in fields[name]}))
            mine.append((f"{source}: {name}", own.get(name, {})))
    return {name: tuple(mine) for name, mine in found.items()}

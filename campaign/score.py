"""One file of estimates against its truth: what a task of ``echoset score`` does."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from .. import formats
from ..formats import scores as files
from ..formats.provenance import versions
from ..metrics import pooling
from ..metrics import segments as spans
from ..metrics.beside import TruthWindow, is_one_object
from ..metrics.gate import Gate
from ..metrics.kit import fit
from ..metrics.protocol import GROUP, load
from ..metrics.run import MetricRun
from ..models import registry
from ..models.errors import InputError, ParameterError
from ..models.geometry.poses import Placement, said
from ..models.names import scenario
from ..models.parameters import Layer, shown, suggestion
from ..models.records import Array, Estimates, Recording, Scores
from . import exits, log, progress, truth
from .batch.execution import Execution
from .batch.task import Whole
from .files import inputs
from .files.outputs import Target
from .progress import announce_compilation

Layers = dict[str, tuple[Layer, ...]]


@dataclass(frozen=True, slots=True)
class Task:
    """Estimates to be scored by metrics, each with its layers of parameters.

    Metrics that do not apply are left out unless all are ``required``; ``align`` fits the truth to
    the estimates (``rigid``, ``time`` or ``both``); ``show`` the progress.
    """

    source: str
    truth: tuple[str, ...]
    metrics: Layers
    required: bool
    align: str | None = None
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

    def run(self) -> FileScores:
        """The scores of the estimates."""
        return score(self)


@dataclass(frozen=True, slots=True, eq=False)
class FileScores:
    """The scores of one file by metric, why others do not apply, and whether it has one object."""

    label: str
    recording: str
    estimator: str
    tables: Mapping[str, Scores]
    refused: Mapping[str, str]
    one_object: bool
    aligned: Mapping[str, Any] | None = None


def score(task: Task) -> FileScores:
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
        placed, aligned = None, recording.meta.provenance.get("truth_aligned")
        if task.align is not None:
            own = _track(formats.open_windows(source, task.label), task.label)
            true = _track(formats.open_windows(path, label, recording=place is None), label)
            placed, aligned = fit.fit(own, true, task.align, task.label)
        _tell_aligned(task.label, aligned)
        one_object = _measure(running, found, about, task, placed)
        whole = None
        for metric in running:
            if metric.error is None and not metric.by_steps:
                whole = whole or _whole(source, place, task.label)
                metric.score(whole[0], _moved(whole[1], placed))
    found_by = {m.name: m.finish(task.required) for m in running}
    tables = {name: table for name, table in found_by.items() if table is not None}
    refused = {m.name: m.error for m in running if m.error is not None}
    for name, error in refused.items():
        log.logger.info("%s: without %s: %s", task.label, name, error)
    if not tables:
        raise next(iter(refused.values()))
    _tell_left_out(task.label, Scores.join(tables.values()))
    reasons = {name: str(error) for name, error in refused.items()}
    names = recording.meta.name, estimates.estimator
    return FileScores(task.label, *names, tables, reasons, one_object, aligned)


def decide(results: Sequence[FileScores], required: bool) -> list[Scores]:
    """The scores of all files by the metrics that apply, the same ones within a scenario.

    Unless they are ``required``, those for sets of objects are left out where there is one object
    all the time in every file of a scenario, and any that does not apply to all files of an
    estimator, since its pool would speak of some recordings only.
    """
    single = {scenario(r.recording) for r in results}
    single -= {scenario(r.recording) for r in results if not r.one_object}
    partial: dict[tuple[str, str], dict[str, str]] = {}
    for r in results:
        mine = partial.setdefault((scenario(r.recording), r.estimator), {})
        mine |= {name: text for name, text in r.refused.items() if name not in mine}
    told, kept = set(), []
    for r in results:
        key = scenario(r.recording), r.estimator
        tables = []
        for name, table in r.tables.items():
            if required or not (name in partial[key] or (key[0] in single and load(name).FOR_SETS)):
                tables.append(table)
            elif name in partial[key] and (key, name) not in told:
                told.add((key, name))
                text = "%s: without %s, which does not apply to all files: %s"
                log.logger.warning(text, " ".join(key), name, partial[key][name])
        if tables:
            used = {name: p for t in tables for name, p in t.provenance["metrics"].items()}
            provenance = {"metrics": used, "versions": versions()}
            if r.aligned is not None:
                provenance["truth_aligned"] = {**r.aligned}
            kept.append(replace(Scores.join(tables), provenance=provenance))
    if results and not kept:
        name, text = next(iter(partial[key].items()))
        raise InputError(f"no metric applies to all files of {' '.join(key)}; {name}: {text}")
    return kept


@dataclass(frozen=True, slots=True)
class Table(Whole[FileScores]):
    """All scores in one table, with segments and pooled rows, and whether it passes its gates.

    ``config`` is the file that some of the parameters were read from; all metrics are to apply if
    they are ``required``.
    """

    target: Target = field()
    segments: tuple[tuple[float, float], ...]
    pool: bool
    gates: tuple[Gate, ...]
    config: str | None
    required: bool

    @property
    def inputs(self) -> tuple[str | None]:
        """The file of parameters."""
        return (self.config,)

    def sources(self, tasks: Sequence[Task]) -> list[str | None]:
        """Estimates, then the recordings that they were made from, then the parameters."""
        used = [place for t in tasks if (place := truth.located(t.source, t.truth))]
        return list(dict.fromkeys([*(t.source for t in tasks), *map(str, used), self.config]))

    def finish(self, results: list[FileScores]) -> int:
        """Write it, and tell which gates it does not pass."""
        table = Scores.join(decide(results, self.required))
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
    running: Sequence[MetricRun],
    found: formats.Windows,
    about: formats.Windows,
    task: Task,
    placed: Placement | None,
) -> bool:
    """Have the metrics that go by steps measure all windows; whether there is always one object."""
    head = about.head
    assert isinstance(head, Recording)
    beside = TruthWindow(_moved(head, placed), (_moved(window, placed) for window in about))
    for metric in running:
        metric.settle(beside.start)
    gap = max((metric.gap for metric in running), default=0.0)
    one_object = True
    for window in progress.share(found, found, about) if task.show else found:
        pair = window, beside.around(window.objects.time_ns, gap)
        one_object = one_object and is_one_object(*pair)
        for metric in running:
            metric.measure(*pair)
    beside.rest()
    return one_object


def _tell_aligned(label: str, aligned: Mapping[str, Any] | None) -> None:
    """Say what was fitted of the truth, now or before, and what that does to the scores."""
    if aligned is None:
        return
    found = dict(aligned)
    text = "%s: the truth was fitted to the %s: %s: %d numbers from %d %s"
    kind = "positions" if "positions" in found else "ranges"
    to = "estimates" if kind == "positions" else "ranges"
    log.logger.warning(text, label, to, said(found), found["fitted"], found[kind], kind)
    if kind == "positions":
        text = "%s: by the fit, an rmse of device or centre is too small by a factor of about %.4f"
        log.logger.warning(text, label, fit.gain(found))


def _track(windows: formats.Windows, label: str) -> tuple[Array, Array]:
    """Times and positions of the one object of estimates, or of the truth."""
    with closing(windows):
        found = (w.truth if isinstance(w, Recording) else w for w in windows)
        return fit.track((part.objects for part in found if part is not None), label)


def _moved(recording: Recording, placed: Placement | None) -> Recording:
    """The recording with its truth so placed."""
    if placed is None or recording.truth is None:
        return recording
    return replace(
        recording, truth=replace(recording.truth, objects=placed.of(recording.truth.objects))
    )


MANY = 0.05
"""Share of the steps from which on those that are left out are told without being asked."""


def _tell_left_out(label: str, scores: Scores) -> None:
    """Say of how many steps the scores are, where the metric that has fewest leaves some out."""
    left = scores.where(metric=lambda name: name.endswith("-left-out"))
    if not len(left) or not left.value.any():
        return
    k = int(np.argmax(left.value / np.maximum(left.n, 1)))
    steps, out = int(left.n[k]), int(left.value[k])
    level = logging.WARNING if out > MANY * steps else logging.INFO
    text = "%s: %s is of %d of %d steps: the others lack truth within max_gap, or an estimate"
    name = left.metric[k].removesuffix("-left-out")
    log.logger.log(level, text, label, name, steps - out, steps)


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
                    raise ParameterError(f"{source}: unknown {kind} {shown(key)}{hint}")
        for name, mine in found.items():
            mine.append((source, {k: v for k, v in shared.items() if k in fields[name]}))
            mine.append((f"{source}: {name}", own.get(name, {})))
    return {name: tuple(mine) for name, mine in found.items()}

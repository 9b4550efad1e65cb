"""One recording through one estimator: what a task of ``echoset estimate`` does."""

from __future__ import annotations

from array import array
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, Any

import numpy as np

from ..estimators.kernels.passes import AROUND, Around
from ..estimators.presets import preset as named
from ..estimators.run import GROUP, SMOOTH, Estimation, TimedStep
from ..formats import Writer, header, open_source, read, writer
from ..formats import scores as files
from ..formats.provenance import versions
from ..metrics.kit.table import rows
from ..models.errors import InputError, ParameterError
from ..models.parameters import Layer
from ..models.records import Meta, Recording, Scores
from ..models.registry import load
from . import exits, progress
from .batch import resume
from .batch.execution import Execution
from .batch.task import Whole
from .files.inputs import is_pipe, label, spooled, stdin
from .files.outputs import DASH, Existing, Target, scores_format, single

METRIC = "time-per-step"


@dataclass(frozen=True, slots=True)
class Timing:
    """Seconds that each step of a recording took, reading its scans included."""

    recording: str
    estimator: str
    time_ns: array[int]
    seconds: array[float]


@dataclass(frozen=True, slots=True)
class Task:
    """A recording to be estimated; ``show`` its steps as they pass.

    ``config`` is the file that some of the parameters were read from.
    """

    source: str
    target: Target
    asked: Estimation
    show: bool = False
    config: str | None = None

    @property
    def label(self) -> str:
        """The input as the user named it."""
        return label(self.source)

    @property
    def sources(self) -> tuple[str | None, ...]:
        """The recording, the file of parameters, and the files that parameters name."""
        return self.source, self.config, *self.asked.files

    def placed(self, execution: Execution) -> Task:
        """The task with the paths of the workers."""
        source, target = execution.place(self.source), execution.target(self.target)
        return replace(self, source=source, target=target)

    def decide(self) -> resume.Decision:
        """Whether the estimates have to be made."""
        if is_pipe(self.source):
            return resume.decide(replace(self.target, resume=False), dict)
        return resume.decide(self.target, self._expected)

    def _expected(self) -> dict[str, Any]:
        """The provenance of the estimates that :meth:`run` would write, from headers alone."""
        path = Path(self.source)
        source = open_source(path, self.label)
        try:
            run = self.asked.on(source.setup, self.label)
        finally:
            source.close()
        return run.provenance(
            versions(), header(path)["observed_digest"], self._content_digest(path)
        )

    def run(self) -> Timing:
        """Run the estimator over the recording and write its estimates.

        Raises
        ------
        InputError : the recording is damaged, of the wrong kind or lacks what the estimator needs
        ParameterError : an unknown or impossible parameter
        EstimatorError : an estimate that is not finite or breaks the contract of estimates
        OutputError : the output exists or cannot be written
        """
        if self.source == DASH:
            return self._estimate(stdin())
        with spooled(self.source) as path:
            return self._estimate(path)

    def _estimate(self, place: Path | IO[bytes]) -> Timing:
        """Estimate the recording at ``place``, a stream of stdin or a file."""
        content = self._content_digest(place)
        progress.announce_compilation()
        carried = is_pipe(self.source) and self.target.path is None
        source = open_source(place, self.label, keep=carried)
        try:
            setup = self._whole(place) if content else source.setup
            run = self.asked.on(setup, self.label)
            scans = source.scans()
            # by what is read: a pass backwards yields nothing before all is
            steps = run.timed(progress.share(scans, source) if self.show else scans)
            with self.target.open() as target:
                out = writer(target, self.target.format)
                AROUND.set(self._around())
                try:
                    meta = replace(setup.meta, provenance=run.provenance(versions()))
                    timing = _append(steps, out, meta)
                    provenance = run.provenance(versions(), source.observed_digest, content)
                    meta = replace(meta, provenance=provenance)
                    out.close(meta, source.recording() if carried else None)
                    return timing
                finally:
                    out.abort()
        finally:
            source.close()

    def _around(self) -> Around:
        """Temporary files beside the output; the way back counts its steps."""
        folder = None if self.target.path is None else self.target.path.parent
        return Around(folder, _counted) if self.show else Around(folder)

    def _whole(self, place: Path | IO[bytes]) -> Recording:
        """The recording with its truth, for an estimator that declares that it uses it."""
        record = read(place, self.label)
        if not isinstance(record, Recording):
            raise InputError(f"{self.label}: holds estimates, not a recording")
        return record

    def _content_digest(self, place: Path | IO[bytes]) -> str:
        """The digest of the whole recording, where the estimator uses its truth."""
        if not self.asked.uses_truth:
            return ""
        if not isinstance(place, Path):
            name = self.asked.estimator
            raise InputError(f"{self.label}: {name} uses the truth: give it a file")
        return str(header(place)["content_digest"])


def _counted(steps: Iterable[Any], total: int) -> Iterator[Any]:
    return progress.bar(steps, "step", total)


def _append(steps: Iterable[TimedStep], out: Writer, meta: Meta) -> Timing:
    """Write the steps, and tell their times."""
    timing = Timing(meta.name, str(meta.provenance["estimator"]), array("q"), array("d"))
    for step, seconds in steps:
        exits.check_signals()  # a library may have caught what a signal raised
        out.append(replace(step, meta=meta))
        timing.time_ns.extend(step.objects.time_ns.tolist())
        timing.seconds.extend([seconds] * len(step.objects.time_ns))
    return timing


def chosen(estimator: str, preset: str | None, smooth: str | None, keep: bool) -> Iterator[Layer]:
    """The layers that ``--preset``, ``--smooth`` and ``--keep`` stand for.

    Raises
    ------
    ParameterError : the estimator has no such preset, cannot smooth, or has nothing to keep
    """
    module = load(GROUP, estimator)
    known = module.Params.__dataclass_fields__
    if preset is not None:
        yield f"--preset {preset}", named(estimator, preset)
    if smooth is not None:
        if SMOOTH not in known:
            raise ParameterError(f"{estimator} has no way back that --smooth could take")
        yield "--smooth", {SMOOTH: smooth}
    if keep:
        if "keep" not in known:
            raise ParameterError(f"{estimator} has nothing that --keep could keep")
        yield "--keep", {"keep": True}


class Times(Whole[Timing]):
    """The table of all steps' times, if ``file`` is to have one.

    It never stands in estimates, which are equal for equal inputs. When a campaign is resumed, a
    table that is there is in the way of new times only.
    """

    option = "--timing"

    def __init__(self, file: str | None, existing: Existing) -> None:
        if file is None:
            return
        form = scores_format(file)
        if existing.skip_existing and file != DASH:
            self.target = Target(Path(file), form)
        else:
            self.target = single(file, form, existing.overwrite)

    def finish(self, results: list[Timing]) -> int:
        """Write it."""
        if self.target is not None and results:
            with self.target.open() as opened:
                files.write(_table(results), opened, self.target.format)
        return 0


def _table(timings: Iterable[Timing]) -> Scores:
    """The seconds of every step, and for each recording their mean in a row without time."""
    tables = []
    for timing in timings:
        key = timing.recording, timing.estimator, METRIC, ""
        seconds = np.array(timing.seconds)
        stderr = seconds.std() / np.sqrt(len(seconds))
        tables.append(rows(key, np.array(timing.time_ns) / 1e9, seconds))
        tables.append(rows(key, np.nan, seconds.mean(), len(seconds), stderr))
    return replace(Scores.join(tables), provenance={"versions": versions()})

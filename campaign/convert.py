"""A file in another format, or logs as a recording: what a task of ``echoset convert`` does."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from .. import formats
from ..formats import scores
from ..models import registry
from ..models.checks import in_range
from ..models.errors import FormatError, InputError, ParameterError
from ..models.parameters import Layer, resolve
from ..models.records import Estimates, Meta, Recording, Scores
from . import exits, log
from .batch import resume
from .batch.execution import Execution
from .batch.task import Whole
from .files.inputs import is_pipe, is_scores, label, spooled
from .files.outputs import DASH, Target
from .layers import layers
from .progress import share


@dataclass(frozen=True, slots=True)
class Import:
    """An importer, the logs that make one recording, and what the user says of them.

    With ``recover`` the importer takes what is whole of damaged ones, if it knows how.
    """

    name: str
    inputs: tuple[str, ...]
    mapping: str | None
    config: str | None
    settings: tuple[str, ...]
    recover: bool = False

    def read(self) -> Recording | Estimates:
        """The recording, or the estimates of others that lie in it."""
        with in_range(InputError, f"{self.inputs[0]}: holds numbers that are out of range"):
            found: Recording | Estimates = self._module.read(self._paths, self._params())
        return found

    def windows(self) -> Iterator[Recording] | None:
        """The recording in windows of time, where the importer reads it so."""
        if not hasattr(self._module, "windows"):
            return None
        found: Iterator[Recording] | None = self._module.windows(self._paths, self._params())
        return found

    @property
    def _module(self) -> Any:
        return registry.load("echoset.importers", self.name)

    @property
    def _paths(self) -> list[Path]:
        return [Path(source) for source in self.inputs]

    def _params(self) -> Any:
        first: list[Layer] = [("--mapping", {"mapping": self.mapping})] if self.mapping else []
        first += [("--recover", {"recover": True})] if self.recover else []
        return resolve(self._module.Params, *first, *layers(self.config, self.settings))


def proposal(name: str, log: str) -> str:
    """What the importer ``name`` proposes as the mapping of a log."""
    module = registry.load("echoset.importers", name)
    if not hasattr(module, "propose"):
        raise ParameterError(f"the importer {name!r} needs no mapping")
    return str(module.propose(Path(log))).rstrip("\n")


@dataclass(frozen=True, slots=True)
class Task:
    """A file to be written in another format, or to be imported; ``show`` the progress.

    ``recover`` what can be had of a damaged one.
    """

    label: str
    target: Target
    foreign: Import | None = None
    show: bool = False
    recover: bool = False

    @property
    def sources(self) -> tuple[str | None, ...]:
        """The files that are read."""
        f = self.foreign
        return (self.label,) if f is None else (*f.inputs, f.mapping, f.config)

    def placed(self, execution: Execution) -> Task:
        """The task with the paths of the workers."""
        foreign = self.foreign
        if foreign is not None:
            foreign = replace(foreign, inputs=execution.places(foreign.inputs))
        label, target = execution.place(self.label), execution.target(self.target)
        return replace(self, label=label, target=target, foreign=foreign)

    def decide(self) -> resume.Decision:
        """Whether the file has to be written: not if its content is the same already."""
        if self.foreign is not None or is_pipe(self.label):
            return resume.decide(replace(self.target, resume=False), dict)
        return resume.decide(self.target, self._expected)

    def _expected(self) -> dict[str, str]:
        try:
            return {"content_digest": formats.header(Path(self.label))["content_digest"]}
        except FormatError:
            if not self.recover:
                raise
            return {"content_digest": "lost"}

    def run(self) -> bool:
        """Read the file and write the same content; whether only part of it could be had."""
        if self.foreign is not None:
            windows = self.foreign.windows()
            if windows is None:
                record = self.foreign.read()
                _write(record, self.target)
                return "recovered" in record.meta.provenance
            return "recovered" in _write_windows(windows, self.target).provenance
        with spooled(self.label) as path:
            if self.recover:
                return _recovered(path, self)
            if self.label != DASH and is_scores(path, self.label):
                _write(scores.read(path, self.label), self.target)
            elif not _passed_on(path, self):
                _write(formats.read(path, label(self.label)), self.target)
        return False


class Recovered(Whole[bool]):
    """The exit code that says whether a file could be had in part only."""

    def finish(self, results: list[bool]) -> int:
        """Partial where one was."""
        return exits.PARTIAL if any(results) else 0


def _recovered(path: Path, task: Task) -> bool:
    """Write what can be had of a damaged file; whether that is not all."""
    try:
        with closing(formats.open_windows(path)) as windows:
            deque(windows, maxlen=0)
        refused = None
    except FormatError as error:
        refused = error
    if refused is None:
        return replace(task, recover=False).run()
    with closing(formats.rescue(path)) as found, task.target.open() as opened:
        writer: Any = None
        try:
            for window in found:
                if writer is None:
                    _known(task.target, window)
                    writer = formats.writer(opened, task.target.format)
                writer.append(window)
            damage = found.damage
            if damage is None:
                raise refused
            writer.close(found.meta, found.recording)
        finally:
            if writer is not None:
                writer.abort()
    reason = f"{damage.where}: {damage.reason}"
    name, count = label(task.label), found.messages
    log.logger.warning("%s: recovered %d messages, to the damage at %s", name, count, reason)
    return True


def _passed_on(path: Path, task: Task) -> bool:
    """Whether the record could be written window by window as it was read: not what it carries."""
    with closing(formats.open_windows(path, label(task.label))) as windows:
        if windows.has_recording:
            return False
        _known(task.target, windows.head)
        with task.target.open() as opened:
            writer = formats.writer(opened, task.target.format)
            try:
                for window in share(windows, windows) if task.show else windows:
                    writer.append(window)
                writer.close(windows.head.meta)
            finally:
                writer.abort()
    return True


def _write(record: Recording | Estimates | Scores, target: Target) -> None:
    if isinstance(record, Scores):
        with target.open() as opened:
            scores.write(record, opened, target.format)
        return
    _known(target, record)
    with target.open() as opened:
        formats.write(record, opened, target.format)


def _write_windows(windows: Iterator[Recording], target: Target) -> Meta:
    """Write a recording window by window; what it is called and where it comes from."""
    writer: Any = None
    first = next(windows)
    _known(target, first)
    with target.open() as opened:
        writer = formats.writer(opened, target.format)
        try:
            writer.append(first)
            for window in windows:
                writer.append(window)
            writer.close(first.meta)
        finally:
            writer.abort()
    return first.meta


def _known(target: Target, record: Recording | Estimates) -> None:
    """Raise :class:`ParameterError` unless the target's format holds records."""
    if target.format not in registry.names("echoset.formats"):
        kind = type(record).__name__.lower()
        raise ParameterError(f"{kind} cannot be written as {target.format}")

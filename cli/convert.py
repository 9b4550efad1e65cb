"""``echoset convert``: between formats, and from the logs of others."""

from __future__ import annotations

from collections import deque
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from typing import TYPE_CHECKING, Any

import click

from ..campaign import log
from ..campaign.execution import Execution
from ..campaign.outputs import DASH, Existing, Target, plan, scores_format
from . import options

if TYPE_CHECKING:
    from ..campaign.resume import Decision
    from ..models.records import Estimates, Recording, Scores


@dataclass(frozen=True, slots=True)
class Import:
    """An importer, the logs that make one recording, and what the user says of them."""

    name: str
    inputs: tuple[str, ...]
    mapping: str | None
    config: str | None
    settings: tuple[str, ...]

    def read(self) -> Recording:
        """The recording."""
        from ..campaign.layers import layers
        from ..models.parameters import resolve
        from ..models.registry import load

        module = load("echoset.importers", self.name)
        first = (("--mapping", {"mapping": self.mapping}),) if self.mapping else ()
        params = resolve(module.Params, *first, *layers(self.config, self.settings))
        recording: Recording = module.read([Path(source) for source in self.inputs], params)
        return recording


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


def convert(task: Task) -> bool:
    """Read a file and write the same content in another format; whether only part could be had."""
    from ..campaign.inputs import is_scores, read, read_scores, spooled
    from ..models.errors import FormatError

    if task.foreign is not None:
        _write(task.foreign.read(), task.target)
        return False
    if task.recover:
        with spooled(task.label) as path:
            try:
                return _recovered(path, task)
            except FormatError as error:
                if error.path != str(path) or task.label != DASH:
                    raise
                raise FormatError("<stdin>", error.where, error.reason) from error
    if task.label != DASH and is_scores(task.label):
        _write(read_scores(task.label), task.target)
        return False
    with spooled(task.label) as path:
        if not _passed_on(path, task):
            _write(read(str(path)), task.target)
    return False


def _recovered(path: Path, task: Task) -> bool:
    """Write what can be had of a damaged file; whether that is not all."""
    from .. import formats
    from ..campaign.inputs import label
    from ..models.errors import FormatError
    from ..models.records import Recording

    try:
        with closing(formats.open_windows(path)) as parts:
            deque(parts, maxlen=0)
            whole = True
    except FormatError:
        whole = False
    if whole:
        return convert(replace(task, recover=False))
    with closing(formats.rescue(path)) as found, task.target.open() as opened:
        writer: Any = None
        try:
            for window in found:
                if writer is None:
                    single = isinstance(window, Recording)
                    _known(task.target, "recording" if single else "estimates")
                    writer = formats.writer(opened, task.target.format)
                writer.append(window)
            writer.close(found.meta, found.recording)
        finally:
            if writer is not None:
                writer.abort()
    damage = found.damage
    assert damage is not None, "a whole file is converted"
    reason = f"{damage.where}: {damage.reason}"
    name, count = label(task.label), found.messages
    log.logger.warning("%s: recovered %d messages, to the damage at %s", name, count, reason)
    return True


def _passed_on(path: Path, task: Task) -> bool:
    """Whether the record could be written window by window as it was read: not what it carries."""
    from .. import formats
    from ..campaign.inputs import label
    from ..campaign.progress import share
    from ..models.records import Recording

    with closing(formats.open_windows(path, label(task.label))) as parts:
        if parts.has_recording:
            return False
        single = isinstance(parts.head, Recording)
        _known(task.target, "recording" if single else "estimates")
        with task.target.open() as opened:
            writer = formats.writer(opened, task.target.format)
            try:
                for window in share(parts, parts) if task.show else parts:
                    writer.append(window)
                writer.close(parts.head.meta)
            finally:
                writer.abort()
    return True


def decide(task: Task) -> Decision:
    """Whether the file has to be written: not if its content is the same already."""
    from ..campaign import resume
    from ..formats import header
    from ..models.errors import FormatError

    if task.foreign is not None or task.label == DASH:
        return resume.decide(replace(task.target, resume=False), dict)

    def expected() -> dict[str, str]:
        try:
            return {"content_digest": header(Path(task.label))["content_digest"]}
        except FormatError:
            if not task.recover:
                raise
            return {"content_digest": "lost"}

    return resume.decide(task.target, expected)


def _write(record: Recording | Estimates | Scores, target: Target) -> None:
    from .. import formats
    from ..formats import scores
    from ..models.records import Scores

    if not isinstance(record, Scores):
        _known(target, type(record).__name__.lower())
    with target.open() as opened:
        if isinstance(record, Scores):
            scores.write(record, opened, target.format)
        else:
            formats.write(record, opened, target.format)


def _known(target: Target, kind: str) -> None:
    """Raise :class:`ParameterError` unless the target's format holds records."""
    from ..models import registry
    from ..models.errors import ParameterError

    if target.format not in registry.names("echoset.formats"):
        raise ParameterError(f"{kind} cannot be written as {target.format}")


@click.command("convert")
@options.inputs("inputs", "IN...")
@options.output("File, folder (with a slash at the end) or - for stdout.")
@options.data_format
@click.option(
    "--from",
    "importer",
    type=options.Name("echoset.importers"),
    metavar="NAME",
    help="Importer from 'echoset list importers'; all IN make one recording.",
)
@click.option("--mapping", metavar="FILE", help="What columns mean, for --from csv.")
@click.option(
    "--recover", is_flag=True, help="Of a damaged MCAP file, keep what comes before the damage."
)
@options.config
@options.settings
@options.existing
@options.batch
@options.logging_options
def command(
    inputs: tuple[str, ...],
    output: str,
    form: str | None,
    importer: str | None,
    mapping: str | None,
    recover: bool,
    config: str | None,
    settings: tuple[str, ...],
    existing: Existing,
    execution: Execution,
) -> None:
    """Write IN in another format, or import it.

    IN are our files or, with --from, the logs of others. Content and digests stay the same
    between formats. Scores go between .csv, .json and .h5.

    With --recover, a damaged or truncated MCAP file gives its complete messages before the first
    damage, with a digest of their own and a note in the provenance; the exit code is then 3, and 4
    where there is nothing. A file that is whole is converted as ever.

    \b
    echoset convert recording.h5 -o recording.mcap
    echoset convert --from csv log.csv --mapping log.yaml -o recording.h5
    """
    from ..campaign import batch, exits
    from ..campaign.inputs import SCORES
    from ..models.errors import ParameterError

    if importer and recover:
        raise ParameterError("--recover is for our own files, not for --from")
    if importer:
        inputs, known = execution.places(inputs), (mapping, config, settings)
        target = plan(output, [PurePath(inputs[0]).stem], form, existing)[0]
        tasks = [Task(inputs[0], execution.target(target), Import(importer, inputs, *known))]
    elif mapping or config or settings:
        raise ParameterError("--mapping, --config and --set are for imports: name one by --from")
    else:
        if PurePath(output).suffix in SCORES and len(inputs) == 1:
            targets = [existing.target(Path(output), scores_format(output), late=False)]
        else:
            stems = [PurePath(source).stem for source in inputs]
            targets = plan(output, stems, form, existing, late=execution.keep_going)
        pairs = zip(execution.places(inputs), map(execution.target, targets), strict=True)
        alone = len(inputs) == 1
        tasks = [Task(source, target, None, alone, recover) for source, target in pairs]
    done = batch.run(convert, tasks, execution, decide, existing.dry_run)
    exits.end(exits.worst([done.exit_code] if done.exit_code else [], any(done.results)))

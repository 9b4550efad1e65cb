"""``echoset convert``: between formats, and from the logs of others."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

import click

from . import options
from .outputs import DASH, Policy, Target, plan, scores_format, single

if TYPE_CHECKING:
    from ..models.records import Estimates, Recording, Scores


@dataclass(frozen=True, slots=True)
class Task:
    """A file to be written in another format."""

    label: str
    target: Target


def convert(task: Task) -> None:
    """Read a file and write the same content in another format."""
    from .inputs import read, read_any

    record = read(DASH) if task.label == DASH else read_any(task.label)
    _write(record, task.target)


def _write(record: Recording | Estimates | Scores, target: Target) -> None:
    from .. import formats
    from ..formats import scores
    from ..models import registry
    from ..models.errors import ParameterError
    from ..models.records import Scores

    with target.open() as opened:
        if isinstance(record, Scores):
            scores.write(record, opened, target.format)
        elif target.format not in registry.names("echoset.formats"):
            kind = type(record).__name__.lower()
            raise ParameterError(f"{kind} cannot be written as {target.format}")
        else:
            formats.write(record, opened, target.format)


@click.command("convert")
@click.argument("inputs", nargs=-1, required=True, metavar="IN...", type=click.Path())
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
    config: str | None,
    settings: tuple[str, ...],
    overwrite: bool,
    skip_existing: bool,
    jobs: int,
    keep_going: bool,
) -> None:
    """Write IN in another format, or import it.

    IN are our files or, with --from, the logs of others. Content and digests stay the same
    between formats. Scores go between .csv, .json and .h5.

    \b
    echoset convert recording.h5 -o recording.mcap
    echoset convert --from csv log.csv --mapping log.yaml -o recording.h5
    """
    from ..models.errors import ParameterError
    from . import batch, exits
    from .inputs import SCORES

    policy = Policy(overwrite, skip_existing, keep_going)
    if importer:
        target = plan(output, [PurePath(inputs[0]).stem], form, policy)[0]
        if target is not None:
            _write(_imported(importer, inputs, mapping, config, settings), target)
        return
    if mapping or config or settings:
        raise ParameterError("--mapping, --config and --set are for imports: name one by --from")
    if PurePath(output).suffix in SCORES and len(inputs) == 1:
        targets: list[Target | None] = [single(output, scores_format(output), overwrite)]
    else:
        targets = plan(output, [PurePath(source).stem for source in inputs], form, policy)
    pairs = zip(inputs, targets, strict=True)
    tasks = [Task(source, target) for source, target in pairs if target is not None]
    exits.end(batch.run(convert, tasks, jobs, keep_going)[1])


def _imported(
    name: str,
    inputs: tuple[str, ...],
    mapping: str | None,
    config: str | None,
    settings: tuple[str, ...],
) -> Recording:
    from ..models.parameters import resolve
    from ..models.registry import load
    from .config import layers

    module = load("echoset.importers", name)
    first = (("--mapping", {"mapping": mapping}),) if mapping else ()
    params = resolve(module.Params, *first, *layers(config, settings))
    recording: Recording = module.read([Path(source) for source in inputs], params)
    return recording

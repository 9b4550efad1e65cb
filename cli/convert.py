"""``echoset convert``: between formats, and from the logs of others."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

import click

from . import options
from .campaign import Campaign
from .outputs import DASH, Policy, Target, plan, scores_format

if TYPE_CHECKING:
    from ..models.records import Estimates, Recording, Scores
    from .resume import Decision


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
        from ..models.parameters import resolve
        from ..models.registry import load
        from .config import layers

        module = load("echoset.importers", self.name)
        first = (("--mapping", {"mapping": self.mapping}),) if self.mapping else ()
        params = resolve(module.Params, *first, *layers(self.config, self.settings))
        recording: Recording = module.read([Path(source) for source in self.inputs], params)
        return recording


@dataclass(frozen=True, slots=True)
class Task:
    """A file to be written in another format, or to be imported."""

    label: str
    target: Target
    foreign: Import | None = None


def convert(task: Task) -> None:
    """Read a file and write the same content in another format."""
    from .inputs import read, read_any

    if task.foreign is not None:
        _write(task.foreign.read(), task.target)
    else:
        _write(read(DASH) if task.label == DASH else read_any(task.label), task.target)


def decide(task: Task) -> Decision:
    """Whether the file has to be written: not if its content is the same already."""
    from ..formats import stamp
    from . import resume

    if task.foreign is not None or task.label == DASH:
        return resume.decide(replace(task.target, resume=False), dict)

    def expected() -> dict[str, str]:
        return {"content_digest": stamp(Path(task.label))["content_digest"]}

    return resume.decide(task.target, expected)


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
    policy: Policy,
    campaign: Campaign,
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

    if importer:
        inputs, known = campaign.places(inputs), (mapping, config, settings)
        target = plan(output, [PurePath(inputs[0]).stem], form, policy)[0]
        tasks = [Task(inputs[0], campaign.target(target), Import(importer, inputs, *known))]
    elif mapping or config or settings:
        raise ParameterError("--mapping, --config and --set are for imports: name one by --from")
    else:
        if PurePath(output).suffix in SCORES and len(inputs) == 1:
            targets = [policy.target(Path(output), scores_format(output), late=False)]
        else:
            stems = [PurePath(source).stem for source in inputs]
            targets = plan(output, stems, form, policy, late=campaign.keep_going)
        pairs = zip(campaign.places(inputs), map(campaign.target, targets), strict=True)
        tasks = [Task(source, target) for source, target in pairs]
    exits.end(batch.run(convert, tasks, campaign, decide, policy.dry_run).exit_code)

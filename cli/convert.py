"""``echoset convert``: between formats, and from the logs of others."""

from __future__ import annotations

from pathlib import Path, PurePath

import click

from ..campaign.batch.execution import Execution
from ..campaign.files.outputs import Existing, plan, scores_format
from . import options


def _propose(importer: str | None, inputs: tuple[str, ...], output: str | None) -> None:
    """Print the mapping that is proposed for a log."""
    from ..campaign.convert import proposal
    from ..campaign.files.outputs import say
    from ..models.errors import ParameterError

    if importer is None or len(inputs) != 1 or output is not None:
        raise ParameterError("--propose is for one log and --from; it prints to stdout")
    say(proposal(importer, inputs[0]))


@click.command("convert")
@options.inputs("inputs", "IN...")
@click.option(
    "-o",
    "--output",
    type=options.PATH,
    help="File, folder (with a slash at the end) or - for stdout.",
)
@options.data_format
@click.option(
    "--from",
    "importer",
    type=options.Name("echoset.importers"),
    metavar="NAME",
    help="Importer from 'echoset list importers'; all IN make one recording.",
)
@click.option(
    "--mapping", metavar="FILE", help="What columns or messages mean, for --from csv, ros2."
)
@click.option(
    "--propose",
    is_flag=True,
    help="With --from csv, print a mapping with what is recognised in the log, to be edited.",
)
@click.option(
    "--recover",
    is_flag=True,
    help="Of a damaged MCAP file or bag, keep what comes before the damage.",
)
@options.config
@options.settings
@options.existing
@options.batch
@options.logging_options
def command(
    inputs: tuple[str, ...],
    output: str | None,
    form: str | None,
    importer: str | None,
    mapping: str | None,
    propose: bool,
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
    where there is nothing. A file that is whole is converted as ever. So it is with --from ros2.

    With --propose, nothing is converted: a mapping for the log goes to stdout, with marks at what
    was guessed and at what has to be filled in, such as where the anchors stand.

    \b
    echoset convert recording.h5 -o recording.mcap
    echoset convert --from csv log.csv --propose > log.yaml
    echoset convert --from csv log.csv --mapping log.yaml -o recording.h5
    """
    from ..campaign.batch.run import run
    from ..campaign.convert import Import, Recovered, Task
    from ..campaign.files.inputs import SCORES
    from ..models.errors import ParameterError

    if propose:
        return _propose(importer, inputs, output)
    if output is None:
        last = inputs[-1] if len(inputs) > 1 else f"{PurePath(inputs[0]).stem}.h5"
        raise ParameterError(f"Missing option '-o' / '--output': where to write, as in -o {last}")
    if importer:
        foreign = Import(importer, inputs, mapping, config, settings, recover)
        target = plan(output, [PurePath(inputs[0]).stem], form, existing)[0]
        tasks = [Task(inputs[0], target, foreign)]
    elif mapping or config or settings:
        raise ParameterError("--mapping, --config and --set are for imports: name one by --from")
    else:
        if PurePath(output).suffix in SCORES and len(inputs) == 1:
            targets = [existing.target(Path(output), scores_format(output), late=False)]
        else:
            stems = [PurePath(source).stem for source in inputs]
            targets = plan(output, stems, form, existing, late=execution.keep_going)
        alone = len(inputs) == 1
        pairs = zip(inputs, targets, strict=True)
        tasks = [Task(source, target, None, alone, recover) for source, target in pairs]
    run(tasks, execution, existing, whole=Recovered())

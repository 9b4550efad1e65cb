"""``echoset simulate``: recordings from a scenario."""

from __future__ import annotations

import click

from ..campaign.batch.execution import Execution
from ..campaign.files.outputs import DASH, Existing, plan
from . import options


@click.command("simulate")
@click.argument("scenario", type=options.Name("echoset.scenarios"))
@click.option(
    "--runs",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="Number of recordings, each with a random stream of its own.",
)
@click.option(
    "--first-run",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    help="Number of the first of them, for parts of a campaign.",
)
@options.seed
@options.settings
@options.output("File, folder (with a slash at the end) or - for stdout.")
@options.data_format
@options.deps
@options.existing
@options.batch
@options.logging_options
def command(
    scenario: str,
    runs: int,
    first_run: int,
    seed: int,
    settings: tuple[str, ...],
    output: str,
    form: str | None,
    deps: str | None,
    existing: Existing,
    execution: Execution,
) -> None:
    """Simulate recordings of SCENARIO.

    SCENARIO is a name from 'echoset list scenarios' or a YAML file, as 'echoset describe' prints
    it. Recordings are called <scenario>-s<seed>-<run>.

    \b
    echoset simulate uwb-olos --runs 100 -o recordings/
    echoset simulate uwb-olos --set mean_clutter=10 -o cluttered.h5
    """
    from ..campaign.batch.run import run
    from ..campaign.layers import layers
    from ..campaign.scenarios import find
    from ..campaign.simulate import Task
    from ..models.errors import ParameterError
    from ..models.parameters import resolve

    if runs > 1 and output == DASH:
        raise ParameterError("--runs above 1 needs a folder: stdout takes one recording")
    found = find(scenario)
    parameters = resolve(found.module.Params, *found.layers, *layers(None, settings))
    numbers = range(first_run, first_run + runs)
    names = [f"{found.title}-s{seed}-{number:04d}" for number in numbers]
    targets = plan(output, names, form, existing, late=execution.keep_going)
    tasks = [
        Task(name, found, parameters, seed, number, target)
        for name, number, target in zip(names, numbers, targets, strict=True)
    ]
    run(tasks, execution, existing, deps)

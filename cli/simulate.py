"""``echoset simulate``: recordings from a scenario."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import click

from ..campaign.execution import Execution
from ..campaign.outputs import DASH, Existing, Target, plan
from . import options

if TYPE_CHECKING:
    from ..campaign.resume import Decision


@dataclass(frozen=True, slots=True)
class Task:
    """One recording to be simulated."""

    label: str
    scenario: str
    parameters: Any
    seed: int
    run: int
    target: Target


def expected(task: Task) -> dict[str, Any]:
    """Name and provenance of the recording that :func:`simulate` would write."""
    return {"name": task.label, **_provenance(task)}


def decide(task: Task) -> Decision:
    """Whether the recording has to be made."""
    from ..campaign import resume

    return resume.decide(task.target, lambda: expected(task))


def _provenance(task: Task) -> dict[str, Any]:
    from ..formats.provenance import versions
    from ..models.parameters import as_dict

    return {
        "scenario": task.scenario,
        "parameters": as_dict(task.parameters),
        "seed": task.seed,
        "run": task.run,
        "versions": versions(),
    }


def simulate(task: Task) -> None:
    """Simulate one recording and write it."""
    from ..campaign.progress import announce_compilation
    from ..campaign.scenarios import GROUP
    from ..formats import write
    from ..models.random import generator
    from ..models.registry import load

    module = load(GROUP, task.scenario)
    announce_compilation()
    rng = generator(task.seed, "simulate", task.label)
    recording = module.simulate(task.parameters, rng, task.label)
    provenance = {**recording.meta.provenance, **_provenance(task)}
    meta = replace(recording.meta, provenance=provenance)
    with task.target.open() as target:
        write(replace(recording, meta=meta), target, task.target.format)


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
    from ..campaign import batch, exits, makefile
    from ..campaign.layers import layers
    from ..campaign.scenarios import find
    from ..models.errors import ParameterError
    from ..models.parameters import resolve

    if runs > 1 and output == DASH:
        raise ParameterError("--runs above 1 needs a folder: stdout takes one recording")
    found = find(scenario)
    parameters = resolve(found.module.Params, *found.layers, *layers(None, settings))
    numbers = range(first_run, first_run + runs)
    names = [f"{found.title}-s{seed}-{number:04d}" for number in numbers]
    targets = plan(output, names, form, existing, late=execution.keep_going)
    makefile.check(deps, targets, [scenario])
    tasks = [
        Task(name, found.name, parameters, seed, number, execution.target(target))
        for name, number, target in zip(names, numbers, targets, strict=True)
    ]
    done = batch.run(simulate, tasks, execution, decide, existing.dry_run)
    if not existing.dry_run:
        makefile.write(deps, ((targets[k], [found.file]) for k in done.finished))
    exits.end(done.exit_code)

"""``echoset estimate``: an estimator over recordings."""

from __future__ import annotations

from contextlib import suppress
from pathlib import PurePath

import click

from ..campaign.batch.execution import Execution
from ..campaign.files.outputs import DASH, Existing, plan
from . import options


class Command(click.Command):
    """A command whose ``--smooth`` may have a value: only what is a time, never an input."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse, with ``--smooth`` alone as ``--smooth whole``."""
        from ..estimators.kernels.passes import LAG

        alone = [
            i
            for i, word in enumerate(args)
            if word == "--smooth" and not LAG.fullmatch(args[i + 1] if i + 1 < len(args) else "")
        ]
        for i in alone:
            args[i] = "--smooth=whole"
        return super().parse_args(ctx, args)


@click.command("estimate", cls=Command)
@click.option(
    "-e",
    "--estimator",
    required=True,
    type=options.Name("echoset.estimators"),
    help="Name from 'echoset list estimators'.",
)
@options.inputs("inputs", "IN...")
@options.output("File, folder (with a slash at the end) or - for stdout.")
@options.data_format
@click.option("--preset", metavar="NAME", help="Named set of parameters of the estimator.")
@options.config
@options.settings
@options.seed
@click.option(
    "--ignore-sensor-model",
    is_flag=True,
    help="Take no parameters from the recording, as for a study of mismatch.",
)
@click.option(
    "--smooth",
    metavar="[LAG]",
    help="Estimate each time from the whole recording, or from up to LAG later, such as 5s; "
    "--smooth=search seeks better trajectories than the filter's (mbm).",
)
@click.option("--keep", is_flag=True, help="Keep the mixture, particles or samples of every step.")
@click.option(
    "--timing",
    type=options.PATH,
    metavar="FILE",
    help="Write the seconds of every step as scores, .csv, .json or .h5.",
)
@options.deps
@options.existing
@options.batch
@options.logging_options
def command(
    estimator: str,
    inputs: tuple[str, ...],
    output: str,
    form: str | None,
    preset: str | None,
    config: str | None,
    settings: tuple[str, ...],
    seed: int,
    ignore_sensor_model: bool,
    smooth: str | None,
    keep: bool,
    timing: str | None,
    deps: str | None,
    existing: Existing,
    execution: Execution,
) -> None:
    """Run an estimator over the recordings IN.

    The estimates of a recording go into a folder as <stem of IN>.<estimator>.h5, or
    ....<estimator>-smooth.h5. Parameters come, the later winning, from: defaults, --preset, the
    recording's sensor model, --smooth, --config, --set.

    \b
    echoset estimate -e eopda-geo recordings/*.h5 -o estimates/ -j 2
    echoset simulate uwb-olos -o - | echoset estimate -e eopda-geo - -o estimates.h5
    """
    from ..campaign.batch.run import run
    from ..campaign.estimate import Task, Times, chosen
    from ..campaign.layers import layers
    from ..estimators.run import Estimation
    from ..models.errors import InputError, ParameterError
    from ..models.parameters import resolve

    if DASH in inputs and len(inputs) > 1:
        raise ParameterError("stdin holds one recording: '-' is to be the only input")
    user = (*chosen(estimator, preset, smooth, keep), *layers(config, settings))
    asked = Estimation(estimator, user, seed, not ignore_sensor_model)
    with suppress(InputError):
        resolve(asked.module.Params, *user)
    stems = ["stdin" if source == DASH else PurePath(source).stem for source in inputs]
    names = [f"{stem}.{asked.called}" for stem in stems]
    targets = plan(output, names, form, existing, late=execution.keep_going)
    tasks = [
        Task(source, target, asked, len(inputs) == 1, config)
        for source, target in zip(inputs, targets, strict=True)
    ]
    run(tasks, execution, existing, deps, Times(timing, existing))

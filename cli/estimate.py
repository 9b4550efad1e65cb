"""``echoset estimate``: an estimator over recordings."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path, PurePath
from typing import Any

import click

from ..campaign.execution import Execution
from ..campaign.outputs import DASH, Existing, Target, plan, scores_format, single
from . import options


@click.command("estimate")
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
@click.option("--keep", is_flag=True, help="Keep the mixture, particles or samples of every step.")
@click.option(
    "--timing",
    type=click.Path(),
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
    keep: bool,
    timing: str | None,
    deps: str | None,
    existing: Existing,
    execution: Execution,
) -> None:
    """Run an estimator over the recordings IN.

    The estimates of a recording go into a folder as <stem of IN>.<estimator>.h5. Parameters come,
    the later winning, from: defaults, the recording's sensor model, --preset, --config, --set.

    \b
    echoset estimate -e eopda-geo recordings/*.h5 -o estimates/ -j 2
    echoset simulate uwb-olos -o - | echoset estimate -e eopda-geo - -o estimates.h5
    """
    from ..campaign import batch, exits, makefile
    from ..campaign import layers as configuration
    from ..campaign import timing as timings
    from ..campaign.estimate import GROUP, Task, decide, estimate
    from ..formats import scores
    from ..models.errors import InputError, ParameterError
    from ..models.parameters import resolve
    from ..models.registry import load

    if DASH in inputs and len(inputs) > 1:
        raise ParameterError("stdin holds one recording: '-' is to be the only input")
    module = load(GROUP, estimator)
    user = (*_chosen(module, estimator, preset, keep), *configuration.layers(config, settings))
    with suppress(InputError):
        resolve(module.Params, *user)
    stems = ["stdin" if source == DASH else PurePath(source).stem for source in inputs]
    names = [f"{stem}.{estimator}" for stem in stems]
    targets = plan(output, names, form, existing, late=execution.keep_going)
    tasks = [
        Task(source, target, estimator, user, not ignore_sensor_model, seed, len(inputs) == 1)
        for source, target in zip(
            execution.places(inputs), map(execution.target, targets), strict=True
        )
    ]
    makefile.check(deps, targets, inputs)
    sink = _sink(timing, existing) if timing else None
    done = batch.run(estimate, tasks, execution, decide, existing.dry_run)
    if sink and done.results:
        with sink.open() as target:
            scores.write(timings.scores(done.results), target, sink.format)
    if not existing.dry_run:
        makefile.write(deps, ((targets[k], (inputs[k], config)) for k in done.finished))
    exits.end(done.exit_code)


def _sink(timing: str, existing: Existing) -> Target:
    """Where times go; when a campaign is resumed, what is there is in the way of new times only."""
    if existing.skip_existing and timing != DASH:
        return Target(Path(timing), scores_format(timing))
    return single(timing, scores_format(timing), existing.overwrite)


def _chosen(module: Any, estimator: str, preset: str | None, keep: bool) -> Any:
    """The layers that ``--preset`` and ``--keep`` stand for."""
    from ..estimators.presets import preset as named
    from ..models.errors import ParameterError

    if preset is not None:
        yield f"--preset {preset}", named(estimator, preset)
    if keep:
        if "keep" not in module.Params.__dataclass_fields__:
            raise ParameterError(f"{estimator} has nothing that --keep could keep")
        yield "--keep", {"keep": True}

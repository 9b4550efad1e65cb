"""``echoset score``: estimates against the truth."""

from __future__ import annotations

import click

from ..campaign.batch.execution import Execution
from ..campaign.files.outputs import DASH, scores_format, single
from . import options


@click.command("score")
@options.inputs("estimates", "EST...")
@click.option(
    "--truth",
    multiple=True,
    type=options.PATH,
    metavar="FILE|DIR",
    help="Recording of the estimates, or a folder where it is; any number of times.",
)
@click.option(
    "-m",
    "--metrics",
    type=options.Name("echoset.metrics"),
    metavar="NAME,...",
    help="Metrics from 'echoset list metrics'.  [default: all that apply]",
)
@click.option(
    "--align",
    type=click.Choice(["rigid", "time", "both"]),
    help="Fit the truth's frame, its clock or both to the estimates of one object; it is said.",
)
@click.option("--pool", is_flag=True, help="Add rows pooled over the recordings, called *.")
@click.option(
    "--segments",
    metavar="START:STOP,...",
    help="Add aggregates over these spans of time, in seconds, both ends included.",
)
@click.option(
    "--fail-if",
    "gates",
    multiple=True,
    metavar="'METRIC[:PART] > X'",
    help="End with exit code 6 if an aggregate is so; also >= < <=; any number of times.",
)
@options.config
@options.settings
@options.output("Scores, .csv, .json or .h5, or - for CSV on stdout.", default=DASH)
@options.overwrite
@options.deps
@options.batch
@options.logging_options
def command(
    estimates: tuple[str, ...],
    truth: tuple[str, ...],
    metrics: str | None,
    align: str | None,
    pool: bool,
    segments: str | None,
    gates: tuple[str, ...],
    config: str | None,
    settings: tuple[str, ...],
    output: str,
    overwrite: bool,
    deps: str | None,
    execution: Execution,
) -> None:
    """Measure the estimates EST against the truth.

    The recording is the one that came along through a pipe, or is found by its digest among
    --truth. A parameter is set for all metrics that have it by NAME, for one by METRIC.NAME.

    \b
    echoset score estimates/*.h5 --truth recordings/ --pool -o scores.csv
    echoset score est.h5 --truth rec.h5 -m rmse,nees --set rmse.skip=10 -o -
    """
    from ..campaign import layers as configuration
    from ..campaign.batch.run import run
    from ..campaign.score import Table, Task, layers
    from ..metrics import segments as spans
    from ..metrics.gate import Gate
    from ..metrics.protocol import GROUP
    from ..models import registry

    target = single(output, scores_format(output), overwrite)
    limits = tuple(Gate.parse(text) for text in gates)
    bounds = spans.parse(segments) if segments else ()
    names = [name.strip() for name in metrics.split(",")] if metrics else registry.names(GROUP)
    chosen = layers(names, configuration.layers(config, settings))
    asked, alone = bool(metrics), len(estimates) == 1
    tasks = [Task(source, truth, chosen, asked, align, alone) for source in estimates]
    run(tasks, execution, None, deps, Table(target, bounds, pool, limits, config, asked))

"""``echoset cut``: a piece of recordings."""

from __future__ import annotations

from pathlib import PurePath

import click

from ..campaign.batch.execution import Execution
from ..campaign.files.outputs import Existing, plan
from . import options


@click.command("cut")
@options.inputs("recordings", "IN...")
@click.option("--start", type=float, metavar="T", help="First time that is taken, in seconds.")
@click.option("--stop", type=float, metavar="T", help="Last time that is taken, in seconds.")
@click.option("--relative", is_flag=True, help="Times count from the first scan.")
@click.option("--streams", metavar="NAME,...", help="Streams that are taken.  [default: all]")
@click.option(
    "--sensors",
    metavar="NAME,...",
    help="Radars, anchors and devices that are taken.  [default: all]",
)
@click.option("--every", type=int, default=1, metavar="N", help="Take each N-th scan.")
@options.output("File, folder (with a slash at the end) or - for stdout.")
@options.data_format
@options.existing
@options.batch
@options.logging_options
def command(
    recordings: tuple[str, ...],
    start: float | None,
    stop: float | None,
    relative: bool,
    streams: str | None,
    sensors: str | None,
    every: int,
    output: str,
    form: str | None,
    existing: Existing,
    execution: Execution,
) -> None:
    """Take a span of time, streams or sensors out of the recordings IN.

    The truth of that span comes along. Of the link events of a network those are taken whose ends
    are all among --sensors; devices need not be named.

    \b
    echoset cut drive.h5 --relative --start 60 --stop 120 -o minute.h5
    echoset cut uwb.h5 --sensors A1,A2,A3 --every 2 -o three.h5
    """
    from ..campaign.batch.run import run
    from ..campaign.pieces import Cut, Selection

    kept, seen = (tuple(n.strip() for n in t.split(",")) if t else () for t in (streams, sensors))
    selection = Selection(start, stop, relative, kept, seen, every)
    stems = [PurePath(source).stem for source in recordings]
    targets = plan(output, stems, form, existing, late=execution.keep_going)
    tasks = [Cut(s, t, selection) for s, t in zip(recordings, targets, strict=True)]
    run(tasks, execution, existing)

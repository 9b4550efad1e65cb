"""``echoset join``: recordings one after the other as one."""

from __future__ import annotations

from pathlib import PurePath

import click

from ..campaign.batch.execution import Execution
from ..campaign.files.outputs import Existing, plan
from . import options


@click.command("join")
@options.inputs("recordings", "IN...")
@options.output("File, folder (with a slash at the end) or - for stdout.")
@options.data_format
@options.existing
@options.logging_options
def command(recordings: tuple[str, ...], output: str, form: str | None, existing: Existing) -> None:
    """Append the recordings IN, in this order, to one.

    They have the same streams, models and sensors, and follow one another in time; the truth of
    all comes along.

    \b
    echoset join morning.h5 noon.h5 -o day.h5
    """
    from ..campaign.batch.run import run
    from ..campaign.pieces import Join

    (target,) = plan(output, [PurePath(recordings[0]).stem], form, existing)
    run([Join(recordings, target)], Execution(), existing)

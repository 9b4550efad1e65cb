"""``echoset validate``: are files whole, undamaged and within their contract?"""

from __future__ import annotations

import click

from . import options


@click.command("validate")
@click.argument("files", nargs=-1, required=True, metavar="FILE...", type=options.PATH)
@click.option(
    "--strict", is_flag=True, help="Refuse also what is legal but hardly meant, or not as written."
)
@options.logging_options
def command(files: tuple[str, ...], strict: bool) -> None:
    """Say whether FILE is sound.

    Each is read whole and gets a line; the exit code is 4 if any is not sound. Sound is what has
    the digest that it states, units, types and ranges as declared, all times in order, nothing
    unknown and nothing behind its end.

    With --strict, these are refused too: no provenance; no streams or scans; ranges without a word
    on their noise or beyond the longest range. In HDF5, groups and attributes that mean nothing,
    and datasets without checksums. In MCAP, records without checksums, sequence numbers with gaps,
    topics and attachments that are not ours, and messages (also those for viewers) that are not
    byte for byte what the content gives.
    """
    from ..campaign.batch.execution import Execution
    from ..campaign.batch.run import run
    from ..campaign.validate import Task

    tasks = [Task(file, strict, len(files) == 1) for file in files]
    run(tasks, Execution(keep_going=True))

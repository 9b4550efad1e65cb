"""``echoset info``: what files hold, without reading all of it."""

from __future__ import annotations

import json
from pathlib import PurePath

import click

from ..campaign.files.outputs import say
from . import options


@click.command("info")
@click.argument("files", nargs=-1, required=True, metavar="FILE...", type=options.PATH)
@click.option("--json", "as_json", is_flag=True, help="One JSON object a file and line.")
@options.logging_options
def command(files: tuple[str, ...], as_json: bool) -> None:
    """Say what FILE holds.

    Kind, streams, sensors, truth, provenance and digests; only MCAP is read whole for it.
    """
    from ..campaign.info import inspect, lines

    for file in files:
        found = {"file": PurePath(file).name, **inspect(file)}
        say(json.dumps(found, sort_keys=True) if as_json else "\n".join(lines(found)))

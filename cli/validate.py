"""``echoset validate``: are files whole, undamaged and within their contract?"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

from . import options
from .outputs import say

if TYPE_CHECKING:
    from ..models.records import Estimates, Recording, Scores, Stream


@dataclass(frozen=True, slots=True)
class Task:
    """A file to be read whole."""

    label: str
    strict: bool
    target: None = None


def validate(task: Task) -> None:
    """Read a file and say a line of it.

    Raises
    ------
    InputError : it is damaged or breaks its contract; with ``strict`` also where it is doubtful
    """
    from ..models.errors import InputError
    from .inputs import read_any

    record = read_any(task.label)
    for doubt in _doubts(record) if task.strict else ():
        raise InputError(f"{task.label}: {doubt}")
    say(f"{task.label}: ok, {type(record).__name__.lower()}")


def _doubts(record: Recording | Estimates | Scores) -> Iterator[str]:
    """What the contract allows but is hardly meant."""
    from ..models.records import Recording, Scores

    provenance = record.provenance if isinstance(record, Scores) else record.meta.provenance
    if not provenance:
        yield "provenance is empty"
    if isinstance(record, Recording):
        if not record.streams:
            yield "has no streams"
        for name, stream in record.streams.items():
            if not len(stream):
                yield f"streams/{name}: has no scans"
            if stream.kind == "uwb":
                yield from (f"streams/{name}: {doubt}" for doubt in _uwb_doubts(stream))


def _uwb_doubts(stream: Stream) -> Iterator[str]:
    rows, model = stream.rows, stream.model
    if not ({"amplitude", "std"} & rows.keys() or "sigma" in model):
        yield "neither amplitude, std nor sigma tells the noise of the ranges"
    beyond = rows["distance"] > model.get("max_range", float("inf"))
    if beyond.any():
        yield f"rows/distance[{int(beyond.argmax())}]: is beyond max_range"


@click.command("validate")
@click.argument("files", nargs=-1, required=True, metavar="FILE...", type=click.Path())
@click.option("--strict", is_flag=True, help="Refuse also what is legal but hardly meant.")
@options.logging_options
def command(files: tuple[str, ...], strict: bool) -> None:
    """Say whether FILE is sound.

    Each is read whole and gets a line; the exit code is 4 if any is not sound.

    With --strict, these are refused too: no provenance, no streams or scans, ranges without a word
    on their noise or beyond the longest range.
    """
    from . import batch, exits
    from .campaign import Campaign

    tasks = [Task(file, strict) for file in files]
    exits.end(batch.run(validate, tasks, Campaign(keep_going=True)).exit_code)

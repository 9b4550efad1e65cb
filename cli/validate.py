"""``echoset validate``: are files whole, undamaged and within their contract?"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..campaign.outputs import say
from . import options

if TYPE_CHECKING:
    from ..models.records import Stream


@dataclass(frozen=True, slots=True)
class Task:
    """A file to be read whole; ``show`` the progress."""

    label: str
    strict: bool
    show: bool
    target: None = None


def validate(task: Task) -> None:
    """Read a file and say a line of it.

    Raises
    ------
    InputError : it is damaged or breaks its contract; with ``strict`` also where it is doubtful
    """
    from .. import formats
    from ..campaign.inputs import is_scores, read_scores
    from ..models.errors import InputError

    if is_scores(task.label):
        kind, oddities = "scores", [] if read_scores(task.label).provenance else [_UNKNOWN]
    else:
        kind, oddities = _read(task)
        if task.strict and not oddities:
            for where, reason in formats.oddities(Path(task.label)):
                raise InputError(f"{task.label}: {where}: {reason}")
    if task.strict and oddities:
        raise InputError(f"{task.label}: {oddities[0]}")
    say(f"{task.label}: ok, {kind}")


_UNKNOWN = "provenance is empty"


def _read(task: Task) -> tuple[str, list[str]]:
    """The kind of a record that is sound, and what the contract allows but is hardly meant."""
    from .. import formats
    from ..campaign.progress import share
    from ..models.records import Recording

    kinds, oddities = [], list[str]()
    for recording in (False, True):
        with closing(formats.open_windows(Path(task.label), recording=recording)) as parts:
            scans: Counter[str] = Counter()
            for window in share(parts, parts) if task.show else parts:
                for name, stream in getattr(window, "streams", {}).items():
                    scans[name] += len(stream)
                    if task.strict and stream.kind == "uwb" and len(oddities) < 1:
                        oddities += [f"streams/{name}: {doubt}" for doubt in _uwb_doubts(stream)]
            kinds.append(type(parts.head).__name__.lower())
            if not parts.head.meta.provenance:
                oddities.append(_UNKNOWN)
            if isinstance(parts.head, Recording):
                if not parts.head.streams:
                    oddities.append("has no streams")
                oddities += [
                    f"streams/{name}: has no scans"
                    for name in parts.head.streams
                    if not scans[name]
                ]
            if not parts.has_recording:
                break
    return kinds[0], oddities


def _uwb_doubts(stream: Stream) -> Iterator[str]:
    rows, model = stream.rows, stream.model
    if not ({"amplitude", "std"} & rows.keys() or "sigma" in model):
        yield "neither amplitude, std nor sigma tells the noise of the ranges"
    beyond = rows["distance"] > model.get("max_range", float("inf"))
    if beyond.any():
        i = int(beyond.argmax())
        scan = int((stream.row_offset[1:] <= i).sum())
        place = f"rows/distance at {stream.time_ns[scan]} ns"
        yield f"{place}: {rows['distance'][i]} is beyond max_range"


@click.command("validate")
@click.argument("files", nargs=-1, required=True, metavar="FILE...", type=click.Path())
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
    from ..campaign import batch, exits
    from ..campaign.execution import Execution

    tasks = [Task(file, strict, len(files) == 1) for file in files]
    exits.end(batch.run(validate, tasks, Execution(keep_going=True)).exit_code)

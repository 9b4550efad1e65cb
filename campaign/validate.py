"""Is a file whole, undamaged and within its contract: what ``echoset validate`` does with it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from .. import formats
from ..formats import scores
from ..models.errors import InputError
from ..models.names import printable
from ..models.records import Recording, Stream
from .batch.execution import Execution
from .files.inputs import is_scores, label, spooled
from .files.outputs import say
from .progress import share

_UNKNOWN = "provenance is empty"


@dataclass(frozen=True, slots=True)
class Task:
    """A file to be read whole; ``show`` the progress."""

    label: str
    strict: bool
    show: bool
    target: None = None

    @property
    def sources(self) -> tuple[str]:
        """The file."""
        return (self.label,)

    def placed(self, execution: Execution) -> Task:
        """The task itself: it is done here."""
        return self

    def decide(self) -> None:
        """It is always done."""

    def run(self) -> None:
        """Read the file and say a line of it.

        Raises
        ------
        InputError : it is damaged or breaks its contract; with ``strict`` also where it is doubtful
        """
        with spooled(self.label) as path:
            if is_scores(path, self.label):
                found = scores.read(path, label(self.label)).provenance
                kind, oddities = "scores", [] if found else [_UNKNOWN]
            else:
                kind, oddities = _read(self, path)
                if self.strict and not oddities:
                    for where, reason in formats.oddities(path):
                        raise InputError(f"{self.label}: {where}: {reason}")
        if self.strict and oddities:
            raise InputError(f"{self.label}: {oddities[0]}")
        say(f"{printable(self.label)}: ok, {kind}")


def _read(task: Task, path: Path) -> tuple[str, list[str]]:
    """The kind of a record that is sound, and what the contract allows but is hardly meant."""
    kinds, oddities = [], list[str]()
    for recording in (False, True):
        with closing(formats.open_windows(path, label(task.label), recording)) as windows:
            scans: Counter[str] = Counter()
            for window in share(windows, windows) if task.show else windows:
                for name, stream in getattr(window, "streams", {}).items():
                    scans[name] += len(stream)
                    if task.strict and stream.kind == "uwb" and len(oddities) < 1:
                        oddities += [f"streams/{name}: {doubt}" for doubt in _uwb_doubts(stream)]
            kinds.append(type(windows.head).__name__.lower())
            if not windows.head.meta.provenance:
                oddities.append(_UNKNOWN)
            if isinstance(windows.head, Recording):
                if not windows.head.streams:
                    oddities.append("has no streams")
                oddities += [
                    f"streams/{name}: has no scans"
                    for name in windows.head.streams
                    if not scans[name]
                ]
            if not windows.has_recording:
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

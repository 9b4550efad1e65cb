"""Reading MCAP files in windows of time."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

from mcap.records import Message

from ...models.checks import check
from ...models.errors import FormatError
from ...models.records import Estimates, Recording
from .. import layout
from .. import tree as trees
from ..steps import WINDOW
from ..watch import Watch
from .reader import ERRORS, TRAILER, Pass, decode, reason, value
from .records import metadata
from .tables import Table


def _provenance(file: IO[bytes], path: object) -> Any:
    """The provenance of each record, found without reading the rest and so not yet verified."""
    try:
        start = file.tell()
        trailer = metadata(file, TRAILER)
        file.seek(start)
        if trailer is None:
            raise ValueError("not a file of echoset")
        return value(trailer["provenance"])
    except ERRORS as error:
        raise FormatError(path, "summary", reason(error)) from error


class Windows:
    """A record that is read in windows of time; ``carried``: the recording beside estimates.

    ``head`` is the record without steps or scans. Where ``scans`` are not wanted the streams stay
    empty, but they are read all the same: the file is one stream, and verified whole.
    """

    unit = "B"

    def __init__(
        self, source: Path | IO[bytes], path: object, carried: bool = False, scans: bool = True
    ) -> None:
        self.path, self._scans, self._carried = path, scans, int(carried)
        self._file = source.open("rb") if isinstance(source, Path) else source
        try:
            provenance = _provenance(self._file, path)
            self.carries = "recording" in provenance
            self._provenance = str(provenance["recording" if carried else ""])
            self._pass = Pass(self._file, path, (self._carried,), scans)
            self._messages = self._own()
            self._first = next(self._messages, None)
            self._section = self._pass.sections[self._carried]
            self.head = self._window()
            check(self.head, path)
        except (LookupError, TypeError) as error:
            self.close()
            raise FormatError(path, TRAILER, "does not tell of its content") from error
        except BaseException:
            self.close()
            raise

    def _own(self) -> Iterator[tuple[Table, Message]]:
        """The messages of the record; the file's others are but taken note of."""
        for section, table, message in self._pass.messages():
            if self._pass.sections.index(section) != self._carried:
                decode(section, table, message, self.path)
            else:
                yield table, message

    def _window(self) -> Recording | Estimates:
        """The record of what came since the last window."""
        tree = trees.unflatten(self._section.leaves())
        return layout.from_tree({**tree, "provenance": self._provenance}, self.path)

    @property
    def progress(self) -> tuple[int, int]:
        """Bytes that were read, and that there are."""
        return self._pass.records.progress

    def __iter__(self) -> Iterator[Recording | Estimates]:
        """The windows in order; FormatError where damage shows, at the end at the latest."""
        watch, count, last = Watch(self.path), 0, -1
        while self._first is not None:
            table, message = self._first
            if count >= WINDOW and message.log_time != last:
                yield self._checked(watch)
                count = 0
            if self._scans or not table.group.startswith("streams/"):
                count += table.primary
            decode(self._section, table, message, self.path)
            last = message.log_time
            self._first = next(self._messages, None)
        trailer = value(self._pass.trailer["provenance"])
        if trailer["recording" if self._carried else ""] != self._provenance:
            raise FormatError(self.path, "summary", "does not fit the content")
        yield self._checked(watch)

    def _checked(self, watch: Watch) -> Recording | Estimates:
        record = self._window()
        watch.check(record)
        return record

    def close(self) -> None:
        """Close the file."""
        self._file.close()

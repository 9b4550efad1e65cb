"""Reading MCAP files in windows of time, whole ones and the sound beginning of damaged ones."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path
from typing import IO, Any

from ...models.checks import WindowChecks, check
from ...models.errors import FormatError
from ...models.records import Estimates, Meta, Recording
from .. import leaves, windows
from ..damage import damage
from .container import HEADER, ending, value
from .reader import Item, Pass, Section


class Windows:
    """A record that is read in windows of time, or with ``recording`` that beside estimates.

    ``head`` is the record without steps or scans, from a pipe also without its provenance.
    """

    unit = "B"

    def __init__(
        self,
        source: Path | IO[bytes],
        path: object,
        recording: bool = False,
        size: int | None = None,
    ) -> None:
        self.path, self._size = path, size or windows.WINDOW
        self.messages = 0
        self._own, self._name = int(recording), "recording" * recording
        self._owned = isinstance(source, Path)
        with damage(path, ""):
            self._file = source.open("rb") if isinstance(source, Path) else source
        try:
            self._known = self._ahead()
            self.has_recording = "recording" in (self._known or {})
            if recording and not self.has_recording:
                raise FormatError(path, "recording", "holds no recording beside estimates")
            self._pass = Pass(self._file, path, self._kept())
            self._items = self._begun(self._pass.messages())
            self.head = self._record(self._section)
            check(self.head, path)
        except BaseException:
            self.close()
            raise

    def _kept(self) -> tuple[int, ...]:
        """The sections whose content is kept."""
        return (self._own,)

    def _ahead(self) -> dict[str, str] | None:
        """The provenance of each record, read ahead and so not yet verified; from a pipe None.

        Where the end is damaged it is empty: the pass over the file says what is wrong.
        """
        if not self._file.seekable():
            return None
        start = self._file.tell()
        try:
            with damage(self.path, "summary"):
                trailer = ending(self._file)[1]
                return {str(name): str(text) for name, text in value(trailer["provenance"]).items()}
        except FormatError:
            return {}
        finally:
            self._file.seek(start)

    def _begun(self, items: Iterator[Item]) -> Iterator[Item]:
        """``items``, as soon as the header of the record has been read."""
        for item in items:
            if len(self._pass.sections) > self._own:
                return chain((item,), items)
            self._feed([item])
        if len(self._pass.sections) <= self._own:
            raise FormatError(self.path, HEADER, "is missing")
        return iter(())

    @property
    def _section(self) -> Section:
        return self._pass.sections[self._own]

    def _feed(self, items: list[Item]) -> None:
        section, table, message = items[-1]
        with damage(self.path, f"{table.topic} at {message.log_time} ns"):
            section.feed([(table, message) for _, table, message in items])

    def _record(self, section: Section) -> Any:
        """The record of what came since the last time."""
        named = {"estimator": section.estimator} if section.estimator else {}
        provenance = (self._known or {}).get(self._name, json.dumps(named))
        return leaves.record({**section.leaves(), "provenance": provenance}, self.path)

    @property
    def meta(self) -> Meta:
        """What the record is called and where it comes from, once all windows are out."""
        meta: Meta = self.head.meta
        if self._known is not None:
            return meta
        text = self._pass.provenance[self._name]
        return replace(meta, provenance=leaves.provenance(text, self.path))

    @property
    def digests(self) -> dict[str, str]:
        """The digests of all leaves by path, once all windows are out."""
        return self._pass.digests()

    @property
    def progress(self) -> tuple[int, int]:
        """Bytes that were read, and that there are; 0 where nobody knows."""
        return self._pass.records.progress

    def __iter__(self) -> Iterator[Recording | Estimates]:
        """The windows in order; FormatError where damage shows, at the end at the latest."""
        checks, count, last = WindowChecks(self.path), 0, -1
        for section, _, message in self._taken_in():
            if section is not self._section:
                continue
            if count >= self._size and message.log_time != last:
                yield self._checked(checks)
                count = 0
            count += 1
            last = message.log_time
        if self._known is not None and self._pass.provenance != self._known:
            raise FormatError(self.path, "summary", "does not fit the content")
        yield self._checked(checks)

    def _taken_in(self) -> Iterator[Item]:
        """The primary messages, each taken in when the next is asked for.

        It is taken in with the values of its scan, which come before.

        Raises
        ------
        FormatError : damage; the values of a scan are not there; or time goes back
        """
        waiting: list[Item] = []
        last = -1
        for item in self._items:
            section, table, message = item
            waiting.append(item)
            if table.primary:
                if tuple(t for _, t, _ in waiting) != section.groups[table.group]:
                    where = f"{table.group} at {message.log_time} ns"
                    reason = "the values of the scan do not fit its stream"
                    raise FormatError(self.path, where, reason)
                if section is self._section:
                    if message.log_time < last:
                        where = f"{table.topic} at {message.log_time} ns"
                        raise FormatError(self.path, where, f"is out of order after {last}")
                    last = message.log_time
                yield item
                self._feed(waiting)
                waiting = []
                self.messages += 1

    def _checked(self, checks: WindowChecks) -> Recording | Estimates:
        window: Recording | Estimates = self._record(self._section)
        checks.check(window)
        return window

    def close(self) -> None:
        """Close the file."""
        if self._owned:
            self._file.close()


class Rescue(Windows):
    """What comes before the damage in the file ``path``.

    ``damage`` and the number of ``messages`` that were kept are known once all windows are out;
    so are ``meta``, whose provenance says that the record is recovered, and the ``recording`` that
    travels along.
    """

    def __init__(self, path: Path) -> None:
        self.damage: FormatError | None = None
        super().__init__(path, path)

    def _kept(self) -> tuple[int, ...]:
        return 0, 1

    def _ahead(self) -> None:
        return None

    def _taken_in(self) -> Iterator[Item]:
        try:
            yield from super()._taken_in()
        except FormatError as error:
            self.damage = error
        if not self.messages:
            raise self.damage or FormatError(self.path, "end of file", "there are no messages")

    @property
    def meta(self) -> Meta:
        """What the record is called, and that it is recovered."""
        meta: Meta = self.head.meta
        said: dict[str, Any] = {"file": Path(str(self.path)).name, "messages": self.messages}
        if self.damage is not None:
            said["damage"] = f"{self.damage.where}: {self.damage.reason}"
        known = meta.provenance
        if self._pass.trailer:
            known = {**known, **leaves.provenance(self._pass.provenance[""], self.path)}
        return replace(meta, provenance={**known, "recovered": said})

    @property
    def recording(self) -> Recording | None:
        """The recording that travels along, as far as it goes."""
        if len(self._pass.sections) < 2:
            return None
        record: Recording = self._record(self._pass.sections[1])
        check(record, self.path)
        return replace(record, meta=replace(record.meta, provenance=self.meta.provenance))

"""What can be had of a damaged MCAP file: all complete messages before the first damage."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from mcap.records import Message

from ...models.errors import FormatError
from ...models.records import Estimates, Meta, Recording
from .. import layout
from .. import tree as trees
from ..steps import WINDOW
from ..watch import Watch
from .reader import Pass, Section, decode
from .tables import Table


class Rescue:
    """The record of the damaged file ``path`` in windows of time, as far as it goes.

    ``damage`` and the number of ``messages`` that were kept are known once all windows are out;
    so are ``meta``, whose provenance says that the record is recovered, and the ``recording`` that
    was carried along.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.messages = path, 0
        self.damage: FormatError | None = None
        self._file = path.open("rb")
        self._pass = Pass(self._file, path, (0, 1))

    def __iter__(self) -> Iterator[Recording | Estimates]:
        """The windows in order.

        Raises
        ------
        FormatError : there is nothing to be had, or it breaks the contract of records
        """
        watch, count, last = Watch(self.path), 0, -1
        for section, table, message in self._sound():
            first = section is self._pass.sections[0]
            if first and count >= WINDOW and message.log_time != last:
                yield self._window(watch)
                count = 0
            self.messages += 1
            count += first and table.primary
            last = message.log_time
        if not self.messages:
            raise self.damage or FormatError(self.path, "end of file", "there are no messages")
        yield self._window(watch)

    def _sound(self) -> Iterator[tuple[Section, Table, Message]]:
        """The messages before the damage, each taken in when the next is asked for.

        Values of a scan are taken in with the message of its detections, if that is there.
        """
        waiting: list[tuple[Section, Table, Message]] = []
        try:
            for item in self._pass.messages():
                waiting.append(item)
                if item[1].primary:
                    yield item
                    for section, table, message in waiting:
                        decode(section, table, message, self.path)
                    waiting = []
        except FormatError as error:
            self.damage = error

    def _window(self, watch: Watch) -> Recording | Estimates:
        window: Recording | Estimates = self._record(self._pass.sections[0])
        watch.check(window)
        return window

    def _record(self, section: Section) -> Any:
        tree = trees.unflatten(section.leaves())
        return layout.from_tree({**tree, "provenance": layout.json_of(self._provenance)}, self.path)

    @property
    def _provenance(self) -> dict[str, Any]:
        name, trailer = self._pass.sections[0].estimator, self._pass.trailer
        known: dict[str, Any] = json.loads(json.loads(trailer["provenance"])[""]) if trailer else {}
        said: dict[str, Any] = {"file": self.path.name, "messages": self.messages}
        if self.damage is not None:
            said["damage"] = f"{self.damage.where}: {self.damage.reason}"
        named = {"estimator": name} if name else {}
        return {**named, **known, "recovered": said}

    @property
    def meta(self) -> Meta:
        """What the record is called, and that it is recovered."""
        found: Meta = self._record(self._pass.sections[0]).meta
        return replace(found, provenance=self._provenance)

    @property
    def recording(self) -> Recording | None:
        """The recording that was carried along, as far as it goes."""
        if len(self._pass.sections) < 2:
            return None
        record: Recording = self._record(self._pass.sections[1])
        Watch(self.path).check(record)
        return record

    def close(self) -> None:
        """Close the file."""
        self._file.close()

"""Windows of time for formats that read and write only whole records."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

from ..models.errors import FormatError
from ..models.records import Estimates, Meta, Recording
from . import leaves
from .windows import NONE, between, concatenate, spans, times


class WholeWindows:
    """The windows of ``record``, or with ``recording`` of the one that travels with estimates."""

    unit = "step"

    def __init__(
        self,
        record: Recording | Estimates,
        path: object,
        recording: bool = False,
        size: int | None = None,
    ) -> None:
        self._done, self._size = 0, size
        self.digests = leaves.digests(leaves.of(record))
        beside = record.recording if isinstance(record, Estimates) else None
        self.has_recording = beside is not None
        if recording and beside is None:
            raise FormatError(path, "recording", "holds no recording beside estimates")
        self._whole = record if beside is None or not recording else beside
        if isinstance(self._whole, Estimates):
            self._whole = replace(self._whole, recording=None)
        self.head = between(self._whole, *NONE)

    @property
    def meta(self) -> Meta:
        """What the record is called and where it comes from."""
        return self.head.meta

    @property
    def progress(self) -> tuple[int, int]:
        """Scans and times of truth, or steps, that are out, and that there are."""
        return self._done, sum(map(len, times(self._whole)))

    def __iter__(self) -> Iterator[Recording | Estimates]:
        """The windows in order."""
        for first, last in spans(times(self._whole), self._size):
            window: Recording | Estimates = between(self._whole, first, last)
            yield window
            self._done += sum(map(len, times(window)))

    def close(self) -> None:
        """Nothing is open."""


class WholeWriter:
    """Gathers the windows of a record, and has ``write`` put it whole into ``target``."""

    def __init__(
        self, write: Callable[[Any, Path | IO[bytes]], None], target: Path | IO[bytes]
    ) -> None:
        self._write, self._target = write, target
        self._windows: list[Any] = []

    def append(self, window: Recording | Estimates) -> None:
        """Take the next window; sensors and models are those of the first."""
        self._windows.append(window)

    def close(self, meta: Meta, recording: Recording | None = None) -> None:
        """Write the file with its ``meta`` and the recording that travels along, if any."""
        record = replace(concatenate(self._windows), meta=meta)
        if isinstance(record, Estimates):
            record = replace(record, recording=recording)
        self._write(record, self._target)

    def abort(self) -> None:
        """Nothing is open."""

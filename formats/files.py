"""Reading and writing records, whatever the format: found by magic bytes or by suffix."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any, Protocol

from ..models import registry
from ..models.checks import check
from ..models.errors import FormatError, ParameterError
from ..models.records import Estimates, Meta, Recording, Scan
from . import layout
from .foreign import hint
from .whole import WholeWindows, WholeWriter

GROUP = "echoset.formats"
Target = Path | IO[bytes]


class Source(Protocol):
    """A recording that is read scan by scan."""

    setup: Recording
    unit: str

    @property
    def progress(self) -> tuple[int, int]:
        """How much was read so far in this unit, and how much there is; 0 where nobody knows."""

    @property
    def observed_digest(self) -> str:
        """Digest of what estimators may see, known once all scans are out."""

    def scans(self) -> Iterator[Scan]:
        """All scans in order; FormatError where damage shows, at the end at the latest."""

    def recording(self) -> Recording | None:
        """The whole recording, truth included, where it was asked to be kept."""

    def close(self) -> None:
        """Close the file."""


class Windows(Protocol):
    """A record that is read in windows of time; ``head`` is the record without any of them.

    ``carries`` tells whether the file holds estimates and their recording.
    """

    head: Any
    carries: bool
    unit: str

    @property
    def progress(self) -> tuple[int, int]:
        """How much was read so far in this unit, and how much there is."""

    def __iter__(self) -> Iterator[Any]:
        """The windows in order; FormatError where damage shows, at the end at the latest."""

    def close(self) -> None:
        """Close the file."""


class Rescue(Protocol):
    """The sound beginning of a damaged file; all but its windows is known once they are out."""

    damage: FormatError | None
    messages: int

    @property
    def meta(self) -> Meta:
        """What the record is called, and that it is recovered."""

    @property
    def recording(self) -> Recording | None:
        """The recording that estimates carried along, as far as it goes."""

    def __iter__(self) -> Iterator[Any]:
        """The windows in order; FormatError where nothing can be had."""

    def close(self) -> None:
        """Close the file."""


class RecordingWriter(Protocol):
    """Writes a recording window by window of time."""

    def append(self, window: Recording) -> None:
        """Take the next scans and truth; sensors and models are those of the first window."""

    def close(self, meta: Meta) -> None:
        """Finish the file with its ``meta``."""

    def abort(self) -> None:
        """Close the file as it is."""


class EstimatesWriter(Protocol):
    """Writes estimates step by step."""

    def append(self, estimates: Estimates) -> None:
        """Take the next steps; their provenance names the estimator."""

    def close(self, meta: Meta, recording: Recording | None = None) -> None:
        """Finish the file with its provenance and the recording that travels along, if any."""

    def abort(self) -> None:
        """Close the file as it is."""


def _identify(source: Target, path: object) -> tuple[Any, Target]:
    """The format module of a file by its magic bytes, and the source to read from."""
    try:
        if isinstance(source, Path):
            with source.open("rb") as file:
                head = file.read(8)
        else:
            if not source.seekable() and not hasattr(source, "peek"):
                source = io.BytesIO(source.read())
            head = source.read(8) if source.seekable() else _peek(source)
            if source.seekable():
                source.seek(-len(head), io.SEEK_CUR)
    except OSError as error:
        raise FormatError(path, "", (error.strerror or str(error)) + hint(source)) from error
    for name in registry.names(GROUP):
        module = registry.load(GROUP, name)
        if head.startswith(module.MAGIC):
            if name == "h5" and not isinstance(source, Path) and not source.seekable():
                source = io.BytesIO(source.read())
            return module, source
    if not head:
        raise FormatError(path, "byte 0", "the file is empty")
    raise FormatError(path, "byte 0", "neither HDF5 nor MCAP" + hint(source))


def _peek(source: Any) -> bytes:
    """The next 8 bytes of a buffered stream, which stay to be read."""
    return bytes(source.peek(8)[:8])


def _name(source: Target, path: object) -> object:
    return path if path is not None else source if isinstance(source, Path) else "<stream>"


def read(source: Target, path: object = None) -> Recording | Estimates:
    """Read and verify a record from a path or binary file.

    Raises
    ------
    FormatError : it cannot be read, is damaged or of another kind
    """
    path = _name(source, path)
    module, source = _identify(source, path)
    record: Recording | Estimates = module.read(source, path)
    return record


def open_source(source: Target, path: object = None, keep: bool = False) -> Source:
    """Open a recording for reading scan by scan; ``keep`` it whole for :meth:`recording`.

    Raises
    ------
    FormatError : it cannot be read, is damaged or holds no recording
    """
    path = _name(source, path)
    module, source = _identify(source, path)
    opened: Source = module.Source(source, path, keep)
    return opened


def summary(source: Target, path: object = None) -> dict[str, Any]:
    """Digests, attributes and shapes of a file.

    Raises
    ------
    FormatError : it cannot be read, is damaged or of another kind
    """
    path = _name(source, path)
    module, source = _identify(source, path)
    found: dict[str, Any] = module.summary(source, path)
    return found


def header(path: Path) -> dict[str, Any]:
    """What a file says of itself: ``format``, ``kind``, digests, name and provenance.

    Of the data nothing is read, so that damage there does not show; a file that was cut does.

    Raises
    ------
    FormatError : it cannot be read, is damaged or of another kind
    """
    module, source = _identify(path, path)
    name = next(n for n in registry.names(GROUP) if registry.load(GROUP, n) is module)
    found = getattr(module, "header", module.summary)(source, path)
    try:
        provenance = json.loads(found["provenance"])
        return {**provenance, **found, "format": name, "provenance": provenance}
    except (KeyError, TypeError, ValueError, RecursionError) as error:
        raise FormatError(path, "provenance", "cannot be read") from error


def open_windows(source: Target, path: object = None, carried: bool = False, **how: Any) -> Windows:
    """Open a record for reading in windows of time; ``carried``: the recording beside estimates.

    ``source`` can seek. A format without windows of its own is read whole.

    Raises
    ------
    FormatError : it cannot be read, is damaged or of another kind
    """
    path = _name(source, path)
    module, source = _identify(source, path)
    if not hasattr(module, "Windows"):
        return WholeWindows(module.read(source, path), path, carried, **how)
    parts: Windows = module.Windows(source, path, carried, **how)
    return parts


def oddities(path: Path) -> Iterator[tuple[str, str]]:
    """Places in a sound file, and what is strange there though it changes no content.

    Raises
    ------
    FormatError : it cannot be read, is damaged or of another kind
    """
    module, _ = _identify(path, path)
    found: Iterator[tuple[str, str]] = (
        module.oddities(path) if hasattr(module, "oddities") else iter(())
    )
    return found


def rescue(path: Path) -> Rescue:
    """What can be had of a damaged file.

    Raises
    ------
    FormatError : it is of a format of which nothing can be had
    """
    module, _ = _identify(path, path)
    if not hasattr(module, "rescue"):
        raise FormatError(path, "byte 0", "only MCAP can be recovered: other files are lost")
    found: Rescue = module.rescue(path)
    return found


def suffix_format(path: Path, default: str | None = None) -> str:
    """Name of the format that the suffix of ``path`` stands for.

    Raises
    ------
    ParameterError : no format has this suffix and there is no default
    """
    for name in registry.names(GROUP):
        if path.suffix in registry.load(GROUP, name).SUFFIXES:
            return name
    if default is None:
        raise ParameterError(f"{path}: no format has the suffix {path.suffix!r}: use .h5 or .mcap")
    return default


def write(record: Recording | Estimates, target: Target, format: str) -> None:
    """Check and write a record whole. Not atomic by itself.

    Raises
    ------
    FormatError : the record breaks its contract
    """
    check(record)
    registry.load(GROUP, format).write(record, target)


def estimates_writer(target: Target, format: str) -> EstimatesWriter:
    """A writer that takes estimates step by step. Not atomic by itself."""
    writer: EstimatesWriter = registry.load(GROUP, format).EstimatesWriter(target)
    return writer


def recording_writer(target: Target, format: str) -> RecordingWriter:
    """A writer that takes a recording window by window. Not atomic by itself."""
    module = registry.load(GROUP, format)
    if not hasattr(module, "RecordingWriter"):
        return WholeWriter(module.write, target)
    writer: RecordingWriter = module.RecordingWriter(target)
    return writer


def observed_digest(record: Recording | Path) -> str:
    """Digest of what an estimator may see: equal with and without truth.

    Raises
    ------
    FormatError : the file cannot be read, is damaged or of another kind
    """
    if isinstance(record, Path):
        return str(summary(record)["observed_digest"])
    return layout.observed_digest(record)


def content_digest(record: Recording | Estimates) -> str:
    """Digest of all that ``record`` holds, as its files state it."""
    return layout.content_digest(record)

"""Reading and writing records, whatever the format: found by magic bytes or by suffix.

A format is five names: ``SUMMARY``, ``SUFFIXES``, ``MAGIC``, ``windows`` and ``Writer``. All that
is done with files follows from them here. One that knows whole records only has ``read`` and
``write`` in place of the last two.
"""

from __future__ import annotations

import io
import stat
import sys
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import IO, Any, Protocol

import numpy as np

from ..models import registry
from ..models.checks import check
from ..models.errors import FormatError, ParameterError
from ..models.records import Estimates, Meta, Recording, Scan
from . import leaves
from .damage import damage
from .foreign import hint, is_bag
from .whole import WholeWindows, WholeWriter
from .windows import concatenate, windows

GROUP = "echoset.formats"
Target = Path | IO[bytes]


class Windows(Protocol):
    """A record that is read in windows of time; ``head`` is the record without any of them.

    ``has_recording`` tells whether the file holds estimates and their recording. The ``digests`` of
    all leaves of the file, and the ``meta`` of the record, are known once all windows are out.
    """

    head: Any
    has_recording: bool
    unit: str

    @property
    def digests(self) -> dict[str, str]:
        """The digests of all leaves by path."""

    @property
    def meta(self) -> Meta:
        """What the record is called and where it comes from."""

    @property
    def progress(self) -> tuple[int, int]:
        """How much was read so far in this unit, and how much there is; 0 where nobody knows."""

    def __iter__(self) -> Iterator[Any]:
        """The windows in order, checked; FormatError for damage, at the end at the latest."""

    def close(self) -> None:
        """Close the file."""


class Rescue(Windows, Protocol):
    """The sound beginning of a damaged file: its ``damage``, and the ``messages`` before."""

    damage: FormatError | None
    messages: int

    @property
    def recording(self) -> Recording | None:
        """The recording that travels with estimates, as far as it goes."""


class Writer(Protocol):
    """Writes a record window by window of time."""

    def append(self, window: Recording | Estimates) -> None:
        """Take the next scans and truth, or steps; sensors and models are those of the first.

        The provenance of estimates names the estimator.
        """

    def close(self, meta: Meta, recording: Recording | None = None) -> None:
        """Finish the file with its ``meta`` and the recording that travels along, if any."""

    def abort(self) -> None:
        """Close the file as it is."""


class Source:
    """A recording that is read scan by scan, and with ``keep`` whole besides.

    ``setup`` is what an estimator knows before; ``unit`` counts the ``progress``.
    """

    def __init__(self, found: Windows, path: object, keep: bool) -> None:
        self._windows, self._keep = found, keep
        self._kept: list[Recording] = []
        self.unit = found.unit
        if not isinstance(found.head, Recording):
            raise FormatError(path, "kind", "holds no recording")
        self.setup = found.head.setup()

    @property
    def progress(self) -> tuple[int, int]:
        """How much was read so far, and how much there is; 0 where nobody knows."""
        return self._windows.progress

    @property
    def observed_digest(self) -> str:
        """Digest of what estimators may see, known once all scans are out."""
        return str(leaves.header(self._windows.digests)["observed_digest"])

    def scans(self) -> Iterator[Scan]:
        """All scans in order; FormatError where damage shows, at the end at the latest."""
        for window in self._windows:
            if self._keep:
                self._kept.append(window)
            yield from window.scans()

    def recording(self) -> Recording | None:
        """The whole recording, truth included, where it was asked to be kept."""
        return replace(concatenate(self._kept), meta=self._windows.meta) if self._keep else None

    def close(self) -> None:
        """Close the file."""
        self._windows.close()


def _identify(source: Target, path: object) -> tuple[Any, str]:
    """The format module of a file by its magic bytes, and its name."""
    with damage(path, ""):
        if isinstance(source, Path):
            if source.is_dir():
                raise FormatError(path, "", f"Is a directory{hint(source)}")
            if stat.S_ISFIFO(source.stat().st_mode):
                raise FormatError(path, "", "is a pipe: it can be read only once")
            with source.open("rb") as file:
                head = file.read(64)
            if is_bag(head):
                raise FormatError(path, "byte 0", f"a bag of ROS 2{hint(source)}")
        elif source.seekable():
            head = source.read(8)
            source.seek(-len(head), io.SEEK_CUR)
        else:
            peeked: Any = source
            head = bytes(peeked.peek(8)[:8])
    for name in registry.names(GROUP):
        module = registry.load(GROUP, name)
        if head.startswith(module.MAGIC):
            return module, name
    if not head:
        raise FormatError(path, "byte 0", "the file is empty")
    raise FormatError(path, "byte 0", f"neither HDF5 nor MCAP{hint(source)}")


def _name(source: Target, path: object) -> object:
    return path if path is not None else source if isinstance(source, Path) else "<stream>"


def open_windows(
    source: Target,
    path: object = None,
    recording: bool = False,
    size: int | None = None,
) -> Windows:
    """Open a record for reading in windows of ``size`` steps or scans, or more.

    With ``recording`` it is that beside estimates.

    Raises
    ------
    FormatError : it cannot be read, is damaged or of another kind
    """
    path = _name(source, path)
    module, _ = _identify(source, path)
    if not hasattr(module, "windows"):
        return WholeWindows(module.read(source, path), path, recording, size)
    found: Windows = module.windows(source, path, recording, size)
    return found


def open_source(source: Target, path: object = None, keep: bool = False) -> Source:
    """Open a recording for reading scan by scan; ``keep`` it whole for :meth:`Source.recording`.

    Raises
    ------
    FormatError : it cannot be read, is damaged or holds no recording
    """
    path = _name(source, path)
    found = open_windows(source, path)
    try:
        return Source(found, path, keep)
    except BaseException:
        found.close()
        raise


def read(source: Target, path: object = None) -> Recording | Estimates:
    """Read and verify a record from a path or binary file.

    Raises
    ------
    FormatError : it cannot be read, is damaged or of another kind
    """
    path = _name(source, path)
    if not isinstance(source, Path) and not source.seekable():
        source = io.BytesIO(source.read())
    start = 0 if isinstance(source, Path) else source.tell()

    def whole(recording: bool) -> tuple[Any, bool]:
        if not isinstance(source, Path):
            source.seek(start)
        with closing(open_windows(source, path, recording, size=sys.maxsize)) as found:
            return replace(concatenate(list(found)), meta=found.meta), found.has_recording

    record: Recording | Estimates
    record, more = whole(False)
    return replace(record, recording=whole(True)[0]) if more else record


def summary(path: Path) -> dict[str, Any]:
    """Digests, texts and numbers of a record that is sound, and the ``shapes`` of the rest.

    ``empty`` counts by stream the scans or events without a detection. Of scores only what
    :func:`header` tells.

    Raises
    ------
    FormatError : it cannot be read, is damaged or of another kind
    """
    module, _ = _identify(path, path)
    if hasattr(module, "header") and (stated := header(path))["kind"] == "scores":
        return stated
    found: dict[str, Any] = {}
    empty: Counter[str] = Counter()
    for recording in (False, True):
        with closing(open_windows(path, path, recording)) as parts:
            for window in parts:
                for name, stream in getattr(window, "streams", {}).items():
                    counts = np.diff(stream.row_offset)
                    empty[f"{'recording/' * recording}streams/{name}"] += int(np.sum(counts == 0))
            own = leaves.of(replace(parts.head, meta=parts.meta))
        found |= {f"{'recording/' * recording}{p}": leaf for p, leaf in own.items()}
        if not parts.has_recording:
            break
    small = {p: v for p, v in found.items() if isinstance(v, str | bool | int | float)}
    shapes: dict[str, tuple[int, ...]] = {p: (len(v),) for p, v in found.items() if p not in small}
    for name, text in parts.digests.items():
        kind = text.partition(":")[0]
        if kind.endswith("]"):
            shape = kind[kind.index("[") + 1 : -1].split(",")
            shapes[name] = tuple(map(int, filter(None, shape)))
    return {**leaves.header(parts.digests), **small, "shapes": shapes, "empty": dict(empty)}


def header(path: Path) -> dict[str, Any]:
    """What a file says of itself: ``format``, ``kind``, digests, name and provenance.

    Of the data nothing is read, so that damage there does not show; a file that was cut does.

    Raises
    ------
    FormatError : it cannot be read, is damaged or of another kind
    """
    module, name = _identify(path, path)
    found = module.header(path, path) if hasattr(module, "header") else summary(path)
    provenance = leaves.provenance(found["provenance"], path)
    return {**provenance, **found, "format": name, "provenance": provenance}


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


def writer(target: Target, format: str) -> Writer:
    """A writer that takes a record window by window. Not atomic by itself."""
    module = registry.load(GROUP, format)
    if not hasattr(module, "Writer"):
        return WholeWriter(module.write, target)
    found: Writer = module.Writer(target)
    return found


def write(record: Recording | Estimates, target: Target, format: str) -> None:
    """Check and write a record whole. Not atomic by itself.

    Raises
    ------
    FormatError : the record breaks its contract
    """
    check(record)
    out = writer(target, format)
    try:
        for window in windows(record):
            out.append(window)
        out.close(record.meta, record.recording if isinstance(record, Estimates) else None)
    finally:
        out.abort()


def observed_digest(record: Recording | Path) -> str:
    """Digest of what an estimator may see: equal with and without truth.

    Raises
    ------
    FormatError : the file cannot be read, is damaged or of another kind
    """
    if isinstance(record, Path):
        return str(header(record)["observed_digest"])
    return leaves.observed_digest(record)


def content_digest(record: Recording | Estimates) -> str:
    """Digest of all that ``record`` holds, as its files state it."""
    return leaves.content_digest(record)

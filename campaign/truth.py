"""The recording that estimates were made from, found by its digest."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path

from .. import formats
from ..models.errors import FormatError, InputError
from ..models.records import Estimates, Making, Recording


def find(estimates: Estimates, label: str, places: Sequence[str]) -> Path:
    """The file among ``places`` of the recording that ``estimates`` were made from.

    A place is a file or a folder of files, in which those called like the recording come first.

    Raises
    ------
    InputError : there is none, or only others
    """
    if not places:
        raise InputError(f"{label}: no recording came along: name it, or its folder, by --truth")
    return _path(label, estimates.meta.name, estimates.making, places)


def of_recording(recording: Recording, label: str, places: Sequence[str]) -> Path:
    """The file among ``places`` of the same recording, with its truth.

    Raises
    ------
    InputError : there is none, or only others
    """
    seen = Making("", {}, formats.observed_digest(recording))
    return _path(label, recording.meta.name, seen, places)


def located(source: str, places: Sequence[str]) -> Path | None:
    """The file among ``places`` that :func:`find` takes for the estimates in ``source``, if any."""
    found = formats.header(Path(source))
    return _path(source, found["name"], Making.of(found["provenance"]), places) if places else None


def _path(label: str, name: str, making: Making, places: Sequence[str]) -> Path:
    if not making.digest:
        raise InputError(f"{label}: does not say which recording it was made from")
    for path in _candidates(places, (name, Path(label).stem)):
        if _digest(path, path in map(Path, places)) == making.digest:
            return path
    where = " ".join(places)
    raise InputError(f"{label}: was made from another recording than {where}: the digests differ")


def _candidates(places: Iterable[str], names: tuple[str, ...]) -> Iterator[Path]:
    for place in map(Path, places):
        if os.path.isdir(place):
            files = (p for p in place.iterdir() if p.is_file() and not p.name.startswith("."))
            yield from sorted(files, key=lambda p: (not any(map(p.stem.startswith, names)), p.name))
        else:
            yield place


def _digest(path: Path, named: bool) -> str | None:
    """The digest of a recording; None for another file in a folder."""
    try:
        seen = path.stat()
        return _of_header(path, named, seen.st_mtime_ns, seen.st_size, seen.st_ino)
    except OSError:
        return _of_header.__wrapped__(path, named, 0, 0, 0)


@lru_cache(maxsize=1 << 16)
def _of_header(path: Path, named: bool, *version: int) -> str | None:
    """The same of a ``version`` of the file, read once however many estimates ask."""
    try:
        found = formats.header(path)
    except FormatError:
        if named:
            raise
        return None
    if found["kind"] == "recording":
        return str(found["observed_digest"])
    if named:
        raise InputError(f"{path}: holds {found['kind']}, not a recording")
    return None

"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import re
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from fcntl import LOCK_EX, LOCK_NB, flock
from pathlib import Path

from ..models.errors import OutputError

_HDF5_ERRNO = re.compile(r"errno = (\d+)")
_TEMPORARY = re.compile(r"\.(.+)\.[0-9a-f]{12}\.tmp")


def refuse_existing(path: Path, overwrite: bool = False) -> None:
    """Raise :class:`OutputError` if ``path`` may not be written.

    That is where it exists and is no regular file, or exists and ``overwrite`` is false.
    """
    if path.exists() and not path.is_file():
        raise OutputError(f"{path}: exists and is not a regular file")
    if path.exists() and not overwrite:
        raise OutputError(f"{path}: exists already (see --overwrite and --skip-existing)")


@contextmanager
def atomic(path: Path, overwrite: bool = False) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` that takes its place when the block ends well.

    The folder of ``path`` is made. However the block is left otherwise, the temporary file
    ``.<name>.<random>.tmp`` is removed and ``path`` is as it was before. It is locked as long as
    it is written, by which :func:`sweep` knows one that nobody writes any more.

    Raises
    ------
    OutputError : ``path`` exists (and ``overwrite`` is false), or cannot be written
    """
    temporary = path.with_name(f".{path.name}.{secrets.token_hex(6)}.tmp")
    descriptor = -1
    try:
        refuse_existing(path, overwrite)
        path.parent.mkdir(parents=True, exist_ok=True)
        descriptor = _create(temporary)
        yield temporary
        _sync(temporary)
        os.replace(temporary, path)
        with suppress(OSError):
            _sync(path.parent)
    except (OSError, RuntimeError) as error:
        reason = _reason(error)
        if reason is None:
            raise
        raise OutputError(f"{path}: cannot be written: {reason}") from error
    finally:
        with suppress(OSError):
            temporary.unlink()
        if descriptor >= 0:
            os.close(descriptor)


def sweep(paths: Iterable[Path]) -> None:
    """Remove the temporary files of ``paths`` that a killed process has left behind."""
    names: dict[Path, set[str]] = {}
    for path in paths:
        names.setdefault(path.parent, set()).add(path.name)
    for folder, wanted in names.items():
        with suppress(OSError), os.scandir(folder) as entries:
            for entry in entries:
                found = _TEMPORARY.fullmatch(entry.name)
                if found and found[1] in wanted:
                    _remove_unlocked(Path(entry.path))


def _remove_unlocked(temporary: Path) -> None:
    with suppress(OSError):
        descriptor = os.open(temporary, os.O_RDWR)
        try:
            flock(descriptor, LOCK_EX | LOCK_NB)
            temporary.unlink()
        finally:
            os.close(descriptor)


def _create(temporary: Path) -> int:
    """A descriptor of the new file ``temporary`` that holds its lock."""
    while True:
        descriptor = os.open(temporary, os.O_RDWR | os.O_CREAT, 0o666)
        # Where the file system has no locks, sweep() gets none either and removes nothing.
        with suppress(OSError):
            flock(descriptor, LOCK_EX)
        with suppress(OSError):
            if os.path.samestat(os.fstat(descriptor), os.stat(temporary)):
                return descriptor
        os.close(descriptor)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _reason(error: OSError | RuntimeError) -> str | None:
    """What the system says, also where HDF5 hides it in a text; None if it was not the system."""
    hidden = _HDF5_ERRNO.search(str(error))
    if hidden:
        return os.strerror(int(hidden[1]))
    return error.strerror or str(error) if isinstance(error, OSError) else None

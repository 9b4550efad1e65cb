"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..models.errors import OutputError

_HDF5_ERRNO = re.compile(r"errno = (\d+)")


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
    ``.<name>.<pid>.tmp`` is removed and ``path`` is as it was before.

    Raises
    ------
    OutputError : ``path`` exists (and ``overwrite`` is false), or cannot be written
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        refuse_existing(path, overwrite)
        path.parent.mkdir(parents=True, exist_ok=True)
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

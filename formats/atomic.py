"""Files that appear whole or not at all."""

from __future__ import annotations

import errno
import hashlib
import os
import re
import secrets
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from fcntl import LOCK_EX, LOCK_NB, flock
from pathlib import Path

from ..models.errors import OutputError

_HDF5_ERRNO = re.compile(r"errno = (\d+)")
_TEMPORARY = re.compile(r"\.(.+)\.[0-9a-f]{12}\.tmp", re.DOTALL)
_LONGEST = 255
"""Bytes of a name."""
_NO_LINKS = {errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK}


def refuse_existing(path: Path, overwrite: bool = False) -> None:
    """Raise :class:`OutputError` if ``path`` may not be written.

    That is where it exists and is no regular file, or exists and ``overwrite`` is false, or where
    the system will not have it: no access, a name that is too long, links in a circle.
    """
    try:
        os.stat(path)
    except FileNotFoundError:
        if len(os.fsencode(path.name)) > _LONGEST:
            reason = os.strerror(errno.ENAMETOOLONG)
            raise OutputError(f"{path}: cannot be written: {reason}") from None
        return
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror}") from None
    if not path.is_file():
        raise OutputError(f"{path}: exists and is not a regular file")
    if not overwrite:
        raise _exists(path)


def _exists(path: Path) -> OutputError:
    return OutputError(f"{path}: exists already (see --overwrite and --skip-existing)")


def refuse_unwritable(path: Path) -> None:
    """Raise :class:`OutputError` if nothing can be written at ``path``, before there is anything.

    Folders that are missing are made.
    """
    with atomic(path, overwrite=True, keep=False):
        pass


@contextmanager
def atomic(path: Path, overwrite: bool = False, keep: bool = True) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` that takes its place when the block ends well.

    The folder of ``path`` is made; where ``path`` is a link, the file that it leads to is written.
    However the block is left otherwise, the temporary file ``.<name>.<random>.tmp`` is removed and
    ``path`` is as it was before; so it is always unless what was written is to be ``kept``. It is
    locked as long as it is written, by which :func:`sweep` knows one that nobody writes any more.

    Raises
    ------
    OutputError : ``path`` exists or comes to exist (and ``overwrite`` is false), or cannot be
        written
    """
    place = _place(path)
    temporary = place.with_name(f".{_stem(place.name)}.{secrets.token_hex(6)}.tmp")
    descriptor = -1
    try:
        refuse_existing(path, overwrite)
        place.parent.mkdir(parents=True, exist_ok=True)
        descriptor = _create(temporary)
        yield temporary
        if keep:
            _sync(temporary)
            if not _put(temporary, place, overwrite):
                raise _exists(path)
            with suppress(OSError):
                _sync(place.parent)
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


def _put(temporary: Path, place: Path, overwrite: bool) -> bool:
    """Give the file at ``temporary`` its ``place``; false if something stands there and may stay.

    A link fails where something stands, however lately it came; a rename would replace it.
    """
    if not overwrite:
        try:
            os.link(temporary, place)
            return True
        except FileExistsError:
            return False
        except OSError as error:
            if error.errno not in _NO_LINKS:
                raise
        if place.exists():
            return False
    os.replace(temporary, place)
    return True


def _place(path: Path) -> Path:
    """The file that ``path`` leads to, if it is a link, or ``path``."""
    return Path(os.path.realpath(path)) if os.path.islink(path) else path


def _stem(name: str) -> str:
    """``name`` in that of its temporary file: itself, or its digest if it is too long for that."""
    data = os.fsencode(name)
    return name if len(data) <= _LONGEST - 18 else hashlib.sha256(data).hexdigest()


def sweep(paths: Iterable[Path]) -> None:
    """Remove the temporary files of ``paths`` that a killed process has left behind."""
    names: dict[Path, set[str]] = {}
    for path in map(_place, paths):
        names.setdefault(path.parent, set()).add(_stem(path.name))
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

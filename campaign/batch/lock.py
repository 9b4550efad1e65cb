"""A lock that one command holds at a time."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from fcntl import LOCK_EX, LOCK_NB, flock

from ...models.errors import OutputError, UnavailableError


@contextmanager
def locked(path: str) -> Iterator[None]:
    """Hold the lock ``path`` within the block.

    Raises
    ------
    UnavailableError : another command holds it
    OutputError : its file cannot be opened or locked
    """
    try:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise OutputError(f"--lock {path}: {error.strerror}") from error
    try:
        try:
            flock(descriptor, LOCK_EX | LOCK_NB)
        except BlockingIOError:
            raise UnavailableError(f"--lock {path}: another command holds it") from None
        except OSError as error:
            raise OutputError(f"--lock {path}: cannot be locked: {error.strerror}") from error
        yield
    finally:
        os.close(descriptor)

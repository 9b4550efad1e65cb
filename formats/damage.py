"""What is wrong with a file, whatever raised it, as one kind of error with its place."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..models.errors import EchosetError, FormatError


@contextmanager
def damage(path: object, where: str | Callable[[], str]) -> Iterator[None]:
    """Have whatever a library raises in this block be a :class:`FormatError` of the file ``path``.

    The libraries trust what they read, and so raise anything where it is wrong. ``where`` is asked
    for the place when it comes to that.
    """
    try:
        yield
    except EchosetError:
        raise
    except Exception as error:
        place = where if isinstance(where, str) else where()
        raise FormatError(path, place[:200], reason(error)) from error


def reason(error: Exception) -> str:
    """What ``error`` says, on one line."""
    text = " ".join(str(error).split())[:300]
    if isinstance(error, OSError):
        return error.strerror or text
    if isinstance(error, KeyError) and " " not in text:
        return f"{text} is missing"
    return (
        text
        if text and isinstance(error, ValueError | RuntimeError | KeyError)
        else (f"{type(error).__name__}: {text}" if text else type(error).__name__)
    )

"""Inputs by name: files, or stdin as ``-``."""

from __future__ import annotations

import io
import os
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path, PurePath
from tempfile import NamedTemporaryFile
from time import monotonic, sleep
from typing import IO, Any

from ...models.errors import FormatError, InputError, OutputError, ParameterError
from ...models.records import Estimates, Recording, Scores
from .outputs import DASH

SCORES = (".csv", ".json")
_BLOCK = 1 << 20
_PATIENCE, _PAUSE = 10.0, 0.02
"""Seconds until a pipe that nobody writes to is given up, and between looks at it."""
_LONGEST_LIST = 1 << 30
"""Bytes of a list of files."""


def label(source: str) -> str:
    """The name of an input in messages."""
    return "<stdin>" if source == DASH else source


def listed(word: str) -> list[str]:
    """The files that ``word`` stands for: those that ``@FILE`` lists line by line, or itself.

    Raises
    ------
    ParameterError : the list cannot be read, or is empty
    """
    if not word.startswith("@") or word == "@":
        return [word]
    name = word[1:]
    try:
        with nullcontext(stdin()) if name == DASH else Path(name).open("rb") as file:
            data = file.read(_LONGEST_LIST + 1)
    except OSError as error:
        hint = f" (a file of this name: ./{word})" if os.path.exists(word) else ""
        raise ParameterError(f"{word}: {error.strerror}{hint}") from None
    if len(data) > _LONGEST_LIST:
        raise ParameterError(f"{word}: is no list of files: more than {_LONGEST_LIST} bytes")
    found = [os.fsdecode(line.removesuffix(b"\r")) for line in data.split(b"\n") if line.strip()]
    if not found:
        raise ParameterError(f"{word}: lists no files")
    return found


def stdin() -> IO[bytes]:
    """The binary stream of stdin.

    Raises
    ------
    ParameterError : that is a terminal
    """
    if sys.stdin.isatty():
        raise ParameterError("stdin is a terminal: '-' reads data from a pipe")
    return sys.stdin.buffer


def is_pipe(source: str) -> bool:
    """Whether ``source`` can be read only once: stdin, or a pipe with a name, as of ``<(...)``."""
    if source == DASH:
        return True
    try:
        return stat.S_ISFIFO(os.stat(source).st_mode)
    except OSError:
        return False


@contextmanager
def spooled(source: str) -> Iterator[Path]:
    """The file called ``source``, or a temporary one of what comes from a pipe.

    Raises
    ------
    InputError : it is neither file nor pipe, or a pipe that nobody writes to
    FormatError : from the block, of a temporary file: with the name of the input instead
    OutputError : there is no room for the temporary file
    """
    if not is_pipe(source):
        yield _file(source)
        return
    with _temporary(label(source)) as file:
        with _pipe(source) as stream:
            while data := stream.read(_BLOCK):
                try:
                    file.write(data)
                    file.flush()
                except OSError as error:
                    raise _no_room(label(source), error) from error
        try:
            yield Path(file.name)
        except FormatError as error:
            if error.path != file.name:
                raise
            raise FormatError(label(source), error.where, error.reason) from error


def _temporary(name: str) -> Any:
    try:
        return NamedTemporaryFile()
    except OSError as error:
        raise _no_room(name, error) from error


def _no_room(name: str, error: OSError) -> OutputError:
    return OutputError(f"{name}: cannot be kept in a temporary file (see TMPDIR): {error.strerror}")


@contextmanager
def _pipe(source: str) -> Iterator[IO[bytes]]:
    """The stream of stdin or of a pipe with a name, once somebody writes to it."""
    if source == DASH:
        yield stdin()
        return
    descriptor = os.open(source, os.O_RDONLY | os.O_NONBLOCK)
    with os.fdopen(descriptor, "rb", buffering=0) as raw:
        first, deadline = b"", monotonic() + _PATIENCE
        # Without a writer the pipe reads as ended; with one that has not written yet, as None.
        while not (first := raw.read(_BLOCK)) and first is not None:
            if monotonic() > deadline:
                raise InputError(f"{source}: is a pipe that nobody writes to")
            sleep(_PAUSE)
        os.set_blocking(descriptor, True)
        yield _After(first or b"", raw)


class _After(io.BytesIO):
    """The bytes ``first``, then those of the stream ``rest``."""

    def __init__(self, first: bytes, rest: Any) -> None:
        super().__init__(first)
        self._rest = rest

    def read(self, size: int | None = -1) -> bytes:
        return super().read(size) or bytes(self._rest.read(size))


def _file(source: str) -> Path:
    """The path of a file.

    Raises
    ------
    InputError : it is a device or socket, which may have no end
    """
    path = Path(source)
    try:
        mode = os.stat(path).st_mode
    except OSError:
        return path
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):
        raise InputError(f"{source}: is neither a file nor a pipe")
    return path


def read_scores(source: str) -> Scores:
    """The scores called ``source``, verified."""
    from ...formats import scores

    with spooled(source) as path:
        return scores.read(path, label(source))


def is_scores(path: Path, source: str) -> bool:
    """Whether the file at ``path``, called ``source``, is one of scores."""
    from ... import formats

    return PurePath(source).suffix in SCORES or formats.header(path)["kind"] == "scores"


def read_any(source: str) -> Recording | Estimates | Scores:
    """Whatever is in ``source``, verified."""
    from ... import formats
    from ...formats import scores

    with spooled(source) as path:
        if source != DASH and is_scores(path, source):
            return scores.read(path, label(source))
        return formats.read(path, label(source))

"""Inputs by name: files, or stdin as ``-``."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import copyfileobj
from tempfile import NamedTemporaryFile
from typing import IO

from ..models.errors import ParameterError
from ..models.records import Estimates, Recording, Scores
from .outputs import DASH

SCORES = (".csv", ".json")


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
        data = stdin().read() if name == DASH else Path(name).read_bytes()
    except OSError as error:
        hint = f" (a file of this name: ./{word})" if Path(word).exists() else ""
        raise ParameterError(f"{word}: {error.strerror}{hint}") from None
    found = [line for line in os.fsdecode(data).splitlines() if line.strip()]
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


def opened(source: str) -> Path | IO[bytes]:
    """The file called ``source``, or stdin."""
    return stdin() if source == DASH else Path(source)


@contextmanager
def spooled(source: str) -> Iterator[Path]:
    """The file called ``source``, or a temporary one of what comes from stdin."""
    if source != DASH:
        yield Path(source)
        return
    with NamedTemporaryFile() as file:
        copyfileobj(stdin(), file)
        file.flush()
        yield Path(file.name)


def read(source: str) -> Recording | Estimates:
    """The recording or estimates called ``source``, verified."""
    from .. import formats

    return formats.read(opened(source), label(source))


def read_scores(source: str) -> Scores:
    """The scores called ``source``, verified."""
    from ..formats import scores

    return scores.read(opened(source), label(source))


def is_scores(source: str) -> bool:
    """Whether the file ``source`` is one of scores."""
    from .. import formats

    path = Path(source)
    return path.suffix in SCORES or formats.header(path)["kind"] == "scores"


def read_any(source: str) -> Recording | Estimates | Scores:
    """Whatever is in the file ``source``, verified."""
    return read_scores(source) if is_scores(source) else read(source)

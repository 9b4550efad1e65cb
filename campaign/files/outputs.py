"""Outputs: files that appear whole, or stdout."""

from __future__ import annotations

import os
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from shutil import copyfileobj
from tempfile import TemporaryDirectory
from typing import IO

from ...models.errors import OutputError, ParameterError
from .. import exits

DASH = "-"
BINARY = ("h5", "mcap")
_SEEKING = ("h5",)
"""Formats that cannot be written to a stream as they grow."""


@dataclass(frozen=True, slots=True)
class Target:
    """One output: a file, or stdout where ``path`` is None, in a named format.

    Where it exists, it is left as it is if ``resume`` and it is what would be written; else it is
    replaced or, unless ``overwrite``, an error.
    """

    path: Path | None
    format: str
    overwrite: bool = False
    resume: bool = False

    @contextmanager
    def open(self) -> Iterator[Path | IO[bytes]]:
        """A path or binary stream to write to; what is written shows when the block ends well.

        Raises
        ------
        OutputError : it exists or cannot be written
        """
        if self.path is not None:
            from ...formats.atomic import atomic

            with atomic(self.path, self.overwrite) as temporary:
                yield temporary
            return
        with _stdout() as stream:
            if self.format in _SEEKING:
                with TemporaryDirectory() as folder:
                    path = Path(folder) / "output"
                    yield path
                    with path.open("rb") as file:
                        copyfileobj(file, stream)
            else:
                yield stream

    def write_text(self, text: str) -> None:
        """Write ``text``, in which names may stand that are not UTF-8, as the whole output."""
        self.write_bytes(text.encode("utf-8", "surrogateescape"))

    def write_bytes(self, data: bytes) -> None:
        """Write ``data`` as the whole output."""
        with self.open() as target:
            if isinstance(target, Path):
                target.write_bytes(data)
            else:
                target.write(data)


@contextmanager
def _stdout() -> Iterator[IO[bytes]]:
    try:
        sys.stdout.flush()
        yield sys.stdout.buffer
        sys.stdout.buffer.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        exits.drop_stdout()
        raise OutputError(f"stdout: cannot be written: {error.strerror or error}") from error


def say(line: str) -> None:
    """Write a line of text to stdout."""
    Target(None, "text").write_text(line + "\n")


def refuse_collisions(
    outputs: Iterable[tuple[str, Path | str | None]], inputs: Iterable[str | None]
) -> None:
    """Raise :class:`ParameterError` if an output, with its option, is an input or another output.

    Files are compared as the system knows them, whatever they are called.
    """
    folders: dict[str, str] = {}

    def identity(path: str) -> object:
        try:
            found = os.stat(path)
        except OSError:
            if os.path.islink(path):
                return os.path.realpath(path)
            folder, name = os.path.split(path)
            if folder not in folders:
                folders[folder] = os.path.realpath(folder)
            return os.path.join(folders[folder], name)
        return found.st_dev, found.st_ino

    read = {identity(name) for name in inputs if name is not None and name != DASH}
    written: dict[object, str] = {}
    for option, path in outputs:
        if path is None or str(path) == DASH:
            continue
        key = identity(str(path))
        if key in read:
            raise ParameterError(f"{option} {path}: is an input too")
        if key in written:
            raise ParameterError(f"{option} {path}: is written by {written[key]} too")
        written[key] = option


def single(output: str, form: str, overwrite: bool = False, inputs: Iterable[str] = ()) -> Target:
    """The target of a command with one output, which is made from ``inputs``.

    Raises
    ------
    ParameterError : binary data would go to a terminal, or the output is an input
    OutputError : it exists
    """
    from ...formats.atomic import refuse_existing

    if output == DASH:
        if form in BINARY and sys.stdout.isatty():
            raise ParameterError(f"{form} is binary and stdout a terminal: use -o FILE or a pipe")
        return Target(None, form)
    refuse_collisions([("-o", output)], inputs)
    refuse_existing(Path(output), overwrite)
    return Target(Path(output), form, overwrite)


def scores_format(output: str) -> str:
    """The format of scores for ``output``: by its suffix, CSV on stdout.

    Raises
    ------
    ParameterError : an unknown suffix
    """
    from ...formats.scores import SUFFIXES

    if output == DASH:
        return "csv"
    suffix = Path(output).suffix
    if suffix not in SUFFIXES:
        raise ParameterError(f"-o {output}: scores are written as .csv, .json or .h5")
    return SUFFIXES[suffix]


@dataclass(frozen=True, slots=True)
class Existing:
    """Policy for outputs that exist: an error, to overwrite, to skip; ``dry_run`` only reports."""

    overwrite: bool = False
    skip_existing: bool = False
    dry_run: bool = False

    def __post_init__(self) -> None:
        if self.overwrite and self.skip_existing:
            raise ParameterError("--overwrite and --skip-existing exclude each other")

    def target(self, path: Path, form: str, late: bool) -> Target:
        """The target at ``path``; where that may not be replaced, an error now or later."""
        from ...formats.atomic import refuse_existing

        overwrite = self.overwrite or self.skip_existing
        if not late:
            refuse_existing(path, overwrite)
        # What was not there before is what a worker made, if it was lost before it said so.
        return Target(path, form, overwrite, self.skip_existing or not os.path.exists(path))


def plan(
    output: str, names: Sequence[str], form: str | None, existing: Existing, late: bool = False
) -> list[Target]:
    """The target of each of ``names``: recordings or estimates.

    A folder (that exists, or is written with a slash at the end) takes ``<name>.<suffix>``, a file
    or stdout one output only.

    Raises
    ------
    ParameterError : several outputs into one, a format that is unknown or for no terminal
    OutputError : an output exists and may not be replaced; with ``late`` only its task fails
    """
    from ...formats import suffix_format
    from ...models.registry import load

    if output != DASH and (output.endswith("/") or os.path.isdir(output)):
        form = form or "h5"
        suffix = load("echoset.formats", form).SUFFIXES[0]
        twice = [name for name, count in Counter(names).items() if count > 1]
        if twice:
            raise ParameterError(f"-o {output}: two outputs would be called {twice[0]}{suffix}")
        return [existing.target(Path(output) / (name + suffix), form, late) for name in names]
    if len(names) > 1:
        raise ParameterError(f"-o {output}: {len(names)} outputs need a folder, such as -o out/")
    form = form or ("mcap" if output == DASH else suffix_format(Path(output)))
    load("echoset.formats", form)
    return [single(output, form) if output == DASH else existing.target(Path(output), form, late)]

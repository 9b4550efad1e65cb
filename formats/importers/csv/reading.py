"""How a table is written, and its rows as they stand in the file."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ....models.errors import FormatError, ParameterError
from ....models.parameters import listed, require, shown, suggestion
from ..text import TextFile
from . import skip
from .columns import Field, TimeField
from .units import NAMES

RESTARTS = ("error", "split", "wrap", "sort")


@dataclass(frozen=True, slots=True)
class Dialect:
    """How a table is written: a blank as delimiter stands for any run of blanks."""

    delimiter: str = ","
    comment: str = "#"
    header: bool = True
    decimal: str = "."
    missing: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if len(self.delimiter) != 1 or self.delimiter in '"\r\n':
            raise ParameterError(f"delimiter must be one character, got {shown(self.delimiter)}")
        require(self.decimal in (".", ","), "decimal", "'.' or ','", self.decimal)
        require(self.decimal != self.delimiter, "decimal", "another than delimiter", self.decimal)


@dataclass(frozen=True, slots=True)
class Reading(Dialect):
    """What to take of one table, and how to understand its rows."""

    file: Any = ""
    columns: Any = None
    names: tuple[str, ...] = ()
    rows: Any = field(default_factory=dict)
    skip: Any = ()
    rename: Any = field(default_factory=dict)
    restarts: str = "error"
    run: int = 1
    longest_pause: float = 31_557_600.0
    shared_times: bool = False

    def __post_init__(self) -> None:
        Dialect.__post_init__(self)
        hint = suggestion(self.restarts, RESTARTS)
        rule = f"one of {' '.join(RESTARTS)}{hint}"
        require(self.restarts in RESTARTS, "restarts", rule, self.restarts)
        require(self.run >= 1, "run", "at least 1", self.run)
        require(self.longest_pause > 0, "longest_pause", "positive", self.longest_pause)
        require(len(set(self.names)) == len(self.names), "names", "different", list(self.names))
        require(isinstance(self.rows, Mapping), "rows", "a mapping of columns to words", self.rows)
        ok = isinstance(self.rename, Mapping)
        ok = ok and all(k in NAMES and isinstance(v, Mapping) for k, v in self.rename.items())
        rule = "a mapping of anchor, device, .. to a table of names"
        require(ok, "rename", rule, self.rename)

    @property
    def conditions(self) -> list[skip.Condition]:
        """The conditions by which rows are left out."""
        texts = [self.skip] if isinstance(self.skip, str) else self.skip
        require(isinstance(texts, list | tuple), "skip", "conditions", self.skip)
        return [skip.parse(text, "skip") for text in texts]


@dataclass(frozen=True, slots=True)
class Rows:
    """The rows of files that are written alike, as they stand there.

    ``places`` are those of the rows of ``body``, all of ``width`` fields; ``line`` is that of the
    header or the first row of the first file; ``left_out`` counts the rows of other kinds.
    """

    path: Path
    header: list[str] | None
    width: int
    line: int
    body: list[list[str]]
    places: list[tuple[Path, int]]
    left_out: dict[str, int]
    missing: tuple[str, ...]

    def position(self, column: Any) -> int:
        """Index of a column that is named, or numbered from 1."""
        return _position(column, self.header, self.width, self.path, self.line)

    def name(self, index: int) -> object:
        """What a column is called."""
        return self.header[index] if self.header else index + 1

    def text(self, indices: Sequence[int]) -> list[str]:
        """The fields of some columns, row by row, empty where a word says that they are."""
        fields = [row[k].strip() for row in self.body for k in indices]
        return ["" if f in self.missing else f for f in fields] if self.missing else fields


def read_rows(
    files: Sequence[TextFile], reading: Reading, fields: Mapping[str, Field | TimeField]
) -> Rows:
    """The rows of ``files`` that are of the kind that is wanted."""
    parts = [_rows(file, reading, fields) for file in files]
    first = parts[0]
    for part in parts[1:]:
        if (part.header, part.width) != (first.header, first.width):
            reason = f"its columns are not those of {first.path}"
            raise FormatError(part.path, f"line {part.line}", reason)
    return replace(
        first,
        body=[row for part in parts for row in part.body],
        places=[place for part in parts for place in part.places],
        left_out={why: sum(part.left_out[why] for part in parts) for why in first.left_out},
    )


def _rows(file: TextFile, reading: Reading, fields: Mapping[str, Field | TimeField]) -> Rows:
    path, wanted = file.path, {str(k): _words(v) for k, v in reading.rows.items()}
    header: list[str] | None = list(reading.names) or None
    width, start, at = len(reading.names), 0, 0
    body: list[list[str]] = []
    lines: list[int] = []
    left_out = {_not(column, words): 0 for column, words in wanted.items()}
    sifted = _sifted(file.lines(), reading)
    try:
        for row in (reader := csv.reader(sifted, delimiter=reading.delimiter, strict=True)):
            at = reader.line_num
            if not row:
                continue
            if not start:
                start = at
                _expect_columns(row, fields, reading.delimiter, path, at)
                if reading.header and header is None:
                    header, width = [name.strip() for name in row], len(row)
                    continue
            for column, words in wanted.items():
                if not _is(row, column, words, header, path):
                    left_out[_not(column, words)] += 1
                    break
            else:
                width = width or len(row)
                if len(row) != width:
                    reason = f"has {len(row)} fields, needs {width}"
                    raise FormatError(path, f"line {at}", reason)
                body.append(row)
                lines.append(at)
    except csv.Error as error:
        raise FormatError(path, f"line {at + 1}", str(error)) from error
    if not start:
        raise FormatError(path, "line 1", "there is nothing but comments")
    places = [(path, line) for line in lines]
    return Rows(path, header, width, start, body, places, left_out, reading.missing)


def _not(column: str, words: Sequence[str]) -> str:
    """Why a row is not of the kind that is wanted."""
    return f"{column} is not {' or '.join(words)}"


def _words(value: object) -> list[str]:
    words = [str(v) for v in value] if isinstance(value, list | tuple) else [str(value)]
    ok = bool(words) and not isinstance(value, Mapping) and value is not None
    require(ok, "rows", "a mapping of columns to words", value)
    return words


def _is(
    row: Sequence[str], column: str, words: Sequence[str], header: list[str] | None, path: Path
) -> bool:
    """Whether the field of a row in a column, by name or number, is one of some words."""
    if header is not None and column in header:
        k = header.index(column)
    elif column.isdecimal() and int(column) >= 1:
        k = int(column) - 1
    else:
        hint = suggestion(column, header or [])
        raise ParameterError(f"rows: {path} has no column {column!r}{hint}")
    return k < len(row) and row[k].strip() in words


def _expect_columns(
    first: Sequence[str],
    fields: Mapping[str, Field | TimeField],
    delimiter: str,
    path: Path,
    line: int,
) -> None:
    """Refuse one column where several are wanted and another delimiter would make them."""
    several = sum(given.value is None for given in fields.values()) > 1
    several |= any(given.columns or getattr(given, "pattern", "") for given in fields.values())
    other = next((d for d in ";\t,| " if d in first[0].strip()), None)
    if len(first) == 1 and several and other:
        reason = f"has one column: is the delimiter {other!r}, not {delimiter!r}?"
        raise FormatError(path, f"line {line}", reason)


def _sifted(lines: Sequence[str], dialect: Dialect) -> Iterator[str]:
    """The lines with comments made blank, so that their numbers stay."""
    for line in lines:
        bare = line.strip()
        if not bare or (dialect.comment and bare.startswith(dialect.comment)):
            yield "\n"
        else:
            yield (" ".join(bare.split()) if dialect.delimiter == " " else line) + "\n"


def _position(column: object, names: list[str] | None, width: int, path: Path, line: int) -> int:
    """Index of a column that is named, or numbered from 1."""
    if isinstance(column, int):
        if 1 <= column <= width:
            return column - 1
        raise FormatError(path, f"line {line}", f"no column {column}: there are {width}")
    if names is None:
        raise ParameterError(f"{path} has no header: give the number of column {column!r}")
    if names.count(str(column)) == 1:
        return names.index(str(column))
    if str(column) in names:
        raise FormatError(path, f"line {line}", f"two columns are called {column!r}")
    hint = suggestion(str(column), names) or f": there are {listed(names)}"
    raise FormatError(path, f"line {line}", f"no column {shown(column)}{hint}")

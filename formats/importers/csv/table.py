"""Delimited text tables whose columns are chosen, and converted to SI, by a mapping."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ....models.columns import COLUMNS
from ....models.errors import FormatError, ParameterError
from ....models.parameters import require, resolve, suggestion
from ....models.records import Array
from ..text import TIME_UNITS, Table, TextFile
from .units import quantity, to_si


@dataclass(frozen=True, slots=True)
class Dialect:
    """How a table is written: a blank as delimiter stands for any run of blanks."""

    delimiter: str = ","
    comment: str = "#"
    header: bool = True

    def __post_init__(self) -> None:
        if len(self.delimiter) != 1 or self.delimiter in '"\r\n':
            raise ParameterError(f"delimiter must be one character, got {self.delimiter!r}")


@dataclass(frozen=True, slots=True)
class Field:
    """Where a quantity comes from: a column by name or number, or one ``value`` for all rows."""

    column: Any = None
    unit: str = ""
    scale: float = 1.0
    value: Any = None


def fields(
    spec: object, required: Sequence[str], optional: Sequence[str], where: str
) -> dict[str, Field]:
    """The fields that a mapping's ``columns`` names.

    Raises
    ------
    ParameterError : a quantity is unknown, or a required one is missing
    """
    if not isinstance(spec, Mapping):
        raise ParameterError(f"{where} must map quantities to columns, got {spec!r}")
    found: dict[str, Field] = {}
    for key, item in spec.items():
        if key not in required and key not in optional:
            hint = suggestion(key, [*required, *optional])
            raise ParameterError(f"{where}: unknown quantity {key!r}{hint}")
        place = f"{where}.{key}"
        item = item if isinstance(item, Mapping) else {"column": item}
        given = resolve(Field, (place, item))
        if (given.column is None) == (given.value is None):
            raise ParameterError(f"{place} needs either a column or a value")
        if key == "time" and (given.unit or "s") not in TIME_UNITS:
            raise ParameterError(f"{place}: unit {given.unit!r} is not one of s ms us ns")
        found[key] = given
    for key in required:
        if key not in found:
            raise ParameterError(f"{where}: {key!r} is missing")
    return found


@dataclass(frozen=True, slots=True)
class Log(Table):
    """A table whose columns a mapping names: as text, as indices, or in SI."""

    fields: Mapping[str, Field] = field(default_factory=dict)
    path: Path = Path()

    def __contains__(self, key: str) -> bool:
        return key in self.fields

    def refuse(self, key: str, bad: Array, reason: str) -> None:
        """Fail at the first row of ``bad`` (m,), quoting the field."""
        if bad.any():
            index = int(bad.argmax())
            self.fail(key, index, f"{self.columns[key][index][:40]!r} {reason}")

    def values(self, key: str, missing: bool = False) -> Array:
        """The column ``key`` in SI (m,); empty fields are NaN if ``missing``."""
        given, where = self.fields[key], f"columns.{key}"
        if given.value is not None:
            value = quantity(given.value, key, where) * given.scale
            require(np.isfinite(value), where, "finite", value)
            return np.full(len(self), value)
        read = self.numbers(key, missing)
        with np.errstate(over="ignore"):
            values = to_si(read, given.unit, key, where) * given.scale
        self.refuse(key, np.isinf(values), "is not a finite number in SI")
        if key in COLUMNS and COLUMNS[key].minimum == 0:
            self.refuse(key, values < 0, "is negative")
        return values

    def index(self, key: str, names: Sequence[str]) -> Array:
        """Index in ``names`` of the names in the column ``key`` (m,), int32."""
        where = {name: i for i, name in enumerate(names)}
        text = self.columns[key]
        index = np.fromiter((where.get(t, -1) for t in text), np.int32, len(text))
        self.refuse(key, index < 0, f"is not one of {' '.join(names)}")
        return index

    def detections(
        self, main: Sequence[str], others: Sequence[str]
    ) -> tuple[dict[str, Array], Array]:
        """The row columns by name, and whether a row is a detection (m,).

        A row whose ``main`` columns are all empty is none; the ``others`` may be empty only there.
        """
        columns = {key: self.values(key, missing=True) for key in main}
        detected = ~np.isnan(columns[main[0]])
        for key in main[1:]:
            lone = np.isnan(columns[key]) == detected
            self.refuse(key, lone, f"and {main[0]}: one is empty, the other is not")
        for key in others:
            columns[key] = self.values(key, missing=True)
            bad = np.isnan(columns[key]) & detected
            self.refuse(key, bad, "is empty, yet there is a detection")
        return columns, detected

    def time(self) -> Array:
        """The column ``time`` as int64 nanoseconds (m,)."""
        return self.nanoseconds("time", self.fields["time"].unit or "s")


def read_table(file: TextFile, dialect: Dialect, fields: Mapping[str, Field]) -> Log:
    """The ``fields`` of the table in ``file``.

    Raises
    ------
    FormatError : a column is missing, or a row has too few or many fields
    """
    path = file.path
    rows: list[list[str]] = []
    lines: list[int] = []
    reader = csv.reader(_sifted(file.lines(), dialect), delimiter=dialect.delimiter, strict=True)
    try:
        for row in reader:
            if not row:
                continue
            rows.append(row)
            lines.append(reader.line_num)
            if len(row) != len(rows[0]):
                reason = f"has {len(row)} fields, needs {len(rows[0])}"
                raise FormatError(path, f"line {lines[-1]}", reason)
    except csv.Error as error:
        start = lines[-1] + 1 if lines else 1
        raise FormatError(path, f"line {start}", str(error)) from error
    if not rows:
        raise FormatError(path, "line 1", "there is nothing but comments")
    _expect_columns(rows[0], fields, dialect.delimiter, path, lines[0])
    names = [name.strip() for name in rows[0]] if dialect.header else None
    body = rows[1:] if dialect.header else rows
    columns = {}
    for key, given in fields.items():
        if given.value is None:
            k = _position(given.column, names, len(rows[0]), path, lines[0])
            columns[key] = [row[k].strip() for row in body]
        else:
            columns[key] = [str(given.value)] * len(body)
    places = [(path, line) for line in lines[len(lines) - len(body) :]]
    return Log(columns, places, {key: given.column for key, given in fields.items()}, fields, path)


def _expect_columns(
    first: Sequence[str], fields: Mapping[str, Field], delimiter: str, path: Path, line: int
) -> None:
    """Refuse one column where several are wanted and another delimiter would make them."""
    wanted = {given.column for given in fields.values()} - {None}
    other = next((d for d in ",;\t| " if d in first[0].strip()), None)
    if len(first) == 1 < len(wanted) and other:
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
    if isinstance(column, int) and not isinstance(column, bool):
        if 1 <= column <= width:
            return column - 1
        raise FormatError(path, f"line {line}", f"no column {column}: there are {width}")
    if names is None:
        raise ParameterError(f"{path} has no header: give the number of column {column!r}")
    if names.count(str(column)) == 1:
        return names.index(str(column))
    if str(column) in names:
        raise FormatError(path, f"line {line}", f"two columns are called {column!r}")
    hint = suggestion(str(column), names) or f": there are {', '.join(names)}"
    raise FormatError(path, f"line {line}", f"no column {column!r}{hint}")

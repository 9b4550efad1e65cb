"""Logs in text form: files read whole, and tables of their fields turned into numbers."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from pathlib import Path
from typing import ClassVar, NoReturn

import numpy as np

from ...models.errors import FormatError
from ...models.records import Array

LONGEST_LINE = 65536
TIME_UNITS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
"""Units of time as powers of ten over the nanosecond."""


@dataclass(frozen=True, slots=True)
class TextFile:
    """A file of UTF-8 text, and what provenance says of it."""

    path: Path
    text: str
    sha256: str

    @property
    def provenance(self) -> dict[str, str]:
        """Name and digest."""
        return {"name": self.path.name, "sha256": self.sha256}

    def lines(self) -> list[str]:
        """The lines without their ends; FormatError if there is none, or one of insane length."""
        lines = self.text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
        longest = max(map(len, lines))
        if longest > LONGEST_LINE:
            line = list(map(len, lines)).index(longest) + 1
            reason = f"is longer than {LONGEST_LINE} characters"
            raise FormatError(self.path, f"line {line}", reason)
        if not self.text.strip():
            raise FormatError(self.path, "line 1", "the file is empty")
        return lines


def read_text(path: Path, of_lines: bool = True) -> TextFile:
    """The text file at ``path``; FormatError if it cannot be read or is no text ``of_lines``."""
    try:
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        if isinstance(error, IsADirectoryError):
            reason += ": import a folder by itself, or its files by name"
        raise FormatError(path, "", reason) from error
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        place = f"line {line}" if of_lines else f"byte {error.start}"
        raise FormatError(path, place, "is not UTF-8 text") from error
    return TextFile(path, text, hashlib.sha256(data).hexdigest())


@dataclass(frozen=True, slots=True)
class Table:
    """Fields of text: ``columns`` (m,) by key, and in ``places`` (m,) the file and line of each.

    ``names`` is what messages call a column, where it has a name.
    """

    columns: Mapping[str, Sequence[str]]
    places: Sequence[tuple[Path, int]]
    names: Mapping[str, object] = field(default_factory=dict)
    comma: ClassVar[str] = "decimals are written with a point"

    def __len__(self) -> int:
        return len(self.places)

    def fail(self, key: str, index: int, reason: str) -> NoReturn:
        """Raise what is wrong in a row of the column ``key``."""
        path, line = self.places[index]
        column = f", column {self.names[key]!r}" if key in self.names else ""
        raise FormatError(path, f"line {line}{column}", reason)

    def none(self, key: str, bad: Array, reason: str) -> None:
        """Fail at the first row of ``bad`` (m,)."""
        if bad.any():
            self.fail(key, int(bad.argmax()), reason)

    def numbers(self, key: str, missing: bool = False) -> Array:
        """A column as finite float64 (m,); empty fields are NaN if ``missing``."""
        fields = self.columns[key]
        values = _floats(fields)
        for index in np.flatnonzero(~np.isfinite(values)).tolist():
            if not (missing and not fields[index].strip()):
                self.fail(key, index, self._reason(fields[index]))
        return values

    def _reason(self, field: str) -> str:
        if not field.strip():
            return "is empty, needs a number"
        text = field if len(field) <= 40 else field[:40] + "..."
        hint = f": {self.comma}" if "," in field else ""
        return f"{text!r} is not a finite number{hint}"

    def nanoseconds(self, key: str, unit: str = "s") -> Array:
        """A column of times in ``unit`` as int64 nanoseconds (m,), rounded once."""
        fields, scale = self.columns[key], TIME_UNITS[unit]
        beyond = np.abs(self.numbers(key)) > 9e18 / 10.0**scale
        for index in np.flatnonzero(beyond).tolist():
            self.fail(key, index, f"{fields[index]!r} {unit} is beyond the years 1680 to 2260")
        exact = (round(Decimal(field).scaleb(scale)) for field in fields)
        return np.fromiter(exact, np.int64, len(fields))


def _floats(fields: Sequence[str]) -> Array:
    """Fields as float64, NaN where they are no numbers: ASCII digits with nothing between them."""
    text = "".join(fields)
    try:
        if "_" in text or not text.isascii():
            raise ValueError
        return np.fromiter(map(float, fields), np.float64, len(fields))
    except ValueError:
        return np.fromiter(map(_number, fields), np.float64, len(fields))


def _number(field: str) -> float:
    try:
        return math.nan if "_" in field or not field.isascii() else float(field)
    except ValueError:
        return math.nan

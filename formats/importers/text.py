"""Logs in text form: files read whole, and their fields turned into numbers a column at a time."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import NoReturn

import numpy as np

from ...models.errors import FormatError
from ...models.records import Array

LONGEST_LINE = 65536
TIME_UNITS = {"s": 9, "ms": 6, "us": 3, "ns": 0}
"""Units of time as powers of ten over the nanosecond."""


@dataclass(frozen=True, slots=True)
class TextFile:
    """A text file: its lines without their ends, and what provenance says of it."""

    path: Path
    lines: tuple[str, ...]
    sha256: str

    @property
    def provenance(self) -> dict[str, str]:
        """Name and digest."""
        return {"name": self.path.name, "sha256": self.sha256}


def read_text(path: Path) -> TextFile:
    """The UTF-8 text file at ``path``.

    Raises
    ------
    FormatError : the file cannot be read, is empty, or no text of sane lines
    """
    try:
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise FormatError(path, "", reason) from error
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise FormatError(path, f"line {line}", "is not UTF-8 text") from error
    lines = tuple(text.replace("\r\n", "\n").replace("\r", "\n").split("\n"))
    longest = max(map(len, lines))
    if longest > LONGEST_LINE:
        line = list(map(len, lines)).index(longest) + 1
        raise FormatError(path, f"line {line}", f"is longer than {LONGEST_LINE} characters")
    if not text.strip():
        raise FormatError(path, "line 1", "the file is empty")
    return TextFile(path, lines, hashlib.sha256(data).hexdigest())


Fail = Callable[[int, str], NoReturn]
"""Raises the error of field ``index`` of a column, for a reason."""


def numbers(fields: Sequence[str], fail: Fail, missing: bool = False) -> Array:
    """The fields of one column as finite float64; empty ones are NaN if ``missing``.

    Digits are those of ASCII, and nothing stands between them.
    """
    text = "".join(fields)
    try:
        if "_" in text or not text.isascii():
            raise ValueError
        values = np.fromiter(map(float, fields), np.float64, len(fields))
    except ValueError:
        values = np.fromiter(map(_number, fields), np.float64, len(fields))
    for index in np.flatnonzero(~np.isfinite(values)).tolist():
        if not (missing and not fields[index].strip()):
            fail(index, _reason(fields[index]))
    return values


def _number(field: str) -> float:
    try:
        return math.nan if "_" in field or not field.isascii() else float(field)
    except ValueError:
        return math.nan


def _reason(field: str) -> str:
    text = field if len(field) <= 40 else field[:40] + "..."
    if not field.strip():
        return "is empty, needs a number"
    hint = ": decimals are written with a point" if "," in field else ""
    return f"{text!r} is not a finite number{hint}"


def nanoseconds(fields: Sequence[str], fail: Fail, unit: str = "s") -> Array:
    """The fields of a column of times in ``unit`` as int64 nanoseconds, rounded once."""
    scale = TIME_UNITS[unit]
    limit = 9e18 / 10.0**scale
    for index in np.flatnonzero(np.abs(numbers(fields, fail)) > limit).tolist():
        fail(index, f"{fields[index]!r} {unit} is beyond the years 1680 to 2260")
    exact = (round(Decimal(field).scaleb(scale)) for field in fields)
    return np.fromiter(exact, np.int64, len(fields))

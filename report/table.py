"""Tables of text and numbers, and how a number is written."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..models.names import printable


@dataclass(frozen=True, slots=True)
class Number:
    """A value with its standard error, NaN for none; one that is not ``valid`` is bracketed."""

    value: float
    stderr: float = math.nan
    valid: bool = True


Cell = str | int | float | Number | None


@dataclass(frozen=True, slots=True)
class Table:
    """A title, the names of the columns, and rows of as many cells."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]


def figures(number: Number, plus_minus: str = "±") -> str:
    """The number with the digits that its standard error leaves, or with three.

    The standard error keeps one digit, two if the first is 1.
    """
    if math.isnan(number.stderr) or number.stderr <= 0:
        text = _fixed(number.value, _decimals(number.value, 3))
    else:
        leading = number.stderr / 10 ** math.floor(math.log10(number.stderr))
        decimals = _decimals(number.stderr, 2 if leading < 1.95 else 1)
        stderr = _fixed(number.stderr, decimals)
        text = f"{_fixed(number.value, decimals)} {plus_minus} {stderr}"
    return text if number.valid else f"({text})"


def _decimals(value: float, digits: int) -> int:
    """Decimals that show so many significant digits."""
    return digits - 1 - math.floor(math.log10(abs(value))) if value else digits - 1


def _fixed(value: float, decimals: int) -> str:
    return (
        f"{value:.{decimals}f}"
        if 0 <= decimals <= 9
        else f"{value:.3g}"
        if decimals > 9
        else f"{value:.0f}"
    )


def as_shown(table: Table) -> Table:
    """The table with all its texts as they are shown."""
    columns = tuple(map(printable, table.columns))
    rows = (tuple(printable(c) if isinstance(c, str) else c for c in row) for row in table.rows)
    return Table(printable(table.title), columns, tuple(rows))


def plain(cell: Cell, plus_minus: str = "±") -> str:
    """A cell as text."""
    if cell is None:
        return ""
    return figures(cell, plus_minus) if isinstance(cell, Number) else str(cell)

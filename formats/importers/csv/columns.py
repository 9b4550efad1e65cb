"""What a mapping says of columns: the quantities, and where in a log each of them stands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ....models.errors import ParameterError
from ....models.parameters import require, resolve, shown, suggestion
from .units import NAMES, check_unit, split_unit


@dataclass(frozen=True, slots=True)
class Field:
    """Where a quantity comes from: a column, one ``value`` for all rows, or many columns.

    A column is named, or numbered from 1. The many columns of one quantity, one for each anchor
    (and device), are told as ``{anchor: column}``, ``{anchor: {device: column}}`` or by a
    ``pattern`` of their names such as ``a{anchor}-t{device}``.
    """

    column: Any = None
    value: Any = None
    unit: str = ""
    scale: float = 1.0
    columns: Any = None
    pattern: str = ""

    def check(self, key: str, where: str) -> Field:
        """The field, its value as text and its unit apart, if it can be that of ``key``."""
        given = [self.column, self.value, self.columns, self.pattern or None]
        if sum(one is not None for one in given) != 1:
            raise ParameterError(f"{where} needs either a column or a value")
        if self.column is not None:
            check_column(self.column, f"{where}: column")
        if self.columns is not None:
            for _, column in self.wide(where):
                check_column(column, f"{where}: columns")
        if key in NAMES:
            if self.unit or self.scale != 1.0 or self.columns is not None or self.pattern:
                raise ParameterError(f"{where} is a name: it has no unit, scale, columns, pattern")
            if self.value is None:
                return self
            ok = isinstance(self.value, str | int | float) and not isinstance(self.value, bool)
            require(ok and str(self.value) != "", f"{where}: value", "a name", self.value)
            return replace(self, value=str(self.value))
        require(self.scale != 0, f"{where}: scale", "other than 0", self.scale)
        check_unit(self.unit, key, where)
        if self.value is None:
            return self
        number, unit = split_unit(self.value, key, where)
        if unit and self.unit:
            raise ParameterError(f"{where}: {self.value!r} has a unit of its own, beside 'unit'")
        return replace(self, value=number, unit=unit or self.unit)

    def wide(self, where: str) -> Iterator[tuple[tuple[str, ...], Any]]:
        """The ids, anchor and perhaps device, and the column of each."""
        ok = isinstance(self.columns, Mapping) and len(self.columns) > 0
        require(ok, f"{where}: columns", "a mapping of anchors to columns", self.columns)
        for anchor, item in self.columns.items():
            if isinstance(item, Mapping):
                yield from (((str(anchor), str(d)), column) for d, column in item.items())
            else:
                yield (str(anchor),), item


@dataclass(frozen=True, slots=True)
class TimeField:
    """Where the time of a row comes from: :mod:`echoset.formats.importers.csv.times` reads it."""

    column: Any = None
    value: Any = None
    unit: tuple[str, ...] = ("",)
    scale: float = 1.0
    columns: Any = None
    format: str = ""
    zone: str = ""
    date: str = ""
    rate: float | None = None
    bits: int | None = None

    def check(self, key: str, where: str) -> TimeField:
        """The field, its value as text and its unit apart, if it can be that of a time."""
        given = [self.column, self.value, self.columns]
        if sum(one is not None for one in given) != 1:
            raise ParameterError(f"{where} needs either a column or a value")
        if self.column is not None:
            check_column(self.column, f"{where}: column")
        if self.columns is not None:
            ok = isinstance(self.columns, Sequence) and not isinstance(self.columns, str)
            require(ok and len(self.columns) > 0, f"{where}: columns", "a list", self.columns)
            for column in self.columns:
                check_column(column, f"{where}: columns")
        for unit in self.unit:
            check_unit(unit, key, where)
        count = len(self.columns or [0])
        require(len(self.unit) in (1, count), f"{where}: unit", f"one or {count}", list(self.unit))
        require(self.scale != 0, f"{where}: scale", "other than 0", self.scale)
        ticks = self.rate is not None or self.bits is not None
        if ticks and (self.rate is None or any(self.unit) or self.scale != 1.0):
            raise ParameterError(f"{where}: ticks have a rate, perhaps bits, and nothing else")
        require(self.rate is None or self.rate > 0, f"{where}: rate", "positive", self.rate)
        ok = self.bits is None or 1 <= self.bits <= 63
        require(ok, f"{where}: bits", "between 1 and 63", self.bits)
        if self.value is None:
            return self
        number, unit = split_unit(self.value, key, where)
        if unit and any(self.unit):
            raise ParameterError(f"{where}: {self.value!r} has a unit of its own, beside 'unit'")
        return replace(self, value=number, unit=(unit or self.unit[0],))


def check_column(column: Any, where: str) -> None:
    """Raise ParameterError unless ``column`` is a name, or a number from 1."""
    number = isinstance(column, int) and not isinstance(column, bool)
    ok = number or (isinstance(column, str) and column != "")
    require(ok, where, "the name or number of a column", column)


def fields(
    spec: object, required: Sequence[str], optional: Sequence[str], where: str
) -> dict[str, Field | TimeField]:
    """The fields that a mapping's ``columns`` names.

    Raises
    ------
    ParameterError : a quantity is unknown or cannot be what is said, or a required one is missing
    """
    if not isinstance(spec, Mapping):
        raise ParameterError(f"{where} must map quantities to columns, got {shown(spec)}")
    found: dict[str, Field | TimeField] = {}
    for key, item in spec.items():
        if key not in required and key not in optional:
            hint = suggestion(key, [*required, *optional])
            raise ParameterError(f"{where}: unknown quantity {shown(key)}{hint}")
        place = f"{where}.{key}"
        item = item if isinstance(item, Mapping) else {"column": item}
        if key == "time":
            found[key] = resolve(TimeField, (place, item)).check(key, place)
        else:
            found[key] = resolve(Field, (place, item)).check(key, place)
    for key in required:
        if key not in found:
            raise ParameterError(f"{where}: {key!r} is missing")
    return found

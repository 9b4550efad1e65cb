"""A table whose columns a mapping has named: its text, its numbers in SI, its times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import ClassVar, NoReturn

import numpy as np

from ....models.columns import COLUMNS
from ....models.errors import FormatError, ParameterError
from ....models.records import Array
from ..rows import restart
from ..text import Table
from . import times
from .columns import Field, TimeField
from .reading import Reading
from .units import NAMES, to_si


@dataclass(frozen=True)
class Log(Table):
    """A table whose columns a mapping names: as text, as indices, or in SI.

    ``cell`` (m,) is the index of the column that a row was made of, where one quantity has many;
    ``skipped`` counts the rows that were left out, by the condition; ``computed`` (m,) are columns
    in SI that were made of others.
    """

    fields: Mapping[str, Field | TimeField] = field(default_factory=dict)
    reading: Reading = field(default_factory=Reading)
    where: str = ""
    path: Path = Path()
    epoch: int = 0
    cell: Sequence[int] = ()
    skipped: Mapping[str, int] = field(default_factory=dict)
    computed: Mapping[str, Array] = field(default_factory=dict)
    comma: ClassVar[str] = "decimals are written with a point, or say decimal: ','"

    def __contains__(self, key: str) -> bool:
        return key in self.columns

    def fail(self, key: str, index: int, reason: str) -> NoReturn:
        """Raise what is wrong in a row of the column ``key``, or with its value in the mapping."""
        given = self.fields.get(key)
        if given is not None and given.value is not None:
            raise ParameterError(f"{self.where}.{key}: value {reason}")
        path, line = self.places[index]
        name = self.names[key]
        name = name[self.cell[index]] if isinstance(name, tuple) else name
        raise FormatError(path, f"line {line}, column {name!r}", reason)

    def refuse(self, key: str, bad: Array, reason: str) -> None:
        """Fail at the first row of ``bad`` (m,), quoting the field."""
        if bad.any():
            index = int(bad.argmax())
            self.fail(key, index, f"{self.columns[key][index][:40]!r} {reason}")

    def taken(self, kept: Array) -> Log:
        """The rows that are ``kept`` (m,)."""
        rows = np.flatnonzero(kept).tolist()
        columns = {key: [text[i] for i in rows] for key, text in self.columns.items()}
        places, cell = [self.places[i] for i in rows], [self.cell[i] for i in rows]
        return replace(self, columns=columns, places=places, cell=cell)

    def pointed(self, *keys: str) -> Log:
        """The table with decimal points in its numbers."""
        if self.reading.decimal == ".":
            return self
        for key in keys:
            points = np.array(["." in f for f in self.columns[key]], bool)
            if key not in self.fields or self.fields[key].value is None:
                self.refuse(key, points, "has a point, yet the decimal sign is a comma")
        columns = {key: [f.replace(",", ".") for f in self.columns[key]] for key in keys}
        return replace(self, columns={**self.columns, **columns})

    def values(self, key: str, missing: bool = False) -> Array:
        """The column ``key`` in SI (m,); empty fields are NaN if ``missing``."""
        if key in self.computed:
            made = self.computed[key]
            self.refuse(key, np.isnan(made) & (not missing), "is empty, needs a number")
            return made
        given = self.fields[key]
        assert isinstance(given, Field)
        read = self.pointed(key).numbers(key, missing)
        with np.errstate(over="ignore"):
            values = to_si(read, given.unit, key) * given.scale
        self.refuse(key, np.isinf(values), "is not a finite number in SI")
        if key in COLUMNS and COLUMNS[key].minimum == 0:
            self.refuse(key, values < 0, "is negative")
        return np.asarray(values)

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

    @cached_property
    def group(self) -> Array:
        """What a row belongs to (m,): its link, sensor or label, as a number."""
        keys = [key for key in NAMES if key in self and key != "scan"]
        if not keys:
            return np.zeros(len(self), np.int64)
        pairs = list(zip(*(self.columns[key] for key in keys), strict=True))
        known = {pair: i for i, pair in enumerate(dict.fromkeys(pairs))}
        return np.fromiter((known[pair] for pair in pairs), np.int64, len(pairs))

    @cached_property
    def clock(self) -> Array:
        """The times as they are written, int64 nanoseconds after the epoch (m,)."""
        given = self.fields["time"]
        assert isinstance(given, TimeField)
        keys = time_keys(given)
        table = self if times.is_text(self, keys, given) else self.pointed(*keys)
        return times.read(table, keys, given, self.epoch)

    def time(self) -> Array:
        """The column ``time`` as int64 nanoseconds after the epoch (m,).

        Raises
        ------
        FormatError : the clock begins anew, or a stamp is far from all others
        """
        time, given, text = self.clock, self.reading, self.columns["time"]
        index = times.stray(time, given.longest_pause)
        if index is not None:
            days = given.longest_pause / 86400
            reason = f"is more than {days:.4g} days from the other times; if so, 'longest_pause'"
            self.fail("time", index, f"{text[index][:40]!r} {reason} in the mapping is larger")
        if given.restarts == "wrap":
            return times.continued(time)
        if given.restarts == "error":
            index = restart(*self._starts(time))
            if index is not None:
                reason = "the clock goes back and on again: say by 'restarts' in the mapping if"
                reason += " these are runs (split), a counter (wrap) or rows in any order (sort)"
                self.fail("time", index, f"{text[index][:40]!r}: {reason}")
        return time

    def _starts(self, time: Array) -> tuple[Array, Array]:
        """Times of rows, or of scans where rows tell theirs, and what each belongs to."""
        if "scan" not in self:
            return time, self.group
        scan = np.array(self.columns["scan"], object)
        new = np.ones(len(time), bool)
        new[1:] = (scan[1:] != scan[:-1]) | (self.group[1:] != self.group[:-1])
        first = np.flatnonzero(new)
        start = np.minimum.reduceat(time, first) if len(first) else time
        return start[np.cumsum(new) - 1], self.group

    def check_shared(self, time: Array) -> None:
        """Fail where times have lost their digits, so that different scans or events share one."""
        given = self.fields["time"]
        assert isinstance(given, TimeField)
        if self.reading.shared_times or "scan" in self or given.value is not None:
            return
        text = times.is_text(self, time_keys(given), given)
        bad = times.collapsed(time, self.group, text)
        reason = "is shared with a row before, and all times are whole seconds: if the digits are"
        reason += " not lost and these rows are one scan, say shared_times: true in the mapping"
        self.refuse("time", bad, reason)


def time_keys(given: TimeField) -> list[str]:
    """What the columns that make a time are called in a table."""
    return ["time", *(f"time.{i}" for i in range(1, len(given.columns or ())))]


def loose(fields: Sequence[str], reading: Reading) -> Array:
    """Fields as numbers (m,), NaN where they are none."""
    made = []
    if reading.decimal == ",":
        fields = [f.replace(",", ".") for f in fields]
    for text in fields:
        try:
            made.append(float(text) if text.isascii() and "_" not in text else np.nan)
        except ValueError:
            made.append(np.nan)
    return np.array(made, np.float64)

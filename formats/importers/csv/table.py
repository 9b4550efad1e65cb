"""Delimited text tables whose columns are chosen, and converted to SI, by a mapping."""

from __future__ import annotations

import csv
import logging
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, NoReturn

import numpy as np

from ....models.columns import COLUMNS
from ....models.errors import FormatError, ParameterError
from ....models.parameters import require, suggestion
from ....models.records import Array
from ..rows import restart
from ..text import Table, TextFile
from . import skip, times
from .columns import Field, TimeField
from .units import NAMES, to_si

_log = logging.getLogger(__name__)
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
            raise ParameterError(f"delimiter must be one character, got {self.delimiter!r}")
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


@dataclass(frozen=True)
class Log(Table):
    """A table whose columns a mapping names: as text, as indices, or in SI.

    ``cell`` (m,) is the index of the column that a row was made of, where one quantity has many;
    ``skipped`` counts the rows that were left out, by the condition.
    """

    fields: Mapping[str, Field | TimeField] = field(default_factory=dict)
    reading: Reading = field(default_factory=Reading)
    where: str = ""
    path: Path = Path()
    epoch: int = 0
    cell: Sequence[int] = ()
    skipped: Mapping[str, int] = field(default_factory=dict)
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


def read_table(
    files: Sequence[TextFile],
    reading: Reading,
    fields: Mapping[str, Field | TimeField],
    where: str,
    epoch: int = 0,
) -> Log:
    """The ``fields`` of the table in ``files``, which are written alike.

    Raises
    ------
    FormatError : a column is missing, or a row has too few or many fields
    """
    raw = [_Rows.of(file, reading, fields) for file in files]
    first = raw[0]
    if any(rows.header != first.header for rows in raw[1:]):
        raise FormatError(raw[-1].path, "line 1", f"its columns are not those of {first.path}")
    body = [row for rows in raw for row in rows.body]
    places = [(rows.path, line) for rows in raw for line in rows.lines]
    counts = {key: sum(rows.left_out.get(key, 0) for rows in raw) for key in first.left_out}
    return _log_of(first, body, places, reading, fields, where, epoch, counts)


@dataclass(frozen=True, slots=True)
class _Rows:
    """The rows of a file, its header, and how many rows were not of the kind that is wanted."""

    path: Path
    header: list[str] | None
    width: int
    line: int
    body: list[list[str]]
    lines: list[int]
    left_out: dict[str, int]

    @staticmethod
    def of(file: TextFile, reading: Reading, fields: Mapping[str, Field | TimeField]) -> _Rows:
        path, wanted = file.path, {str(k): _words(v) for k, v in reading.rows.items()}
        header: list[str] | None = list(reading.names) or None
        from_file, width, start = reading.header and not reading.names, 0, 0
        body: list[list[str]] = []
        lines: list[int] = []
        left_out = {f"rows: not {k} {'|'.join(v)}": 0 for k, v in wanted.items()}
        reader = csv.reader(
            _sifted(file.lines(), reading), delimiter=reading.delimiter, strict=True
        )
        at = 0
        try:
            for row in reader:
                at = reader.line_num
                if not row:
                    continue
                if not start:
                    start = at
                    _expect_columns(row, fields, reading.delimiter, path, at)
                    if from_file:
                        header, width = [name.strip() for name in row], len(row)
                        continue
                    if reading.header and reading.names and [f.strip() for f in row] == header:
                        continue
                found = next((k for k, v in wanted.items() if not _is(row, k, v, header, path)), "")
                if found:
                    left_out[f"rows: not {found} {'|'.join(wanted[found])}"] += 1
                    continue
                width = width or (len(header) if header else len(row))
                if len(row) != width:
                    reason = f"has {len(row)} fields, needs {width}"
                    raise FormatError(path, f"line {at}", reason)
                body.append(row)
                lines.append(at)
        except csv.Error as error:
            raise FormatError(path, f"line {at + 1}", str(error)) from error
        if not start:
            raise FormatError(path, "line 1", "there is nothing but comments")
        return _Rows(path, header, width, start, body, lines, left_out)

    def position(self, column: Any) -> int:
        """Index of a column that is named, or numbered from 1."""
        return _position(column, self.header, self.width, self.path, self.line)


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


def _log_of(
    first: _Rows,
    body: list[list[str]],
    places: list[tuple[Path, int]],
    reading: Reading,
    fields: Mapping[str, Field | TimeField],
    where: str,
    epoch: int,
    counts: dict[str, int],
) -> Log:
    """The long form of the rows: one for each column of the quantities that have many."""
    wide = {k: _wide(g, k, first, where) for k, g in fields.items() if isinstance(g, Field)}
    wide = {key: cells for key, cells in wide.items() if cells}
    ids = next(([*cells] for cells in wide.values()), [])
    for key, cells in wide.items():
        if list(cells) != ids:
            raise ParameterError(f"{where}.{key}: its columns are not those of the same anchors")
    n = len(ids) or 1
    columns: dict[str, Sequence[str]] = {}
    names: dict[str, object] = {}
    for key, given in fields.items():
        table = {str(k): str(v) for k, v in reading.rename.get(key, {}).items()}
        if key in wide:
            picked = [row[k].strip() for row in body for k in wide[key].values()]
            columns[key] = _cleaned(picked, reading)
            names[key] = tuple(
                first.header[k] if first.header else k + 1 for k in wide[key].values()
            )
        elif given.value is not None:
            columns[key], names[key] = [str(given.value)] * (len(body) * n), None
        else:
            listed = (
                given.columns if isinstance(given, TimeField) and given.columns else [given.column]
            )
            for part, column in zip(
                time_keys(given) if isinstance(given, TimeField) else [key], listed, strict=True
            ):
                k = first.position(column)
                picked = [row[k].strip() for row in body for _ in range(n)]
                picked = _cleaned(picked, reading)
                columns[part] = [table.get(f, f) for f in picked] if table else picked
                names[part] = column
    for i, key in enumerate(("anchor", "device")[: len(ids[0])] if ids else ()):
        if key in fields:
            raise ParameterError(f"{where}.{key}: the columns of {' '.join(wide)} tell it already")
        table = {str(k): str(v) for k, v in reading.rename.get(key, {}).items()}
        columns[key] = [table.get(one[i], one[i]) for one in ids] * len(body)
        names[key] = names[next(iter(wide))]
    unknown = [key for key in reading.rename if key not in columns]
    if unknown:
        raise ParameterError(f"rename: there is no column {unknown[0]!r}")
    log = Log(
        columns,
        [place for place in places for _ in range(n)],
        names,
        fields,
        reading,
        where,
        first.path,
        epoch,
        list(range(n)) * len(body),
    )
    return _sieved(log, first, body, n, counts)


def _sieved(log: Log, first: _Rows, body: list[list[str]], n: int, counts: dict[str, int]) -> Log:
    """The rows that no condition leaves out and that belong to the run that is wanted."""

    def lookup(name: str | int) -> skip.Column:
        if isinstance(name, str) and name in log.columns and name != "time":
            given = log.fields.get(name)
            text = log.columns[name]
            numbers = loose(text, log.reading)
            if isinstance(given, Field) and name not in NAMES:
                numbers = to_si(numbers, given.unit, name) * given.scale
            return skip.Column(text, numbers)
        try:
            k = first.position(name)
        except FormatError as error:
            raise ParameterError(f"skip: {error}") from None
        picked = [row[k].strip() for row in body for _ in range(n)]
        text = _cleaned(picked, log.reading)
        return skip.Column(text, loose(text, log.reading))

    kept = np.ones(len(log), bool)
    for condition in log.reading.conditions:
        found = np.broadcast_to(condition.holds(lookup), kept.shape) & kept
        counts[condition.text] = counts.get(condition.text, 0) + int(found.sum())
        kept &= ~found
    log = _taken(log, kept, counts)
    if log.reading.restarts == "split" and "time" in log:
        run, wanted = times.runs(log.clock), log.reading.run - 1
        count = int(run.max(initial=0)) + 1
        if wanted >= count:
            raise FormatError(log.path, "", f"has {count} runs, there is no run {wanted + 1}")
        counts[f"other runs than {wanted + 1} of {count}"] = int((run != wanted).sum())
        log = _taken(log, run == wanted, counts)
    for reason, count in counts.items():
        if count:
            _log.warning("%s: left out %d rows: %s", log.path, count, reason)
    return log


def _taken(log: Log, kept: Array, counts: dict[str, int]) -> Log:
    """The rows of a table that are ``kept`` (m,)."""
    rows = np.flatnonzero(kept).tolist()
    columns = {key: [text[i] for i in rows] for key, text in log.columns.items()}
    places, cell = [log.places[i] for i in rows], [log.cell[i] for i in rows]
    return replace(log, columns=columns, places=places, cell=cell, skipped=dict(counts))


def _wide(given: Field, key: str, rows: _Rows, where: str) -> dict[tuple[str, ...], int]:
    """Index of the column of each id, where a quantity has many columns."""
    place = f"{where}.{key}"
    if given.columns is not None:
        found = {ids: rows.position(column) for ids, column in given.wide(place)}
    elif given.pattern:
        keys = re.findall(r"\{(\w+)\}", given.pattern)
        ok = sorted(keys) in (["anchor"], ["anchor", "device"])
        require(ok, f"{place}: pattern", "a name with {anchor}, perhaps {device}", given.pattern)
        if rows.header is None:
            raise ParameterError(f"{place}: a pattern needs a header, or 'names'")
        parts = re.split(r"\{\w+\}", given.pattern)
        made = re.escape(parts[0])
        for name, part in zip(keys, parts[1:], strict=True):
            made += f"(?P<{name}>.+?){re.escape(part)}"
        matches = [(k, re.fullmatch(made, name)) for k, name in enumerate(rows.header)]
        found = {tuple(m[name] for name in sorted(keys)): k for k, m in matches if m}
        if not found:
            reason = f"no column is called like {given.pattern!r}: there are "
            raise FormatError(rows.path, f"line {rows.line}", reason + ", ".join(rows.header))
    else:
        return {}
    if len({len(ids) for ids in found}) > 1:
        raise ParameterError(f"{place}: some columns tell a device, others do not")
    return found


def _cleaned(fields: list[str], reading: Reading) -> list[str]:
    """Fields without the words for missing."""
    if not reading.missing:
        return fields
    words = set(reading.missing)
    return ["" if f in words else f for f in fields]


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
    hint = suggestion(str(column), names) or f": there are {', '.join(names)}"
    raise FormatError(path, f"line {line}", f"no column {column!r}{hint}")

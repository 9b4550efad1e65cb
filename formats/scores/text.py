"""Scores as the text of a CSV or JSON file, and back."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import chain, count, islice
from sys import intern
from typing import IO, Any, NoReturn

import numpy as np

from ...models.errors import FormatError
from ...models.records import Scores
from ...models.runs import Runs
from ..foreign import hint
from ..plain_json import json_object

NAMES = ("recording", "estimator", "metric", "part")
NUMBERS = ("time", "value", "n", "stderr")
COLUMNS = (*NAMES, *NUMBERS)

_COMMENT = "# provenance: "
_INTEGER = re.compile(r"\d{1,18}", re.ASCII)
_FLOAT = re.compile(r"-?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_BLOCK = 1 << 14
_LONGEST = 1 << 26
"""Characters of a line, which may hold the provenance of many files."""
_LARGEST = float(np.finfo(float).max)


def _rows(scores: Scores) -> Iterator[list[tuple[Any, ...]]]:
    """The rows as Python values, None for NaN, in blocks."""
    names = [iter(getattr(scores, name)) for name in NAMES]
    for start in range(0, len(scores), _BLOCK):
        part = slice(start, start + _BLOCK)
        times, errors = (
            [None if math.isnan(x) else x for x in column[part].tolist()]
            for column in (scores.time, scores.stderr)
        )
        numbers = times, scores.value[part].tolist(), scores.n[part].tolist(), errors
        yield list(zip(*(islice(n, _BLOCK) for n in names), *numbers, strict=True))


def _table(rows: Iterable[tuple[Any, ...]], provenance: dict[str, Any]) -> Scores:
    """Scores from rows of Python values, None for NaN."""
    columns = list(zip(*rows, strict=True)) or [()] * len(COLUMNS)
    time, value, stderr = (
        np.array([math.nan if x is None else x for x in columns[i]], float) for i in (4, 5, 7)
    )
    recording, estimator, metric, part = map(Runs.of, columns[:4])
    n = np.array(columns[6], np.int64)
    return Scores(recording, estimator, metric, part, time, value, n, stderr, provenance)


def to_csv(scores: Scores) -> Iterator[bytes]:
    """The table with its provenance in a comment; NaN is empty."""
    text = io.StringIO()
    if scores.provenance:
        text.write(_COMMENT + json.dumps(scores.provenance, sort_keys=True, allow_nan=False) + "\n")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for block in _rows(scores):
        writer.writerows(block)
        yield text.getvalue().encode()
        text.seek(0)
        text.truncate()
    yield text.getvalue().encode()


def lines(text: IO[str], path: object) -> Iterator[str]:
    """The lines of ``text``, one after the other, with their ends."""
    for number in count(1):
        line = text.readline(_LONGEST)
        if len(line) == _LONGEST:
            raise FormatError(path, f"line {number}", "is too long to be one of scores")
        if not line:
            return
        yield line


def first_bad_byte(file: IO[bytes]) -> int:
    """Where the bytes of ``file`` stop to be UTF-8."""
    try:
        file.read().decode()
    except UnicodeDecodeError as error:
        return error.start
    return 0


def from_csv(text: Iterator[str], path: object) -> Scores:
    """The table that :func:`to_csv` wrote, from its lines; FormatError with the line otherwise."""
    provenance, skipped = {}, 0
    start = list(islice(text, 1))
    if start and start[0].startswith(_COMMENT):
        comment = start.pop().removeprefix(_COMMENT).removesuffix("\n")
        provenance, skipped = json_object(comment, path), 1
    reader = csv.reader(chain(start, text), strict=True)
    tables: list[Scores] = []
    rows: list[tuple[Any, ...]] = []

    def fail(reason: str) -> NoReturn:
        raise FormatError(path, f"line {reader.line_num + skipped}", reason)

    try:
        if next(reader, None) != list(COLUMNS):
            fail(f"the header is not {','.join(COLUMNS)}{hint(path)}")
        for row in reader:
            if len(row) != len(COLUMNS):
                fail(f"has {len(row)} fields, needs {len(COLUMNS)}")
            numbers = dict(zip(NUMBERS, row[4:], strict=True))
            for name, number in numbers.items():
                optional = name in ("time", "stderr") and not number
                if not optional and not (_INTEGER if name == "n" else _FLOAT).fullmatch(number):
                    fail(f"{name}: {number[:40]!r} is not a number")
            time, value, stderr = (
                float(numbers[x]) if numbers[x] else math.nan for x in ("time", "value", "stderr")
            )
            if math.inf in map(abs, (time, value, stderr)):
                fail("a number is not finite")
            rows.append((*map(intern, row[:4]), time, value, int(numbers["n"]), stderr))
            if len(rows) == _BLOCK:
                tables.append(_table(rows, {}))
                rows.clear()
    except csv.Error as error:
        fail(str(error))
    return replace(Scores.join([*tables, _table(rows, {})]), provenance=provenance)


def to_json(scores: Scores) -> Iterator[bytes]:
    """An object of provenance and scores, one row a line; NaN is null."""
    provenance = json.dumps(scores.provenance, sort_keys=True, allow_nan=False)
    yield f'{{"provenance": {provenance}, "scores": [\n'.encode()
    comma = ""
    for block in _rows(scores):
        lines = (json.dumps(dict(zip(COLUMNS, row, strict=True))) for row in block)
        yield (comma + ",\n".join(lines)).encode()
        comma = ",\n"
    yield b"\n]}\n"


def from_json(text: str, path: object) -> Scores:
    """What :func:`to_json` wrote; FormatError with the line otherwise."""
    tree = json_object(text, path)
    provenance, table = tree.get("provenance"), tree.get("scores")
    if set(tree) != {"provenance", "scores"} or not isinstance(provenance, dict):
        reason = f"not an object of provenance and scores{hint(path)}"
        raise FormatError(path, "line 1", reason)
    if not isinstance(table, list):
        raise FormatError(path, "scores", "is not a list")
    for i, row in enumerate(table):
        if not isinstance(row, dict) or set(row) != set(COLUMNS):
            raise FormatError(path, f"line {i + 2}", f"is not an object of {', '.join(COLUMNS)}")
        for name, value in row.items():
            if not _is_a(name, value):
                reason = f"{name}: {json.dumps(value)[:40]} is not allowed here"
                raise FormatError(path, f"line {i + 2}", reason)
    return _table((tuple(row[c] for c in COLUMNS) for row in table), provenance)


def _is_a(column: str, value: object) -> bool:
    """Whether a JSON value may stand in ``column``."""
    if column in NAMES:
        return isinstance(value, str)
    if value is None:
        return column in ("time", "stderr")
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    if column == "n":
        return isinstance(value, int) and abs(value) < 2**63
    return abs(value) <= _LARGEST

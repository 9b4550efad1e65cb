"""Delimited text tables: the columns that a mapping names, of the rows that it wants."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ....models.errors import FormatError, ParameterError
from ....models.parameters import listed, require, shown
from ..text import TextFile
from . import skip, times
from .columns import Field, TimeField
from .log import Log, loose, time_keys
from .reading import Reading, Rows, read_rows
from .units import NAMES, to_si

_log = logging.getLogger(__name__)
Cells = dict[tuple[str, ...], int]
"""Index of the column of each id, anchor and perhaps device."""


def read_table(
    files: Sequence[TextFile],
    reading: Reading,
    fields: Mapping[str, Field | TimeField],
    where: str,
    epoch: int = 0,
) -> Log:
    """The ``fields`` of the table in ``files``, which are written alike.

    A quantity may have many columns: each makes a row of the table. Rows that a condition leaves
    out, and those of other runs than the one that is wanted, are counted.

    Raises
    ------
    FormatError : a column is missing, or a row has too few or many fields
    """
    rows = read_rows(files, reading, fields)
    wide = {k: _cells(g, f"{where}.{k}", rows) for k, g in fields.items() if isinstance(g, Field)}
    wide = {key: cells for key, cells in wide.items() if cells}
    ids = next((list(cells) for cells in wide.values()), [])
    for key, cells in wide.items():
        if list(cells) != ids:
            raise ParameterError(f"{where}.{key}: its columns are not those of the same anchors")
    n = len(ids) or 1
    columns: dict[str, Sequence[str]] = {}
    names: dict[str, object] = {}
    for key, given in fields.items():
        if key in wide:
            columns[key] = rows.text([*wide[key].values()])
            names[key] = tuple(rows.name(k) for k in wide[key].values())
            continue
        for part, column in _columns(key, given):
            k = [rows.position(column)] * n if given.value is None else []
            columns[part] = rows.text(k) if k else [str(given.value)] * (n * len(rows.body))
            names[part] = column
    for i, key in enumerate(("anchor", "device")[: len(ids[0])] if ids else ()):
        if key in fields:
            raise ParameterError(f"{where}.{key}: the columns of {' '.join(wide)} tell it already")
        columns[key] = [one[i] for one in ids] * len(rows.body)
        names[key] = names[next(iter(wide))]
    for key, table in reading.rename.items():
        if key not in columns:
            raise ParameterError(f"rename: there is no column {key!r}")
        new = {str(old): str(name) for old, name in table.items()}
        columns[key] = [new.get(f, f) for f in columns[key]]
    places = [place for place in rows.places for _ in range(n)]
    cell = list(range(n)) * len(rows.body)
    log = Log(columns, places, names, fields, reading, where, rows.path, epoch, cell)
    return _sieved(log, rows, n)


def _columns(key: str, given: Field | TimeField) -> Iterator[tuple[str, object]]:
    """The columns of a quantity by what a table calls them."""
    if isinstance(given, TimeField) and given.columns:
        yield from zip(time_keys(given), given.columns, strict=True)
    else:
        yield key, given.column


def _cells(given: Field, where: str, rows: Rows) -> Cells:
    """The columns of a quantity that has many; none of one that has not."""
    if given.columns is not None:
        found = {ids: rows.position(column) for ids, column in given.wide(where)}
    elif given.pattern:
        found = _called(given.pattern, where, rows)
    else:
        return {}
    if len({len(ids) for ids in found}) > 1:
        raise ParameterError(f"{where}: some columns tell a device, others do not")
    return found


def _called(pattern: str, where: str, rows: Rows) -> Cells:
    """The columns that are called like ``a{anchor}-t{device}``."""
    keys = re.findall(r"\{(\w+)\}", pattern)
    ok = sorted(keys) in (["anchor"], ["anchor", "device"])
    require(ok, f"{where}: pattern", "a name with {anchor}, perhaps {device}", pattern)
    if rows.header is None:
        raise ParameterError(f"{where}: a pattern needs a header, or 'names'")
    first, *parts = map(re.escape, re.split(r"\{\w+\}", pattern))
    made = first + "".join(f"(?P<{k}>.+?){part}" for k, part in zip(keys, parts, strict=True))
    matches = [(k, re.fullmatch(made, name)) for k, name in enumerate(rows.header)]
    found = {tuple(m[key] for key in sorted(keys)): k for k, m in matches if m}
    if not found:
        reason = f"no column is called like {shown(pattern)}: there are {listed(rows.header)}"
        raise FormatError(rows.path, f"line {rows.line}", reason)
    return found


def _sieved(log: Log, rows: Rows, n: int) -> Log:
    """The rows that no condition leaves out and that belong to the run that is wanted."""

    def lookup(name: str | int) -> skip.Column:
        if isinstance(name, str) and name in log.columns and name != "time":
            given, text = log.fields.get(name), log.columns[name]
            numbers = loose(text, log.reading)
            if isinstance(given, Field) and name not in NAMES:
                numbers = to_si(numbers, given.unit, name) * given.scale
            return skip.Column(text, numbers)
        try:
            text = rows.text([rows.position(name)] * n)
        except FormatError as error:
            raise ParameterError(f"skip: {error}") from None
        return skip.Column(text, loose(text, log.reading))

    counts = dict(rows.left_out)
    kept = np.ones(len(log), bool)
    for condition in log.reading.conditions:
        found = np.broadcast_to(condition.holds(lookup), kept.shape) & kept
        counts[condition.text] = int(found.sum())
        kept &= ~found
    log = log.taken(kept)
    if log.reading.restarts == "split":
        run, wanted = times.runs(log.clock), log.reading.run - 1
        count = int(run.max(initial=0)) + 1
        if wanted >= count:
            raise FormatError(log.path, "", f"has {count} runs, there is no run {wanted + 1}")
        counts[f"other runs than {wanted + 1} of {count}"] = int((run != wanted).sum())
        log = log.taken(run == wanted)
    said = ", ".join(f"{count} rows ({reason})" for reason, count in counts.items() if count)
    if said:
        _log.warning("%s: left out %s", log.path, said)
    return replace(log, skipped=counts)

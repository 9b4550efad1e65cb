"""Scores as CSV, JSON and HDF5: the same table in each, lossless and byte-deterministic.

CSV: a line ``# provenance: <json>`` if there is any, the header, one line a row; NaN is empty.
JSON: ``{"provenance": {...}, "scores": [{column: value, ...}, ...]}``, one row a line; NaN is null.
HDF5: one dataset a column, names as indices into the lists in ``names``; NaN is NaN.
"""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from ...models.errors import FormatError, ParameterError
from ...models.records import Scores
from ...models.runs import Runs
from ..foreign import hint
from ..plain_json import json_object
from .text import (
    COLUMNS,
    NAMES,
    NUMBERS,
    first_bad_byte,
    from_csv,
    from_json,
    lines,
    to_csv,
    to_json,
)

SUFFIXES = {".csv": "csv", ".json": "json", ".h5": "h5", ".hdf5": "h5"}
Target = Path | IO[bytes]

_HDF5 = b"\x89HDF\r\n\x1a\n"


def write(scores: Scores, target: Target, format: str) -> None:
    """Write ``scores`` as ``csv``, ``json`` or ``h5``. Not atomic by itself.

    Raises
    ------
    FormatError : the table breaks its contract
    ParameterError : an unknown format
    """
    if format not in _WRITERS:
        raise ParameterError(f"scores are written as {', '.join(_WRITERS)}, not {format!r}")
    _check(scores, "scores")
    blocks = _WRITERS[format](scores)
    if isinstance(target, Path):
        with target.open("wb") as file:
            file.writelines(blocks)
    else:
        target.writelines(blocks)


def read(source: Target, path: object = None) -> Scores:
    """Read and check scores, whatever their format, which the first bytes tell.

    Raises
    ------
    FormatError : it cannot be read, is damaged or of another kind; with the line where
    """
    path = path if path is not None else source if isinstance(source, Path) else "<stream>"
    try:
        with source.open("rb") if isinstance(source, Path) else io.BytesIO(source.read()) as file:
            scores = _read(file, path)
    except OSError as error:
        raise FormatError(path, "", f"{error.strerror or error}{hint(path)}") from error
    _check(scores, path)
    return scores


def _read(file: IO[bytes], path: object) -> Scores:
    """Scores of the format that the first bytes tell; a CSV file is read line by line."""
    start = file.read(len(_HDF5))
    if start == _HDF5:
        return _read_h5(start + file.read(), path)
    while start.isspace():
        start = file.read(1)
    file.seek(0)
    text = io.TextIOWrapper(file, "utf-8", newline="")
    try:
        if start.lstrip().startswith(b"{"):
            return from_json(text.read(), path)
        return from_csv(lines(text, path), path)
    except UnicodeDecodeError:
        file.seek(0)
        place = first_bad_byte(file)
        raise FormatError(path, f"byte {place}", "not UTF-8 text") from None
    finally:
        text.detach()


def _check(scores: Scores, path: object) -> None:
    """Raise :class:`FormatError` at the first row that breaks the table's contract."""
    for column in COLUMNS:
        if len(getattr(scores, column)) != len(scores):
            raise FormatError(path, column, "is not as long as the other columns")
    finite = np.isfinite
    for column, good, rule in (
        ("time", ~np.isinf(scores.time), "finite or missing"),
        ("value", finite(scores.value), "finite"),
        ("n", scores.n >= 0, "at least 0"),
        (
            "stderr",
            np.isnan(scores.stderr) | (finite(scores.stderr) & (scores.stderr >= 0)),
            "at least 0 or missing",
        ),
    ):
        if not good.all():
            i = int(np.argmin(good))
            reason = f"must be {rule}, got {getattr(scores, column)[i]}"
            raise FormatError(path, f"row {i + 1}, {column}", reason)


def _to_h5(scores: Scores) -> Iterator[bytes]:
    from ..hdf5.writer import LeafWriter

    data = io.BytesIO()
    out = LeafWriter(data)
    lists = {name: list(dict.fromkeys(getattr(scores, name))) for name in NAMES}
    try:
        out.put("kind", "scores")
        out.put("provenance", json.dumps(scores.provenance, sort_keys=True, allow_nan=False))
        out.put("names", json.dumps(lists))
        for name in NAMES:
            index = {text: i for i, text in enumerate(lists[name])}
            runs = [(index[text], count) for text, count in Runs.of(getattr(scores, name)).runs()]
            numbers, counts = np.array(runs, np.int64).reshape(-1, 2).T
            out.put(name, np.repeat(numbers, counts).astype(np.int32))
        for name in NUMBERS:
            out.put(name, getattr(scores, name))
        out.close()
    finally:
        out.abort()
    yield data.getvalue()


def _read_h5(data: bytes, path: object) -> Scores:
    from ..hdf5.reader import LeafReader

    reader = LeafReader(io.BytesIO(data), path)
    try:
        found: dict[str, Any] = reader.read(list(reader.leaves))
    finally:
        reader.file.close()
    if found.get("kind") != "scores":
        raise FormatError(path, "kind", f"{found.get('kind')!r}, not scores")
    try:
        lists = json_object(found["names"], path)
        recording, estimator, metric, part = (_named(lists[x], found[x]) for x in NAMES)
        time, value, n, stderr = (
            np.asarray(found[x]).astype("i8" if x == "n" else "f8", casting="safe") for x in NUMBERS
        )
        provenance = json_object(found["provenance"], path)
        return Scores(recording, estimator, metric, part, time, value, n, stderr, provenance)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise FormatError(path, "columns", f"not a table of scores: {error}") from None


def _named(names: list[str], index: np.ndarray[Any, Any]) -> Runs:
    """The names at ``index`` (m,)."""
    if index.dtype != np.int32 or index.min(initial=0) < 0:
        raise ValueError("names are not given by indices")
    return Runs.of(str(names[i]) for i in index)


_WRITERS = {"csv": to_csv, "json": to_json, "h5": _to_h5}

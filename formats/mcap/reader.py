"""Reading MCAP files, whole or scan by scan, in one pass over their records."""

from __future__ import annotations

import json
import re
import struct
from collections.abc import Container, Iterator
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import numpy as np
import zstandard
from google.protobuf.message import DecodeError
from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, Message, Metadata

from ...models.checks import check, check_stream
from ...models.columns import COLUMNS
from ...models.errors import FormatError
from ...models.records import Estimates, Recording, Scan
from .. import layout
from .. import tree as trees
from ..tree import ArrayToken, Leaf, Tree
from .records import MESSAGE, Records
from .tables import Table, tables

HEADER, TRAILER = "echoset/header.json", "echoset"
_NUMBERS = re.compile(r"[<|]?([iu][1248]|f[48]|b1)")
_WINDOW = 256

ERRORS = (
    OSError,
    McapError,
    struct.error,
    zstandard.ZstdError,
    DecodeError,
    ValueError,
    LookupError,
    TypeError,
    AttributeError,
    ArithmeticError,
    RuntimeError,
    AssertionError,
    MemoryError,
)


class Section:
    """One record being read: what its messages brought so far, and the tokens of it."""

    def __init__(self, header: dict[str, Any], keep: bool, scans: bool = True) -> None:
        self._keep = keep, keep and scans
        self.estimator = str(header["estimator"])
        self.small: dict[str, Leaf] = {p: _from_json(v) for p, v in header["leaves"].items()}
        types = {
            str(p): (_dtype(t).str.lstrip("<|"), tuple(shape))
            for p, (t, shape) in header["columns"].items()
        }
        tree = {**trees.unflatten(self.small), "estimator": self.estimator}
        self.tables = {table.topic: table for table in tables(tree, types)}
        self.empty = {p: np.zeros((0, *shape), dtype) for p, (dtype, shape) in types.items()}
        self._parts: dict[str, list[Any]] = {p: [] for p in types}
        self._tokens: dict[str, ArrayToken] = {p: ArrayToken() for p in types}
        self._rows: dict[str, int] = {}
        for path, empty in self.empty.items():
            first = np.zeros(1, np.int64) if path.endswith("/row_offset") else empty
            self._tokens[path].update(first)
            self._parts[path].append(first)

    def _take(self, path: str, part: Any) -> None:
        self._tokens[path].update(part)
        if self._keep[path.startswith("streams/")]:
            self._parts[path].append(part)

    def feed(self, table: Table, message: Message) -> tuple[dict[str, Any], dict[str, Any]]:
        """Take in a message; returns its scan values and rows."""
        scan, rows, n = table.decode(message.data)
        for name, value in scan.items():
            dtype = self.empty[table.scan[name]].dtype
            self._take(table.scan[name], np.asarray(value, dtype)[np.newaxis])
        for name, values in rows.items():
            self._take(table.rows[name], values)
        if table.primary:
            self._take(f"{table.group}/time_ns", np.array([message.log_time], np.int64))
        if table.primary and table.ragged:
            total = self._rows.get(table.group, 0) + n
            self._rows[table.group] = total
            self._take(f"{table.group}/row_offset", np.array([total], np.int64))
        return scan, rows

    def tokens(self) -> dict[str, str]:
        """Tokens of everything but the provenance."""
        return {**trees.tokens(self.small), **{p: str(t) for p, t in self._tokens.items()}}

    def leaves(self) -> dict[str, Leaf]:
        """All leaves but the provenance, of the messages since the last call."""
        arrays = {p: np.concatenate(parts) for p, parts in self._parts.items()}
        for path, values in arrays.items():
            first = path.endswith("/row_offset")
            self._parts[path] = [values[-1:] if first else self.empty[path]]
            if first:
                arrays[path] = values - values[0]
        return {**self.small, **arrays}

    def setup(self, path: object) -> Recording:
        """The recording as its estimators may know it, without scans."""
        leaves: dict[str, Leaf] = {**self.small, **self.empty}
        for name in leaves:
            if name.endswith("/row_offset"):
                leaves[name] = np.zeros(1, np.int64)
        seen = {p: leaves[p] for p in trees.observed(leaves)}
        tree = {**trees.unflatten(seen), "kind": "recording", "provenance": "{}"}
        record = layout.from_tree(tree, path)
        assert isinstance(record, Recording)
        return record


def _from_json(value: Any) -> Leaf:
    if isinstance(value, dict):
        return np.array(value["data"], _dtype(value["dtype"])).reshape(value["shape"])
    return tuple(value) if isinstance(value, list) else value


class Pass:
    """One pass over a file: yields (section, table, message), then verifies the whole.

    ``keep`` numbers the sections whose content is kept.
    """

    def __init__(
        self, source: IO[bytes], path: object, keep: Container[int], scans: bool = True
    ) -> None:
        self.path, self._keep, self._scans = path, keep, scans
        self.sections: list[Section] = []
        self.trailer: dict[str, str] = {}
        self.records = Records(source)
        self._channels: dict[int, str] = {}

    def messages(self) -> Iterator[tuple[Section, Table, Message]]:
        """The messages that carry content.

        Raises
        ------
        FormatError : damage, wherever it shows; at the end at the latest
        """
        records, where = self.records, ""
        try:
            for record in records:
                if isinstance(record, Message):
                    where = self._channels[record.channel_id]
                    for section in self.sections:
                        if where in section.tables:
                            yield section, section.tables[where], record
                            break
                    where = ""
                else:
                    self._note(record)
            where = TRAILER
            self._verify()
        except ERRORS as error:
            place = where or f"byte {records.offset}"
            raise FormatError(self.path, place, reason(error)) from error

    def _note(self, record: Channel | Attachment | Metadata) -> None:
        if isinstance(record, Channel):
            self._channels[record.id] = record.topic
        elif isinstance(record, Attachment) and record.name == HEADER:
            if len(self.sections) == 2:
                raise ValueError("more than two records in one file")
            keep = len(self.sections) in self._keep
            self.sections.append(Section(value(record.data), keep, self._scans))
        elif isinstance(record, Metadata) and record.name == TRAILER:
            self.trailer = record.metadata

    def _verify(self) -> None:
        if not self.sections or not self.trailer:
            raise ValueError("not a file of echoset")
        if int(self.trailer["format_version"]) != layout.FORMAT_VERSION:
            raise ValueError(f"format version {self.trailer['format_version']} is not known here")
        provenance = value(self.trailer["provenance"])
        tokens = {
            **self.sections[0].tokens(),
            **{p.lstrip("/"): trees.token(v) for p, v in _provenance_paths(provenance).items()},
        }
        for section in self.sections[1:]:
            tokens |= {f"recording/{p}": t for p, t in section.tokens().items()}
        stored = value(self.trailer["tokens"])
        for path in sorted(stored.keys() | tokens.keys()):
            if stored.get(path) != tokens.get(path):
                raise ValueError(f"{path} does not fit its digest")
        if trees.digest(tokens) != self.trailer["content_digest"]:
            raise ValueError("content digest does not fit the content")
        if self.trailer["observed_digest"] != trees.observed_digest(tokens):
            raise ValueError("the digest of what is observed does not fit the content")

    def record(self) -> Recording | Estimates:
        """The record, once all messages have passed."""
        provenance = value(self.trailer["provenance"])
        tree: Tree = trees.unflatten(self.sections[0].leaves())
        tree["provenance"] = provenance[""]
        for section in self.sections[1:]:
            carried = trees.unflatten(section.leaves())
            tree["recording"] = {**carried, "provenance": provenance["recording"]}
        return layout.from_tree(tree, self.path)


def _provenance_paths(provenance: dict[str, str]) -> dict[str, str]:
    return {f"{section}/provenance": text for section, text in provenance.items()}


def value(text: str | bytes) -> Any:
    """The value of a JSON text that is not too long to be decoded."""
    if len(text) > MESSAGE:
        raise ValueError(f"a text of {len(text)} characters")
    return json.loads(text)


def _dtype(text: object) -> np.dtype[Any]:
    """A type of numbers."""
    if not isinstance(text, str) or not _NUMBERS.fullmatch(text):
        raise ValueError(f"{str(text)[:40]!r} is not a type of numbers")
    return np.dtype(text)


def reason(error: BaseException) -> str:
    """What a library says of damage, on one line."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if not isinstance(error, ValueError) else text


def opened(source: Path | IO[bytes], path: object) -> IO[bytes]:
    """The open file; FormatError if it cannot be opened."""
    try:
        return source.open("rb") if isinstance(source, Path) else source
    except OSError as error:
        raise FormatError(path, "", error.strerror or str(error)) from error


def read(source: Path | IO[bytes], path: object) -> Recording | Estimates:
    """Read and verify a whole record.

    Raises
    ------
    FormatError : the file is damaged, or holds something else
    """
    file = opened(source, path)
    try:
        whole = Pass(file, path, keep=(0, 1))
        for section, table, message in whole.messages():
            decode(section, table, message, path)
        record = whole.record()
    finally:
        if isinstance(source, Path):
            file.close()
    check(record, path)
    return record


def decode(section: Section, table: Table, message: Message, path: object) -> Any:
    """Scan values and rows of a message, taken in by its section.

    Raises
    ------
    FormatError : it is damaged
    """
    try:
        return section.feed(table, message)
    except ERRORS as error:
        where = f"{table.topic} at {message.log_time} ns"
        raise FormatError(path, where, reason(error)) from error


def summary(source: Path | IO[bytes], path: object) -> dict[str, Any]:
    """Digests, attributes and the shapes of all columns; reads the file without keeping it."""
    file = opened(source, path)
    try:
        whole = Pass(file, path, keep=())
        for section, table, message in whole.messages():
            decode(section, table, message, path)
    finally:
        if isinstance(source, Path):
            file.close()
    shapes = {
        p: tuple(map(int, filter(None, t[t.index("[") + 1 : t.index("]")].split(","))))
        for p, t in value(whole.trailer["tokens"]).items()
        if "[" in t.split(":")[0]
    }
    small = {p: v for p, v in whole.sections[0].small.items() if not isinstance(v, np.ndarray)}
    provenance = value(whole.trailer["provenance"])[""]
    digests = {k: whole.trailer[k] for k in ("format_version", "content_digest", "observed_digest")}
    return {**digests, **small, "provenance": provenance, "shapes": shapes}


class Source:
    """A recording that is read scan by scan."""

    unit = "B"

    def __init__(self, source: Path | IO[bytes], path: object, keep: bool = False) -> None:
        self._file, self._owned = opened(source, path), isinstance(source, Path)
        self._kept = keep
        self._pass = Pass(self._file, path, (0, 1) if keep else ())
        self._messages = self._pass.messages()
        try:
            self._first = next(self._messages, None)
            if not self._pass.sections or self._pass.sections[0].small["kind"] != "recording":
                raise FormatError(path, "", "holds no recording")
            self.setup = self._pass.sections[0].setup(path)
            check(self.setup, path)
        except BaseException:
            self.close()
            raise

    @property
    def observed_digest(self) -> str:
        """Digest of what estimators may see, known once all scans are out."""
        return self._pass.trailer["observed_digest"]

    @property
    def progress(self) -> tuple[int, int]:
        """Bytes that were read, and that there are; 0 where nobody knows."""
        return self._pass.records.progress

    def scans(self) -> Iterator[Scan]:
        """All scans in the order of the file, which is that of time."""
        window: list[Scan] = []
        pending: dict[str, dict[str, Any]] = {}
        previous: dict[str, int] = {}
        while self._first is not None:
            section, table, message = self._first
            scan, rows = decode(section, table, message, self._pass.path)
            if table.group.startswith("streams/"):
                pending.setdefault(table.group, {}).update(scan)
                if table.primary:
                    seen = {c: v for c, v in rows.items() if not COLUMNS[c].evaluation}
                    name = table.group.removeprefix("streams/")
                    values = pending.pop(table.group)
                    window.append(Scan(name, message.log_time, values, seen))
            if len(window) == _WINDOW:
                yield from self._checked(window, previous)
                window = []
            self._first = next(self._messages, None)
        yield from self._checked(window, previous)

    def _checked(self, window: list[Scan], previous: dict[str, int]) -> list[Scan]:
        """The scans of ``window`` after their check, stream by stream."""
        for name, empty in self.setup.streams.items():
            scans = [s for s in window if s.stream == name]
            if not scans:
                continue
            bare = next((s.time_ns for s in scans if s.scan.keys() != empty.scan.keys()), None)
            if bare is not None:
                where = f"streams/{name} at {bare} ns"
                raise FormatError(
                    self._pass.path, where, "the values of the scan do not fit its stream"
                )
            columns = [*empty.rows]
            counts = [len(s.rows[columns[0]]) if columns else 0 for s in scans]
            stream = replace(
                empty,
                time_ns=np.array([s.time_ns for s in scans], np.int64),
                row_offset=np.concatenate(([0], np.cumsum(counts))),
                scan={c: np.stack([s.scan[c] for s in scans]) for c in empty.scan},
                rows={c: np.concatenate([s.rows[c] for s in scans]) for c in columns},
            )
            check_stream(stream, self.setup.sensors, name, self._pass.path, previous.get(name))
            previous[name] = scans[-1].time_ns
        return window

    def recording(self) -> Recording | None:
        """The whole recording, truth included, where it was asked to be kept."""
        if not self._kept:
            return None
        record = self._pass.record()
        assert isinstance(record, Recording)
        check(record, self._pass.path)
        return record

    def close(self) -> None:
        """Close the file."""
        if self._owned:
            self._file.close()

"""Reading MCAP files in one pass over their records, what is read verified at its end."""

from __future__ import annotations

import re
from collections.abc import Container, Iterable, Iterator
from typing import IO, Any

import numpy as np
from mcap.records import Attachment, Channel, Message, Metadata

from .. import leaves
from ..damage import damage
from ..leaves import ArrayDigest, Leaf
from .container import FOREIGN, HEADER, TRAILER, Records, value
from .header import version
from .tables import Table, tables

_NUMBERS = re.compile(r"[<|]?([iu][1248]|f[48]|b1)")
Item = tuple["Section", Table, Message]


class Section:
    """One record being read: what its messages brought so far, and the digests of it."""

    def __init__(self, header: dict[str, Any], keep: bool) -> None:
        self._keep = keep
        self.estimator = str(header["estimator"])
        self.small: dict[str, Leaf] = {p: _from_json(v) for p, v in header["leaves"].items()}
        types = {
            str(p): (_dtype(t).str.lstrip("<|"), tuple(shape))
            for p, (t, shape) in header["columns"].items()
        }
        found = tables(self.small, types, self.estimator)
        self.tables = {t.topic: t for t in found}
        self.groups = {t.group: tuple(b for b in found if b.group == t.group) for t in found}
        self._empty = {p: np.zeros((0, *shape), dtype) for p, (dtype, shape) in types.items()}
        self._parts: dict[str, list[Any]] = {p: [] for p in types}
        self._digests: dict[str, ArrayDigest] = {p: ArrayDigest() for p in types}
        self._rows: dict[str, int] = {}
        for path, empty in self._empty.items():
            first = np.zeros(1, np.int64) if path.endswith("/row_offset") else empty
            self._digests[path].update(first)
            self._parts[path].append(first)

    def _take(self, path: str, part: Any) -> None:
        self._digests[path].update(part)
        if self._keep:
            self._parts[path].append(part)

    def feed(self, messages: Iterable[tuple[Table, Message]]) -> None:
        """Take in messages, all or none of them."""
        for table, message, (scan, rows, n) in [(t, m, t.decode(m.data)) for t, m in messages]:
            for name, single in scan.items():
                dtype = self._empty[table.scan[name]].dtype
                self._take(table.scan[name], np.asarray(single, dtype)[np.newaxis])
            for name, values in rows.items():
                self._take(table.rows[name], values)
            if table.primary:
                self._take(f"{table.group}/time_ns", np.array([message.log_time], np.int64))
            if table.primary and table.ragged:
                total = self._rows.get(table.group, 0) + n
                self._rows[table.group] = total
                self._take(f"{table.group}/row_offset", np.array([total], np.int64))

    def digests(self) -> dict[str, str]:
        """Digests of everything but the provenance."""
        return {**leaves.digests(self.small), **{p: str(d) for p, d in self._digests.items()}}

    def leaves(self) -> dict[str, Leaf]:
        """All leaves but the provenance, of the messages since the last call."""
        arrays = {p: np.concatenate(parts) for p, parts in self._parts.items()}
        for path, values in arrays.items():
            first = path.endswith("/row_offset")
            self._parts[path] = [values[-1:] if first else self._empty[path]]
            if first:
                arrays[path] = values - values[0]
        return {**self.small, **arrays}


def _from_json(value: Any) -> Leaf:
    if isinstance(value, dict):
        return np.array(value["data"], _dtype(value["dtype"])).reshape(value["shape"])
    return tuple(value) if isinstance(value, list) else value


def _dtype(text: object) -> np.dtype[Any]:
    """A type of numbers."""
    if not isinstance(text, str) or not _NUMBERS.fullmatch(text):
        raise ValueError(f"{str(text)[:40]!r} is not a type of numbers")
    return np.dtype(text)


class Pass:
    """One pass over a file, whose messages are taken in by the sections that they belong to.

    ``keep`` numbers the sections whose content is kept.
    """

    def __init__(self, source: IO[bytes], path: object, keep: Container[int]) -> None:
        self.path, self._keep = path, keep
        self.sections: list[Section] = []
        self.trailer: dict[str, str] = {}
        self.records = Records(source)
        self._channels: dict[int, str] = {}

    def messages(self) -> Iterator[Item]:
        """The messages that carry content; each is to be taken in before the next is asked for.

        Raises
        ------
        FormatError : damage, wherever it shows; at the end at the latest
        """
        records, where = self.records, ""
        with damage(self.path, lambda: where or f"byte {records.offset}"):
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

    def _note(self, record: Channel | Attachment | Metadata) -> None:
        if isinstance(record, Channel):
            self._channels[record.id] = record.topic
        elif isinstance(record, Attachment) and record.name == HEADER:
            if len(self.sections) == 2:
                raise ValueError("more than two records in one file")
            keep = len(self.sections) in self._keep
            self.sections.append(Section(value(record.data), keep))
        elif isinstance(record, Metadata) and record.name == TRAILER:
            self.trailer = record.metadata

    @property
    def provenance(self) -> dict[str, str]:
        """The provenance of each record, once the end was read."""
        found: dict[str, str] = value(self.trailer["provenance"])
        return found

    def digests(self) -> dict[str, str]:
        """The digests of all leaves that were taken in, and of the provenance."""
        tops = {"": "", "recording": "recording/"}
        texts = {f"{tops[name]}provenance": text for name, text in self.provenance.items()}
        digests = leaves.digests(texts)
        for top, section in zip(tops.values(), self.sections, strict=False):
            digests |= {f"{top}{p}": text for p, text in section.digests().items()}
        return digests

    def _verify(self) -> None:
        if not self.sections or not self.trailer:
            raise ValueError(FOREIGN)
        version(self.trailer)
        digests, stored = self.digests(), value(self.trailer["tokens"])
        for path in sorted(stored.keys() | digests.keys()):
            if stored.get(path) != digests.get(path):
                raise ValueError(f"{path} does not fit its digest")
        expected = leaves.header(digests)
        if expected["content_digest"] != self.trailer["content_digest"]:
            raise ValueError("content digest does not fit the content")
        if expected["observed_digest"] != self.trailer["observed_digest"]:
            raise ValueError("the digest of what is observed does not fit the content")

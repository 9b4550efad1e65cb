"""What MCAP files may hold but ours do not: found by writing the content again and comparing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from itertools import zip_longest
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any

from mcap.records import Attachment, Channel, Message, Metadata

from ...models.records import Estimates
from . import writer as mcap
from .reader import HEADER, TRAILER, read
from .records import Records
from .windows import Windows

_Place = tuple[str, int, int, bytes]
"""Topic, time, sequence number and data of a message."""


def oddities(path: Path) -> Iterator[tuple[str, str]]:
    """Places in a sound file, and what is strange there: the first message, and checksums."""
    with path.open("rb") as file, TemporaryFile() as again:
        _write(path, again)
        again.seek(0)
        records = Records(file)
        for found, wanted in zip_longest(_messages(records), _messages(Records(again))):
            if found != wanted:
                topic, time_ns, *_ = found or wanted
                yield f"{topic} at {time_ns} ns", _difference(found, wanted)
                return
        yield from ((kind, "has no checksum") for kind in sorted(records.unchecked))


def _write(path: Path, target: IO[bytes]) -> None:
    with closing(Windows(path, path)) as parts:
        if parts.carries:
            mcap.write(read(path, path), target)
            return
        single = isinstance(parts.head, Estimates)
        writer: Any = mcap.EstimatesWriter(target) if single else mcap.RecordingWriter(target)
        for window in parts:
            writer.append(window)
        writer.close(parts.head.meta)


def _messages(records: Records) -> Iterator[_Place]:
    """The messages in order, and as such the attachments and metadata that are not ours."""
    topics: dict[int, str] = {}
    for record in records:
        if isinstance(record, Message):
            odd = "" if record.publish_time == record.log_time else " (published at another time)"
            topic = topics[record.channel_id] + odd
            yield topic, record.log_time, record.sequence, record.data
        elif isinstance(record, Channel):
            topics[record.id] = record.topic
        elif isinstance(record, Attachment | Metadata) and record.name not in (HEADER, TRAILER):
            yield f"{type(record).__name__.lower()} {record.name[:80]}", 0, 0, b""


def _difference(found: _Place | None, wanted: _Place | None) -> str:
    if found is None or wanted is None:
        return "is missing" if found is None else "is not part of the content"
    if found[:2] != wanted[:2]:
        return f"stands where {wanted[0]} at {wanted[1]} ns belongs"
    if found[2] != wanted[2]:
        return f"has sequence number {found[2]}, not {wanted[2]}"
    return "is not what the content gives"

"""What MCAP files may hold but ours do not: found by writing the content again and comparing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any

from mcap.records import Attachment, Channel, Message, Metadata

from ..windows import concatenate
from .container import HEADER, TRAILER, Records
from .windows import Windows
from .writer import Writer

_Found = tuple[str, int, int, bytes]
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
    with closing(Windows(path, path)) as own:
        writer, beside = Writer(target), None
        for window in own:
            writer.append(window)
        if own.has_recording:
            with closing(Windows(path, path, recording=True)) as parts:
                whole: Any = concatenate(list(parts))
                beside = replace(whole, meta=parts.meta)
        writer.close(own.meta, beside)


def _messages(records: Records) -> Iterator[_Found]:
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


def _difference(found: _Found | None, wanted: _Found | None) -> str:
    if found is None or wanted is None:
        return "is missing" if found is None else "is not part of the content"
    if found[:2] != wanted[:2]:
        return f"stands where {wanted[0]} at {wanted[1]} ns belongs"
    if found[2] != wanted[2]:
        return f"has sequence number {found[2]}, not {wanted[2]}"
    return "is not what the content gives"

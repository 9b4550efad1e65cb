"""The records and the end of MCAP files, read within bounds that a file cannot set itself.

The library parses the records; but it trusts the lengths that stand inside them, and decompresses
chunks without a limit.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable, Iterator
from io import BytesIO
from typing import IO, Any

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    DataEnd,
    Footer,
    Message,
    Metadata,
    MetadataIndex,
)

RECORD = 1 << 26
"""Bytes that one record or chunk may have, compressed or not."""
MESSAGE = 1 << 24
"""Bytes that one message may have: decoded it takes many times as much."""
_ALLOWANCE, _RATIO = 1 << 26, 64
"""Bytes that chunks may hold in all, and how many more for each that they take in the file."""
_MAX_NAMES = 1 << 17
"""Channels and schemas: all that have numbers, twice."""

HEADER, TRAILER = "echoset/header.json", "echoset"
"""Names of the attachment that begins a record, and of the metadata that end a file."""

FOREIGN = "not a file of echoset (logs of others are read by convert --from)"

Part = Channel | Message | Attachment | Metadata
MAGIC = b"\x89MCAP0\r\n"

_HEAD = struct.Struct("<BQ")
_FOOTER = struct.Struct("<BQQQI")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_READ: dict[int, Callable[[ReadDataStream], Any]] = {
    Opcode.ATTACHMENT: Attachment.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.CHUNK: Chunk.read,
    Opcode.DATA_END: DataEnd.read,
    Opcode.FOOTER: Footer.read,
    Opcode.METADATA: Metadata.read,
}
"""The records that are of use here; all others are passed over."""


class Records:
    """The records of the file ``source`` in order; ``offset`` is where the one at hand begins.

    ``unchecked`` names the kinds of records that came without a checksum.
    """

    def __init__(self, source: IO[bytes]) -> None:
        self.offset = 0
        self.unchecked: set[str] = set()
        self._source, self._size = source, 0
        if source.seekable():
            start = source.tell()
            self._size = source.seek(0, 2) - start
            source.seek(start)
        self._position = self._crc = 0
        self._packed = self._plain = self._names = 0

    def __iter__(self) -> Iterator[Part]:
        """Channels, messages, attachments and metadata, those in chunks among them.

        Raises
        ------
        ValueError, struct.error, McapError, ZstdError, RuntimeError : damage, at ``offset``
        """
        if self._read(len(MAGIC)) != MAGIC:
            raise ValueError("does not begin as MCAP does")
        while True:
            self.offset, before = self._position, self._crc
            op, size = _HEAD.unpack(self._read(_HEAD.size))
            if size > RECORD:
                raise ValueError(f"a record of {size} bytes")
            content = self._read(size)
            if op == Opcode.MESSAGE:
                yield _message(content)
            elif op in _READ:
                record = _READ[op](ReadDataStream(BytesIO(content)))
                if isinstance(record, Chunk):
                    yield from self._chunk(record)
                elif isinstance(record, DataEnd):
                    self._check("data", record.data_section_crc, before)
                    self._crc = 0
                elif isinstance(record, Footer):
                    self._check("summary", record.summary_crc, self._summary(content, before))
                    break
                else:
                    if isinstance(record, Attachment):
                        stored = int.from_bytes(content[-4:], "little")
                        self._check("attachment", stored, zlib.crc32(content[:-4]))
                    yield record
        self.offset = self._position
        if self._read(len(MAGIC)) != MAGIC:
            raise ValueError("does not end as MCAP does")
        self.offset = self._position
        if self._source.read(1):
            raise ValueError("data after the end")

    @property
    def progress(self) -> tuple[int, int]:
        """Bytes that were read, and that there are; 0 where the source does not tell."""
        return self._position, self._size

    def _read(self, size: int) -> bytes:
        data = self._source.read(size) if size else b""
        if len(data) < size:
            raise ValueError("ends in the middle of a record")
        self._position += size
        self._crc = zlib.crc32(data, self._crc)
        return data

    @staticmethod
    def _summary(footer: bytes, before: int) -> int:
        """Checksum of the summary and of the footer as far as it is covered itself."""
        return zlib.crc32(_HEAD.pack(Opcode.FOOTER, len(footer)) + footer[:16], before)

    def _check(self, kind: str, stored: int, found: int) -> None:
        if stored == 0:
            self.unchecked.add(kind)
        elif stored != found:
            raise ValueError(f"the checksum of the {kind} does not fit")

    def _chunk(self, chunk: Chunk) -> Iterator[Channel | Message]:
        """The channels and messages of a chunk in order, its size and checksum proved."""
        size = chunk.uncompressed_size
        self._packed += len(chunk.data)
        self._plain += size
        if size > RECORD or self._plain > _ALLOWANCE + _RATIO * self._packed:
            raise ValueError(f"a chunk of {len(chunk.data)} bytes declares {size}")
        data = _unpacked(chunk)
        if len(data) != size:
            raise ValueError("a chunk does not hold what it declares")
        self._check("chunk", chunk.uncompressed_crc, zlib.crc32(data))
        at = 0
        while at < size:
            op, length = _HEAD.unpack_from(data, at)
            at += _HEAD.size
            if length > size - at:
                raise ValueError("a record reaches beyond its chunk")
            if op == Opcode.MESSAGE:
                yield _message(data[at : at + length])
            elif op in (Opcode.CHANNEL, Opcode.SCHEMA) and self._names < _MAX_NAMES:
                self._names += 1
                if op == Opcode.CHANNEL:
                    yield Channel.read(ReadDataStream(BytesIO(data[at : at + length])))
            else:
                raise ValueError(f"a chunk holds a record of kind {op}, or very many channels")
            at += length


def ending(source: IO[bytes]) -> tuple[bytes, dict[str, str]]:
    """Header of the first record, as JSON, and trailer of a file that can seek, by its summary.

    A file without one, or whose summary does not name them, is searched for them.

    Raises
    ------
    ValueError, struct.error, McapError, OSError : it is not complete, or not one of ours
    """
    begin = source.tell()
    end = source.seek(0, 2) - len(MAGIC) - _FOOTER.size
    closing = _bytes(source, begin, end, _FOOTER.size + len(MAGIC))
    op, size, start, _, crc = _FOOTER.unpack(closing[: _FOOTER.size])
    if (op, size) != (Opcode.FOOTER, 20) or closing[_FOOTER.size :] != MAGIC:
        raise ValueError("does not end as MCAP does")
    summary = _bytes(source, begin, begin + start, end - begin - start) if start else b""
    if crc and zlib.crc32(summary + closing[: _FOOTER.size - 4]) != crc:
        raise ValueError("the checksum of the summary does not fit")
    found: dict[str, Any] = {}
    for kind, content in _records(summary):
        if kind in (Opcode.ATTACHMENT_INDEX, Opcode.METADATA_INDEX):
            index_of: Any = AttachmentIndex if kind == Opcode.ATTACHMENT_INDEX else MetadataIndex
            index = index_of.read(ReadDataStream(BytesIO(content)))
            if index.name in (HEADER, TRAILER) and index.name not in found:
                data = _bytes(source, begin, begin + index.offset, index.length)
                record: Any = Attachment if index.name == HEADER else Metadata
                found[index.name] = record.read(ReadDataStream(BytesIO(data[_HEAD.size :])))
    if len(found) < 2:
        source.seek(begin)
        for part in Records(source):
            if isinstance(part, Attachment | Metadata) and part.name in (HEADER, TRAILER):
                found.setdefault(part.name, part)
    if len(found) < 2:
        raise ValueError(FOREIGN)
    return found[HEADER].data, found[TRAILER].metadata


def _records(data: bytes) -> Iterator[tuple[int, bytes]]:
    start = 0
    while start < len(data):
        kind, size = _HEAD.unpack_from(data, start)
        start += _HEAD.size
        yield kind, data[start : start + size]
        start += size


def _bytes(source: IO[bytes], begin: int, start: int, size: int) -> bytes:
    """A part of a file that begins at ``begin``."""
    if start < begin or not 0 <= size <= RECORD:
        raise ValueError(f"a part of {size} bytes at byte {start}")
    source.seek(start)
    data = source.read(size)
    if len(data) < size:
        raise ValueError("ends in the middle of a record")
    return data


def value(text: str | bytes) -> Any:
    """The value of a JSON text that is not too long to be decoded."""
    if len(text) > MESSAGE:
        raise ValueError(f"a text of {len(text)} characters")
    return json.loads(text)


def _message(content: bytes) -> Message:
    if len(content) > MESSAGE:
        raise ValueError(f"a message of {len(content)} bytes")
    channel, sequence, log_time, publish_time = _MESSAGE_HEAD.unpack_from(content)
    return Message(channel, log_time, content[_MESSAGE_HEAD.size :], publish_time, sequence)


def _unpacked(chunk: Chunk) -> bytes:
    """The content of a chunk, of hardly more memory than it declares."""
    size = chunk.uncompressed_size
    if chunk.compression == "zstd":
        inside = zstandard.get_frame_parameters(chunk.data).content_size
        if inside not in (zstandard.CONTENTSIZE_UNKNOWN, size):
            raise ValueError(f"a chunk declares {size} bytes, but its frame {inside}")
        return zstandard.ZstdDecompressor().decompress(chunk.data, max_output_size=max(1, size))
    if chunk.compression == "lz4":
        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1))
    if chunk.compression:
        raise ValueError(f"compression {chunk.compression[:20]!r} is not known here")
    return chunk.data

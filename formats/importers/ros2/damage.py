"""Damage in bags: found before anything is taken from them, or what is whole before it.

MCAP has checksums of chunks, and perhaps of all data and of the summary; :func:`verify` proves
them, and says whether there are any. sqlite3 has none. :func:`rescued` takes the messages as they
stand in the file, which needs no index, until the first that is damaged.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import IO, Any

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    Chunk,
    DataEnd,
    Header,
    Message,
    MessageIndex,
    Metadata,
    Schema,
)
from mcap.stream_reader import StreamReader, breakup_chunk, get_chunk_data_stream

_HEAD = struct.Struct("<BQ")
_READ: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.CHUNK: Chunk,
    Opcode.MESSAGE_INDEX: MessageIndex,
    Opcode.METADATA: Metadata,
}
_LARGEST = 1 << 31
"""Bytes that a record may have."""
_ZSTD = b"\x28\xb5\x2f\xfd"
"""How compressed messages begin, and plain ones never do."""
_END = 8 + 20 + 9
"""Bytes of the footer and what ends a file."""


@dataclass(frozen=True, slots=True)
class Kind:
    """The topic of a message, its type, and the type's definition, empty where it is not there."""

    topic: str
    type: str
    definition: str


def files(bag: Path) -> list[Path]:
    """The files of a bag in their order."""
    if not bag.is_dir():
        return [bag]
    found = [p for p in bag.iterdir() if {".mcap", ".db3"} & set(p.suffixes)]
    return sorted(found, key=lambda p: (len(p.name), p.name))


def verify(path: Path) -> bool:
    """Whether the data of a file have checksums, which are then right.

    Raises
    ------
    Exception : they are not, or the file is cut
    """
    if ".mcap" not in path.suffixes:
        return False
    checked = True
    with _opened(path) as file:
        reader = StreamReader(
            file, emit_chunks=True, validate_crcs=True, record_size_limit=_LARGEST
        )
        for record in reader.records:
            if isinstance(record, Chunk):
                checked &= record.uncompressed_crc != 0
                _, size = get_chunk_data_stream(record, validate_crc=True)
                if size != record.uncompressed_size:
                    raise ValueError("a chunk does not hold what it declares")
            elif isinstance(record, DataEnd):
                checked |= record.data_section_crc != 0
    if path.suffix == ".mcap":
        _summary(path)
    return checked


@contextmanager
def _opened(path: Path) -> Iterator[IO[bytes]]:
    """A file, unpacked if it is compressed as a whole."""
    with path.open("rb") as file:
        if path.suffix in (".zstd", ".zst"):
            with zstandard.ZstdDecompressor().stream_reader(file) as plain:
                yield plain
        else:
            yield file


def _summary(path: Path) -> None:
    """Prove the checksum of the summary, where there is one."""
    with path.open("rb") as file:
        end = file.seek(0, 2) - _END
        file.seek(end)
        tail = file.read(29)
        start = int.from_bytes(tail[9:17], "little")
        stored = int.from_bytes(tail[25:29], "little")
        if stored:
            file.seek(start or end)
            data = file.read(end - (start or end))
            if zlib.crc32(data + tail[:25]) != stored:
                raise ValueError("the checksum of the summary does not fit")


def rescued(path: Path) -> Iterator[tuple[Kind, int, bytes]]:
    """Kind, log time [ns] and content of the messages of a file, in the order in which they stand.

    Raises
    ------
    Exception : the damage
    """
    found = _from_mcap(path) if ".mcap" in path.suffixes else _from_sqlite(path)
    for kind, time, data in found:
        yield kind, time, _unpacked(data)


def _unpacked(data: bytes) -> bytes:
    """A message, which may be compressed by itself."""
    if not data.startswith(_ZSTD):
        return data
    return zstandard.ZstdDecompressor().decompressobj().decompress(data)


def _from_mcap(path: Path) -> Iterator[tuple[Kind, int, bytes]]:
    """Record by record: what is none, or not as long as it says, is damage."""
    schemas: dict[int, Schema] = {}
    kinds: dict[int, Kind] = {}
    with _opened(path) as file:
        if file.read(8) != b"\x89MCAP0\r\n":
            raise ValueError("it does not begin as MCAP does")
        while True:
            head = file.read(9)
            op, size = _HEAD.unpack(head)
            if size > _LARGEST:
                raise ValueError(f"a record of {size} bytes")
            content = file.read(size)
            if len(content) < size:
                raise ValueError("it ends in the middle of a record")
            if op in (Opcode.DATA_END, Opcode.FOOTER):
                return
            for record in _within(op, content):
                if isinstance(record, Schema):
                    schemas[record.id] = record
                elif isinstance(record, Channel):
                    schema = schemas[record.schema_id]
                    text = schema.data.decode() if schema.encoding == "ros2msg" else ""
                    kinds[record.id] = Kind(record.topic, schema.name, text)
                elif isinstance(record, Message):
                    yield kinds[record.channel_id], record.log_time, record.data


def _within(op: int, content: bytes) -> list[Any]:
    """What matters of a record: of a chunk all that is in it, its checksum proved."""
    stream = ReadDataStream(BytesIO(content))
    if op == Opcode.MESSAGE:
        return [Message.read(stream, len(content))]
    if op == Opcode.ATTACHMENT:
        stored = int.from_bytes(content[-4:], "little")
        if stored and zlib.crc32(content[:-4]) != stored:
            raise ValueError("the checksum of an attachment does not fit")
        return []
    found = _READ[op].read(stream)
    if stream.count != len(content):
        raise ValueError("a record is not as long as it says")
    if not isinstance(found, Chunk):
        return [found]
    _, size = get_chunk_data_stream(found, validate_crc=True)
    if size != found.uncompressed_size:
        raise ValueError("a chunk does not hold what it declares")
    return list(breakup_chunk(found))


def _from_sqlite(path: Path) -> Iterator[tuple[Kind, int, bytes]]:
    """By the rows of the table, without its index."""
    import apsw

    class Strict(apsw.VFSFile):
        """A file whose missing end is an error, and not zeros."""

        def xRead(self, amount: int, offset: int) -> bytes:
            data: bytes = super().xRead(amount, offset)
            if len(data) < amount:
                raise EOFError(f"it ends at byte {offset + len(data)}")
            return data

    class Files(apsw.VFS):
        def __init__(self) -> None:
            super().__init__("echoset-strict", "")

        def xOpen(self, name: Any, flags: list[int]) -> apsw.VFSFile:
            return Strict("", name, flags)

    files = Files()
    try:
        where = f"{path.absolute().as_uri()}?immutable=1"
        how = apsw.SQLITE_OPEN_READONLY | apsw.SQLITE_OPEN_URI
        with closing(apsw.Connection(where, how, "echoset-strict")) as database:
            # Without this a file that is shorter than it says is refused whole.
            database.execute("PRAGMA writable_schema=ON")
            yield from _rows(database)
    finally:
        files.unregister()


def _rows(database: Any) -> Iterator[tuple[Kind, int, bytes]]:
    texts: dict[str, str] = {}
    if any(True for _ in database.execute("PRAGMA table_info(message_definitions)")):
        query = "SELECT topic_type, encoded_message_definition FROM message_definitions"
        texts = dict(database.execute(f"{query} WHERE encoding = 'ros2msg'"))
    topics = database.execute("SELECT id, name, type FROM topics")
    kinds = {i: Kind(name, kind, texts.get(kind, "")) for i, name, kind in topics}
    query = "SELECT topic_id, timestamp, data FROM messages ORDER BY id"
    for topic, time, data in database.execute(query):
        yield kinds[topic], int(time), bytes(data)

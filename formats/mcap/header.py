"""What an MCAP file says of itself at its end, read without its messages."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import IO, Any

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, AttachmentIndex, Footer, Metadata, MetadataIndex

from ...models.errors import FormatError
from .. import layout
from .reader import HEADER, TRAILER

_MAGIC = b"\x89MCAP0\r\n"
_HEAD = struct.Struct("<BQ")
_FOOTER = _HEAD.size + 20
_LIMIT = 1 << 26
"""Bytes that the summary or the trailer may have."""
_INDICES: dict[int, Any] = {
    Opcode.ATTACHMENT_INDEX: (AttachmentIndex, HEADER, Attachment, lambda a: json.loads(a.data)),
    Opcode.METADATA_INDEX: (MetadataIndex, TRAILER, Metadata, lambda m: m.metadata),
}
"""How to read each kind of index, the name to look for, and the value of what it points to."""
_ERRORS = (
    OSError, McapError, struct.error, ArithmeticError, AttributeError, ValueError, LookupError,
    TypeError, RecursionError,
)  # fmt: skip


def header(source: Path, path: object) -> dict[str, Any]:
    """Kind, digests, name and provenance of a file that is complete.

    Raises
    ------
    FormatError : it was cut, or its end is damaged or not one of ours
    """
    try:
        with source.open("rb") as file:
            parts = _parts(file)
        header, trailer = parts[Opcode.ATTACHMENT_INDEX], parts[Opcode.METADATA_INDEX]
        if trailer["format_version"] != str(layout.FORMAT_VERSION):
            raise ValueError(f"format version {trailer['format_version']} is not known here")
        provenance = json.loads(trailer["provenance"])[""]
        own = {name: header["leaves"][name] for name in ("kind", "name")}
        return {**trailer, **own, "provenance": provenance}
    except _ERRORS as error:
        text = " ".join(str(error).split()) or type(error).__name__
        raise FormatError(path, "end of file", text) from error


def _parts(file: IO[bytes]) -> dict[int, Any]:
    """Header and trailer of the first record in the file, by the kind of their indices."""
    end = file.seek(0, 2) - len(_MAGIC)
    if end < _FOOTER or _bytes(file, end, len(_MAGIC)) != _MAGIC:
        raise ValueError("does not end as MCAP does")
    closing = _bytes(file, end - _FOOTER, _FOOTER)
    footer = Footer.read(_stream(closing[_HEAD.size :]))
    summary = _bytes(file, footer.summary_start, end - _FOOTER - footer.summary_start)
    if footer.summary_crc and zlib.crc32(summary + closing[:-4]) != footer.summary_crc:
        raise ValueError("the checksum of the summary does not fit")
    found: dict[int, Any] = {}
    for kind, content in _records(summary):
        if kind in _INDICES and kind not in found:
            of, name, record, value = _INDICES[kind]
            index = of.read(_stream(content))
            if index.name == name:
                data = _bytes(file, index.offset, index.length)
                found[kind] = value(record.read(_stream(data[_HEAD.size :])))
    if len(found) < len(_INDICES):
        raise ValueError("not a file of echoset")
    return found


def _records(data: bytes) -> Iterator[tuple[int, bytes]]:
    start = 0
    while start < len(data):
        kind, size = _HEAD.unpack_from(data, start)
        start += _HEAD.size
        yield kind, data[start : start + size]
        start += size


def _bytes(file: IO[bytes], start: int, size: int) -> bytes:
    if not 0 <= size <= _LIMIT:
        raise ValueError(f"a part of {size} bytes at byte {start}")
    file.seek(start)
    data = file.read(size)
    if len(data) < size:
        raise ValueError("ends in the middle of a record")
    return data


def _stream(data: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(data))

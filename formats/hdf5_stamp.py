"""What an HDF5 file says of itself at its root, read without its datasets."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py

from ..models.errors import FormatError
from . import layout
from . import tree as trees

_ERRORS = (OSError, LookupError, RuntimeError, ValueError, TypeError, RecursionError)
_LIMIT = 1 << 26
"""Bytes that the tokens or the provenance may have."""
_OWN = ("kind", "name", "provenance")


def stamp(source: Path, path: object) -> dict[str, Any]:
    """Kind, digests, name and provenance of a file that is complete; scores have no name.

    Raises
    ------
    FormatError : it was cut, or its root is damaged or not one of ours
    """
    try:
        with source.open("rb") as plain:
            head = plain.read(48)
        end = int.from_bytes(head[40:48], "little")
        if len(head) == 48 and head[8] == 0 and end < source.stat().st_size:
            raise ValueError(f"data after the end at byte {end}")
        with h5py.File(source, "r") as file:
            header = {key: _plain(value) for key, value in file.attrs.items()}
            tokens = json.loads(_text(file, "tokens"))
            header["provenance"] = _text(file, "provenance")
    except _ERRORS as error:
        text = " ".join(str(error).split()) or type(error).__name__
        raise FormatError(path, "", text) from error
    if header.get("format_version") != str(layout.FORMAT_VERSION):
        raise FormatError(path, "format_version", f"{header.get('format_version')} is not known")
    if trees.digest(tokens) != header.get("content_digest"):
        raise FormatError(path, "content_digest", "does not fit the content")
    for name in _OWN:
        if tokens.get(name) != (trees.token(header[name]) if name in header else None):
            raise FormatError(path, name, "does not fit its digest")
    return header


def _plain(value: Any) -> str:
    return value.decode() if isinstance(value, bytes) else str(value)


def _text(file: h5py.File, name: str) -> str:
    data = file.get(name) if isinstance(file.get(name, getlink=True), h5py.HardLink) else None
    if not isinstance(data, h5py.Dataset) or data.shape != () or data.dtype.kind != "S":
        raise ValueError(f"{name} is missing")
    if data.nbytes > _LIMIT:
        raise ValueError(f"{name} declares {data.nbytes} bytes")
    return str(data[()].decode())

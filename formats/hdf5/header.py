"""What an HDF5 file says of itself at its root, read without its datasets."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py

from ...models.errors import FormatError
from .. import layout
from .. import tree as trees
from .reader import ERRORS, HEADER, attribute, checked_size, expect_header, one_line

_LIMIT = 1 << 26
"""Bytes that the tokens or the provenance may have."""
_OWN = ("kind", "name", "provenance")


def header(source: Path, path: object) -> dict[str, Any]:
    """Kind, digests, name and provenance of a file that is complete; scores have no name.

    Raises
    ------
    FormatError : it was cut, or its root is damaged or not one of ours
    """
    place = "superblock"
    try:
        checked_size(source, path)
        with h5py.File(source, "r") as file:
            place = "/"
            expect_header(file.attrs, path)
            wanted = (name for name in (*HEADER, *_OWN) if name in file.attrs)
            found = {name: attribute(file, name) for name in wanted}
            tokens = json.loads(_text(file, "tokens"))
            found["provenance"] = _text(file, "provenance")
        expected = {
            "format_version": layout.FORMAT_VERSION,
            "content_digest": trees.digest(tokens),
            "observed_digest": trees.observed_digest(tokens),
        }
        own = {name: trees.token(found[name]) for name in _OWN if name in found}
    except (*ERRORS, AttributeError, RecursionError) as error:
        raise FormatError(path, place, one_line(error)) from error
    for name, value in expected.items():
        if found.get(name) != value:
            raise FormatError(path, name, f"is {str(found.get(name))[:80]}, not {value}")
    for name in _OWN:
        if own.get(name) != tokens.get(name):
            raise FormatError(path, name, "does not fit its digest")
    return found


def _text(file: h5py.File, name: str) -> str:
    data = file.get(name) if isinstance(file.get(name, getlink=True), h5py.HardLink) else None
    if not isinstance(data, h5py.Dataset) or data.shape != () or data.dtype.kind != "S":
        raise ValueError(f"{name} is missing")
    if data.nbytes > _LIMIT:
        raise ValueError(f"{name} declares {data.nbytes} bytes")
    return str(data[()].decode())

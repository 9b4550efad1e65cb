"""What an HDF5 file says of itself at its root, read without its datasets."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import h5py

from ...models.errors import FormatError
from .. import leaves
from ..damage import damage
from .reader import HEADER, attribute, checked_size, foreign, verify_header

_LIMIT = 1 << 26
"""Bytes that the digests or the provenance may have."""
_OWN = ("kind", "name", "provenance")


def header(source: Path, path: object) -> dict[str, Any]:
    """Kind, digests, name and provenance of a file that is complete; scores have no name.

    Raises
    ------
    FormatError : it was cut, or its root is damaged or not one of ours
    """
    place = "superblock"
    with damage(path, lambda: place):
        checked_size(source, path)
        with h5py.File(source, "r") as file:
            place = "/"
            wanted = (name for name in (*HEADER, *_OWN) if name in file.attrs)
            found = {name: attribute(file, name) for name in wanted}
            absent = [name for name in HEADER if name not in found]
            if absent:
                raise FormatError(path, place, foreign(absent[0], path))
            digests = json.loads(_text(file, "tokens"))
            found |= {name: _text(file, name) for name in _OWN if name in file}
        expected = leaves.header(digests)
        own = {name: leaves.digest_of(found[name]) for name in _OWN if name in found}
        stated = {name: digests.get(name) for name in _OWN}
        if "kind" not in own:
            raise ValueError("kind is missing")
    for name, value in expected.items():
        verify_header(path, name, found.get(name), value)
    for name in _OWN:
        if own.get(name) != stated[name]:
            raise FormatError(path, name, "does not fit its digest")
    return found


def _text(file: h5py.File, name: str) -> str:
    data = file.get(name) if isinstance(file.get(name, getlink=True), h5py.HardLink) else None
    if not isinstance(data, h5py.Dataset) or data.shape != () or data.dtype.kind != "S":
        raise ValueError(f"{name} is missing")
    if data.nbytes > _LIMIT:
        raise ValueError(f"{name} declares {data.nbytes} bytes")
    return str(data[()].decode())

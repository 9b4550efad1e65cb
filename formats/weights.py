"""Weights of the classifier as a NumPy archive (.npz) of float32 arrays, and how they were made.

How they were made is a member ``made.json`` of the archive; it may be absent. The shapes stand in
:data:`echoset.models.classifier.SHAPES`. They are compared with what the archive says before
memory is taken; nothing is unpickled.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
import struct
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any
from zlib import error as ZlibError

import numpy as np
from numpy.lib import format as npy

from ..models.classifier import SHAPES, Weights
from ..models.errors import FormatError
from ..models.records import Array
from .atomic import atomic
from .plain_json import parse

OPTIONAL = ("mean", "std")
MADE = "made.json"
_MOST_WORDS = 1 << 16
_DAMAGE = (
    EOFError,
    LookupError,
    NotImplementedError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
    ZlibError,
    struct.error,
)
_LARGEST = 1 << 24
_HEADER = re.compile(
    rb"\{'descr': '([<>|=]?[a-zA-Z]\d{0,3})', 'fortran_order': (True|False), "
    rb"'shape': \(((?:\d{1,18}(?:, ?)?)*)\),? *\}\s*"
)
"""The header that NumPy writes, read without its evaluation of Python."""


def read(path: Path) -> Weights:
    """The weights in the archive at ``path``.

    Raises
    ------
    FormatError : the file is missing, damaged or of another kind; an array that is missing, of
        another shape or type, or not finite
    """
    try:
        data = path.read_bytes() if path.stat().st_size <= _LARGEST else b""
    except OSError as error:
        raise FormatError(path, "", f"no weights: {error.strerror or error}") from error
    if not data:
        raise FormatError(path, "size", f"no weights: not between 1 and {_LARGEST} bytes")
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            inside = {name.removesuffix(".npy") for name in archive.namelist()}
            names = [name for name in SHAPES if name in inside or name not in OPTIONAL]
            arrays = {name: _array(archive, path, name) for name in names}
            made = _made(archive, path)
    except (zipfile.BadZipFile, *_DAMAGE) as error:
        reason = "no weights: is not a sound NumPy archive (.npz)"
        raise FormatError(path, "central directory", reason) from error
    if arrays.get("std", np.ones(())) <= 0:
        raise FormatError(path, "std", f"{arrays['std'].item()!r} is not positive")
    return replace(Weights.of(arrays), made=made)


def sha256(path: Path) -> str:
    """SHA-256 of the file at ``path``, in hexadecimal digits.

    Raises
    ------
    FormatError : it cannot be read, or is too large for weights
    """
    try:
        if path.stat().st_size > _LARGEST:
            raise FormatError(path, "size", f"no weights: more than {_LARGEST} bytes")
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise FormatError(path, "", f"no weights: {error.strerror or error}") from error


def write(path: Path, weights: Weights, overwrite: bool = False) -> None:
    """Write the archive, byte for byte the same for the same weights.

    Raises
    ------
    OutputError : ``path`` exists (and ``overwrite`` is false), or cannot be written
    """
    arrays: dict[str, Any] = weights.arrays()
    with atomic(path, overwrite) as temporary, temporary.open("w+b") as file:
        np.savez(file, **arrays)
        if weights.made:
            with zipfile.ZipFile(file, "a") as archive:
                text = json.dumps(weights.made, sort_keys=True, indent=1)
                archive.writestr(zipfile.ZipInfo(MADE), text)


def _made(archive: zipfile.ZipFile, path: Path) -> dict[str, Any]:
    """How the weights were made, as they say themselves."""
    if MADE not in archive.namelist():
        return {}
    with archive.open(MADE) as file:
        data = file.read(_MOST_WORDS + 1)
    if len(data) > _MOST_WORDS:
        raise FormatError(path, MADE, f"is longer than {_MOST_WORDS} bytes")
    try:
        made = parse(data.decode("utf-8"), path)
    except UnicodeDecodeError as error:
        raise FormatError(path, MADE, "is not UTF-8 text") from error
    if not isinstance(made, dict):
        raise FormatError(path, MADE, "is not an object of JSON")
    return made


def _array(archive: zipfile.ZipFile, path: Path, name: str) -> Array:
    """One array, its shape and type those that it must have."""
    wanted = SHAPES[name]
    try:
        with archive.open(f"{name}.npy") as file:
            if npy.read_magic(file) != (1, 0):
                raise FormatError(path, name, "is not of version 1.0 of the NumPy format")
            header = _HEADER.fullmatch(file.read(int.from_bytes(file.read(2), "little")))
            if header is None:
                raise FormatError(path, name, "has no header of the NumPy format")
            dtype, fortran = np.dtype(header[1].decode()), header[2] == b"True"
            shape = tuple(int(n) for n in header[3].split(b",") if n.strip())
            if dtype != np.dtype("<f4"):
                raise FormatError(path, name, f"has type {dtype}, needs float32")
            if shape != wanted or fortran:
                order = " in the order of Fortran" if fortran else ""
                raise FormatError(path, name, f"has shape {shape}{order}, needs {wanted}")
            data = file.read(int(np.prod(wanted)) * dtype.itemsize)
            if file.read(1):
                raise FormatError(path, name, "is longer than its shape")
        a = np.frombuffer(data, dtype).reshape(wanted).copy()
    except KeyError as error:
        raise FormatError(path, name, "is missing") from error
    except (zipfile.BadZipFile, *_DAMAGE) as error:
        raise FormatError(path, name, "is damaged") from error
    if not np.isfinite(a).all():
        raise FormatError(path, name, "is not finite")
    return a

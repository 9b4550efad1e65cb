"""Weights of the classifier as a NumPy archive (.npz) of float32 arrays.

The shapes stand in :data:`echoset.models.classifier.SHAPES`. They are compared with what the
archive says before memory is taken; nothing is unpickled.
"""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import Any
from zlib import error as ZlibError

import numpy as np
from numpy.lib import format as npy

from ..models.classifier import SHAPES, Weights
from ..models.errors import FormatError
from ..models.records import Array
from .atomic import atomic

OPTIONAL = ("mean", "std")
_DAMAGE = (EOFError, KeyError, NotImplementedError, RuntimeError, ValueError, ZlibError)


def read(path: Path) -> Weights:
    """The weights in the archive at ``path``.

    Raises
    ------
    FormatError : the file is missing, damaged or of another kind; an array that is missing, of
        another shape or type, or not finite
    """
    try:
        with zipfile.ZipFile(path) as archive:
            inside = {name.removesuffix(".npy") for name in archive.namelist()}
            names = [name for name in SHAPES if name in inside or name not in OPTIONAL]
            arrays = {name: _array(archive, path, name) for name in names}
    except OSError as error:
        raise FormatError(path, "", f"no weights: {error.strerror or error}") from error
    except zipfile.BadZipFile as error:
        raise FormatError(path, "", "no weights: is not a sound NumPy archive (.npz)") from error
    if arrays.get("std", np.ones(())) <= 0:
        raise FormatError(path, "std", f"{arrays['std'].item()!r} is not positive")
    return Weights.of(arrays)


def write(path: Path, weights: Weights, overwrite: bool = False) -> None:
    """Write the archive, byte for byte the same for the same weights.

    Raises
    ------
    OutputError : ``path`` exists (and ``overwrite`` is false), or cannot be written
    """
    arrays: dict[str, Any] = weights.arrays()
    with atomic(path, overwrite) as temporary, temporary.open("wb") as file:
        np.savez(file, **arrays)


def _array(archive: zipfile.ZipFile, path: Path, name: str) -> Array:
    """One array, its shape and type those that it must have."""
    wanted = SHAPES[name]
    try:
        with archive.open(f"{name}.npy") as file:
            if npy.read_magic(file) != (1, 0):
                raise FormatError(path, name, "is not of version 1.0 of the NumPy format")
            shape, fortran, dtype = npy.read_array_header_1_0(file)
            if dtype != np.dtype("<f4"):
                raise FormatError(path, name, f"has type {dtype}, needs float32")
            if shape != wanted or fortran:
                order = " in the order of Fortran" if fortran else ""
                raise FormatError(path, name, f"has shape {shape}{order}, needs {wanted}")
            data = file.read(int(np.prod(wanted)) * dtype.itemsize)
        a = np.frombuffer(data, dtype).reshape(wanted).copy()
    except KeyError as error:
        raise FormatError(path, name, "is missing") from error
    except _DAMAGE as error:
        raise FormatError(path, name, "is damaged") from error
    if not np.isfinite(a).all():
        raise FormatError(path, name, "is not finite")
    return a

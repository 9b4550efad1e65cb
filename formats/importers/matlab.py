"""Arrays of MATLAB as the text of a table, so that they are read as logs are."""

from __future__ import annotations

import hashlib
from io import BytesIO
from pathlib import Path

import numpy as np

from ...models.errors import FormatError
from .text import TextFile

_LARGEST = 1 << 28
"""Bytes of a file, and numbers of its array."""


def read_mat(path: Path) -> TextFile:
    """The only matrix in the file at ``path``, a line a row, its numbers apart by commas.

    Raises
    ------
    FormatError : the file cannot be read, or does not hold one matrix of real numbers
    """
    from scipy.io import loadmat, whosmat

    try:
        data = path.read_bytes()
        if len(data) > _LARGEST:
            raise ValueError(f"has {len(data)} bytes, no more than {_LARGEST} are read")
        shapes = {name: shape for name, shape, _ in whosmat(BytesIO(data), appendmat=False)}
        tables = [name for name, shape in shapes.items() if len(shape) == 2 and min(shape) > 0]
        if len(tables) != 1:
            raise ValueError(f"holds {', '.join(shapes) or 'nothing'}: it must be one table")
        if np.prod(shapes[tables[0]], dtype=float) > _LARGEST:
            raise ValueError(f"{tables[0]} is too large")
        matrix = loadmat(BytesIO(data), appendmat=False, variable_names=tables)[tables[0]]
        if matrix.dtype.kind not in "biuf":
            raise ValueError(f"{tables[0]} does not hold real numbers")
    except OSError as error:
        raise FormatError(path, "", error.strerror or str(error)) from error
    except Exception as error:
        reason = " ".join(str(error).split())[:200]
        raise FormatError(path, "variables", f"no table of MATLAB: {reason}") from error
    lines = (",".join(map(repr, row)) for row in matrix.tolist())
    return TextFile(path, "\n".join(lines), hashlib.sha256(data).hexdigest())

"""Recordings and estimates as NumPy archives: for notebooks, where one array at a time is enough.

``numpy.load("rec.npz")["streams/uwb/rows/distance"]`` is a column. The arrays that all formats hold
are members by path; the member ``header`` is JSON of its other leaves and digests.
"""

from __future__ import annotations

import io
import json
import zipfile
from pathlib import Path
from typing import IO

import numpy as np

from echoset.formats import leaves
from echoset.models.checks import check
from echoset.models.errors import FormatError
from echoset.models.records import Estimates, Recording

SUMMARY = "NumPy archives (.npz), for notebooks"
SUFFIXES = (".npz",)
MAGIC = b"PK\x03\x04"

_DAMAGE = (OSError, KeyError, ValueError, TypeError, zipfile.BadZipFile, EOFError)


def write(record: Recording | Estimates, target: Path | IO[bytes]) -> None:
    """Write ``record`` whole."""
    found = leaves.of(record)
    arrays = {path: leaf for path, leaf in found.items() if isinstance(leaf, np.ndarray)}
    header = {
        **leaves.header(leaves.digests(found)),
        "leaves": {path: leaf for path, leaf in found.items() if path not in arrays},
    }
    text = json.dumps(header, sort_keys=True, allow_nan=False).encode()
    data = io.BytesIO()
    np.savez_compressed(data, header=np.frombuffer(text, np.uint8), **arrays)
    if isinstance(target, Path):
        target.write_bytes(data.getvalue())
    else:
        target.write(data.getvalue())


def read(source: Path | IO[bytes], path: object) -> Recording | Estimates:
    """Read and verify a whole record.

    Raises
    ------
    FormatError : it is damaged or of another kind
    """
    try:
        data = source.read_bytes() if isinstance(source, Path) else source.read()
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            header = json.loads(archive["header"].tobytes())
            found = {name: archive[name] for name in archive.files if name != "header"}
        small = header.pop("leaves").items()
        found |= {name: tuple(v) if isinstance(v, list) else v for name, v in small}
        whole = header == leaves.header(leaves.digests(found))
    except _DAMAGE as error:
        raise FormatError(path, "header", " ".join(str(error).split()) or "is damaged") from error
    if not whole:
        raise FormatError(path, "content_digest", "does not fit the content")
    record = leaves.record(found, path)
    check(record, path)
    return record

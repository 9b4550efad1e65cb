"""Recordings and estimates as NumPy archives: for notebooks, where one array at a time is enough.

``numpy.load("rec.npz")["streams/uwb/rows/distance"]`` is a column. The arrays of the tree that all
formats hold are members by path; the member ``header`` is JSON of its other leaves and digests.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np

from echoset.formats import layout, steps, tree
from echoset.models.checks import check
from echoset.models.errors import FormatError
from echoset.models.records import Estimates, Meta, Recording, Scan

SUMMARY = "NumPy archives (.npz), for notebooks"
SUFFIXES = (".npz",)
MAGIC = b"PK\x03\x04"

_DAMAGE = (OSError, KeyError, ValueError, TypeError, zipfile.BadZipFile, EOFError)


def write(record: Recording | Estimates, target: Path | IO[bytes]) -> None:
    """Write ``record`` whole."""
    leaves = tree.flatten(layout.to_tree(record))
    arrays = {path: leaf for path, leaf in leaves.items() if isinstance(leaf, np.ndarray)}
    header = {
        "format_version": layout.FORMAT_VERSION,
        "content_digest": tree.digest(tree.tokens(leaves)),
        "observed_digest": layout.observed_digest(record) if isinstance(record, Recording) else "",
        "leaves": {path: leaf for path, leaf in leaves.items() if path not in arrays},
    }
    text = json.dumps(header, sort_keys=True, allow_nan=False).encode()
    data = io.BytesIO()
    np.savez_compressed(data, header=np.frombuffer(text, np.uint8), **arrays)
    if isinstance(target, Path):
        target.write_bytes(data.getvalue())
    else:
        target.write(data.getvalue())


def _load(source: Path | IO[bytes], path: object) -> tuple[dict[str, Any], dict[str, Any]]:
    """The header and the leaves of a file, verified.

    Raises
    ------
    FormatError : it is damaged or of another kind
    """
    try:
        data = source.read_bytes() if isinstance(source, Path) else source.read()
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            header = json.loads(archive["header"].tobytes())
            leaves = {name: archive[name] for name in archive.files if name != "header"}
        small = header.pop("leaves").items()
        leaves |= {name: tuple(v) if isinstance(v, list) else v for name, v in small}
        whole = tree.digest(tree.tokens(leaves)) == header["content_digest"]
    except _DAMAGE as error:
        raise FormatError(path, "", " ".join(str(error).split()) or "is damaged") from error
    if not whole:
        raise FormatError(path, "content_digest", "does not fit the content")
    return header, leaves


def read(source: Path | IO[bytes], path: object) -> Recording | Estimates:
    """Read and verify a whole record; FormatError where it is damaged or of another kind."""
    _, leaves = _load(source, path)
    record = layout.from_tree(tree.unflatten(leaves), path)
    check(record, path)
    return record


def summary(source: Path | IO[bytes], path: object) -> dict[str, Any]:
    """Digests, small leaves, and the shapes of all arrays."""
    header, leaves = _load(source, path)
    shapes = {name: v.shape for name, v in leaves.items() if isinstance(v, np.ndarray)}
    small = {name: v for name, v in leaves.items() if name not in shapes}
    return {**header, **small, "shapes": shapes}


class Source:
    """A recording for estimators, scan by scan; an archive has to be read whole for it."""

    unit = "scan"

    def __init__(self, source: Path | IO[bytes], path: object, keep: bool = False) -> None:
        record = read(source, path)
        if not isinstance(record, Recording):
            raise FormatError(path, "", "holds no recording")
        self._record, self._keep, self._done = record, keep, 0
        self.setup = record.setup()
        self.observed_digest = layout.observed_digest(record)

    @property
    def progress(self) -> tuple[int, int]:
        """Scans that are out, and that there are."""
        return self._done, sum(len(s) for s in self._record.streams.values())

    def scans(self) -> Iterator[Scan]:
        """All scans in order."""
        for scan in self._record.scans():
            yield scan
            self._done += 1

    def recording(self) -> Recording | None:
        """The whole recording, where it was asked to be kept."""
        return self._record if self._keep else None

    def close(self) -> None:
        """Nothing is left open."""


class EstimatesWriter:
    """Gathers estimates step by step and writes them at the end."""

    def __init__(self, target: Path | IO[bytes]) -> None:
        self._target = target
        self._parts: list[Estimates] = []

    def append(self, estimates: Estimates) -> None:
        """Take the next steps."""
        self._parts.append(estimates)

    def close(self, meta: Meta, recording: Recording | None = None) -> None:
        """Write the file with its ``meta`` and the recording that travels along, if any."""
        whole = steps.concatenate(self._parts)
        write(Estimates(meta, whole.objects, whole.steps, recording), self._target)

    def abort(self) -> None:
        """Nothing was written yet."""

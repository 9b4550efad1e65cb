"""Columns of measurements whose chunks are packed here, as HDF5's own filters unpack them.

The lower bytes of measurements are noise, in which deflate seeks repetitions at great cost and
finds none; what it gains are the runs of equal bytes that the shuffle filter makes of the upper
ones. A compressor that only looks for runs makes files of nearly the same size in a third of the
time. Any HDF5 library reads them: shuffle, deflate and fletcher32 say how.
"""

from __future__ import annotations

import zlib
from typing import Any

import h5py
import numpy as np

Array = np.ndarray[Any, Any]


class PackedColumn:
    """Appends to a dataset of one axis that has the filters shuffle, gzip and fletcher32."""

    def __init__(self, data: h5py.Dataset) -> None:
        self._data, self._rows = data, int(data.chunks[0])
        self._pending: list[Array] = []
        self._count = self._written = 0

    def add(self, part: Array) -> None:
        """Take the next rows, and write the chunks that are full."""
        self._pending.append(np.array(part, self._data.dtype))
        self._count += len(part)
        if self._count >= self._rows:
            whole = np.concatenate(self._pending)
            full = len(whole) - len(whole) % self._rows
            self._data.resize(self._written + full, axis=0)
            for start in range(0, full, self._rows):
                self._chunk(whole[start : start + self._rows])
            self._pending, self._count = [whole[full:].copy()], len(whole) - full

    def close(self) -> None:
        """Write the rest, the end of its chunk filled with zeros."""
        if self._count:
            self._data.resize(self._written + self._count, axis=0)
            last = np.zeros(self._rows, self._data.dtype)
            last[: self._count] = np.concatenate(self._pending)
            self._chunk(last)

    def _chunk(self, values: Array) -> None:
        self._data.id.write_direct_chunk((self._written,), packed(values))
        self._written += self._rows


def packed(values: Array) -> bytes:
    """The bytes of a chunk: shuffled, compressed, and their checksum behind."""
    size = values.itemsize
    shuffled = np.ascontiguousarray(values.view(np.uint8).reshape(-1, size).T)
    packer = zlib.compressobj(4, zlib.DEFLATED, zlib.MAX_WBITS, 9, zlib.Z_RLE)
    data = packer.compress(shuffled.data) + packer.flush()
    return data + fletcher32(data).to_bytes(4, "little")


def fletcher32(data: bytes) -> int:
    """The checksum of HDF5's filter: sums of big-endian words, and of these sums, modulo 65535.

    A sum that is a multiple of it, and not zero, is 65535, since carries are folded in.
    """
    words = np.frombuffer(data + b"\0" * (len(data) % 2), ">u2").astype(np.uint64)
    once = int(words.sum())
    twice = int(np.arange(len(words), 0, -1, dtype=np.uint64) @ words)
    first, second = (total % 65535 or (65535 if total else 0) for total in (once, twice))
    return second << 16 | first

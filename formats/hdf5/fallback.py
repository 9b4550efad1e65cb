"""A file for HDF5, which crashes the process where the system refuses a write."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer, WriteableBuffer


class SpilledFile(io.RawIOBase):
    """A new file at ``path`` whose writes never fail: after an error it goes on in memory.

    The error is raised by :meth:`check`, to be called between the calls of HDF5, and by
    :meth:`close`. The other methods are those of a binary file.
    """

    def __init__(self, path: Path) -> None:
        # First what close() needs: it is called even of a file that cannot be opened.
        self._file: io.FileIO | io.BytesIO = io.BytesIO()
        self._error: OSError | None = None
        self._file = path.open("w+b", buffering=0)

    def write(self, data: ReadableBuffer) -> int:
        """Write all of ``data``."""
        rest = memoryview(data).cast("B")
        size = len(rest)
        while rest:
            try:
                rest = rest[self._file.write(rest) :]
            except OSError as error:
                self._move_to_memory(error)
        return size

    def truncate(self, size: int | None = None) -> int:
        """Set the length of the file."""
        try:
            return self._file.truncate(size)
        except OSError as error:
            self._move_to_memory(error)
            return self._file.truncate(size)

    def _move_to_memory(self, error: OSError) -> None:
        position = self._file.tell()
        self._file.seek(0)
        memory = io.BytesIO(self._file.read())
        memory.seek(position)
        self._file.close()
        self._file, self._error = memory, error

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        """Go to a position."""
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        """The position."""
        return self._file.tell()

    def readinto(self, buffer: WriteableBuffer) -> int | None:
        """Read into ``buffer``."""
        return self._file.readinto(buffer)

    def check(self) -> None:
        """Raise the first error of the system, if there was one."""
        if self._error is not None:
            raise self._error

    def close(self) -> None:
        """Close the file.

        Raises
        ------
        OSError : a write had failed
        """
        self._file.close()
        if not self.closed:
            super().close()
            self.check()

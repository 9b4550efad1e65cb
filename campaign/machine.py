"""Limits of the machine: a budget of memory, and faults told as what they are."""

from __future__ import annotations

import errno
import os
import re
import resource
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from ..models.errors import EchosetError, InputError, OutputError, ParameterError, UnavailableError

SHARE = 0.8
"""Part of the machine's memory that commands may take by default."""
_BYTES = re.compile(r"(\d+(?:\.\d+)?) ?([kMGT]?)i?B?")
_UNITS = {"": 1, "k": 1 << 10, "M": 1 << 20, "G": 1 << 30, "T": 1 << 40}
_GROUP = Path("/sys/fs/cgroup/memory.max")
_SOFT, _HARD = resource.getrlimit(resource.RLIMIT_DATA)
_TOO_LARGE = ("array is too big", "Maximum allowed ", "array size exceeds")
_FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EIO}
_SHORT = {errno.EMFILE, errno.ENFILE, errno.ENOMEM, errno.EAGAIN}


def parse_bytes(text: str) -> int:
    """Bytes in ``text``, such as ``4G`` or ``500 MB``.

    Raises
    ------
    ParameterError : it does not read so, or is too small for any work
    """
    found = _BYTES.fullmatch(text.strip())
    size = int(float(found[1]) * _UNITS[found[2]]) if found else 0
    if size < _UNITS["M"]:
        raise ParameterError(f"--memory must be a size such as 4G or 500M, got {text!r}")
    return size


def default_memory() -> int:
    """The share of the memory that the machine, or the group of this process, has."""
    whole = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    with suppress(OSError, ValueError):
        whole = min(whole, int(_GROUP.read_text()))
    return int(SHARE * whole)


def limit_memory(size: int) -> None:
    """Have this process fail to take more than ``size`` bytes, rather than be killed for it."""
    bounds = [bound for bound in (size, _SOFT, _HARD) if bound != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_DATA, (min(bounds), _HARD))


@contextmanager
def limited_memory(size: int) -> Iterator[None]:
    """:func:`limit_memory` within the block."""
    before = resource.getrlimit(resource.RLIMIT_DATA)
    limit_memory(size)
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, before)


def explained(error: Exception) -> EchosetError | None:
    """``error`` as a fault of the machine, or nothing if it is none."""
    if isinstance(error, MemoryError) or str(error).startswith(_TOO_LARGE):
        needs = f": {error}" if str(error) else ""
        return UnavailableError(f"needs more memory than the budget (see --memory){needs}")
    if not isinstance(error, OSError) or error.errno is None:
        return None
    name = "" if error.filename is None else f"{os.fsdecode(error.filename)}: "
    kind: type[EchosetError] = OutputError if error.errno in _FULL else InputError
    kind = UnavailableError if error.errno in _SHORT else kind
    return kind(f"{name}{os.strerror(error.errno)}")

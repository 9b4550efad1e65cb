"""Files with bytes that are changed."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from echoset.models.errors import EchosetError


def refused_in_a_line(paths: Iterable[Path], read: Callable[[], object], times: int = 30) -> None:
    """Change a byte of each file in turn, ``times``: it is read, or refused in one line."""
    rng = np.random.default_rng(4)
    for path in paths:
        whole = path.read_bytes()
        for _ in range(times):
            broken = bytearray(whole)
            broken[int(rng.integers(len(whole)))] ^= int(rng.integers(1, 256))
            path.write_bytes(broken)
            try:
                read()
            except EchosetError as error:
                assert "\n" not in str(error)
        path.write_bytes(whole)

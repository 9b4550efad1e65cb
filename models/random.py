"""Random streams keyed by what they are for, never by the order of calls."""

from __future__ import annotations

import hashlib

import numpy as np


def generator(seed: int, stage: str, recording: str, chain: int = 0) -> np.random.Generator:
    """The generator of (seed, stage, recording, chain): the same on any worker, in any order."""
    digest = hashlib.sha256(f"{stage}\0{recording}".encode()).digest()
    key = tuple(int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4))
    sequence = np.random.SeedSequence(seed, spawn_key=(*key, chain))
    return np.random.Generator(np.random.Philox(sequence))

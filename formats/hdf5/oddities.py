"""What HDF5 files may hold but ours do not."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py


def oddities(path: Path) -> Iterator[tuple[str, str]]:
    """Places in a sound file, and what is strange there."""
    items: list[tuple[str, Any]] = []
    with h5py.File(path, "r") as file:
        file.visititems(lambda name, item: items.append((name, item)))
        if file.userblock_size:
            yield "superblock", "stands behind a user block"
        for name, item in items:
            if isinstance(item, h5py.Group):
                if not len(item) and not len(item.attrs):
                    yield name, "is an empty group"
            elif item.dtype.kind == "S":
                if len(item.attrs):
                    yield name, "is a text with attributes"
            elif not item.fletcher32:
                yield name, "has no checksums"

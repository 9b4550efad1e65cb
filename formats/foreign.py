"""What a file or folder of others may be, and the command that reads it."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Any

from ..models import registry

_OURS = (".h5", ".hdf5", ".mcap")
_HEAD = 4096


def hint(source: object) -> str:
    """``: try ...``, the command to type for what is no file of ours, or where to look for one.

    An importer may have ``recognises(path, head)``, which says of a file or folder, from its first
    bytes, whether it would read it, and ``GENERAL``, by which others come first.
    """
    path = Path(str(source))
    if not (path.is_file() or path.is_dir()):
        return ""
    head = _head(path)
    found = [name for name, module in _importers() if module.recognises(path, head)]
    if not found and path.suffix in _OURS:
        return ""
    if not found:
        return ": see 'echoset list importers', or export it as a table of text"
    name = shlex.quote(str(path))
    end = "--propose" if found[0] == "csv" else f"-o {shlex.quote(path.stem)}.h5"
    return f": try echoset convert --from {found[0]} {name} {end}"


def is_bag(head: bytes) -> bool:
    """Whether an MCAP file, from its first bytes, says that it is a bag of ROS 2."""
    return head.startswith(b"\x89MCAP") and b"ros2" in head[:64]


def listing(source: object) -> dict[str, Any] | None:
    """What a file of others holds, from the importer that knows it and has ``listing(path)``."""
    path = Path(str(source))
    known = [(n, m) for n, m in _importers() if hasattr(m, "listing")]
    if not known or not (path.is_file() or path.is_dir()):
        return None
    head = _head(path)
    for _, module in known:
        if module.recognises(path, head):
            found: dict[str, Any] = module.listing(path)
            return found
    return None


def _head(path: Path) -> bytes:
    """The first bytes of a file; nothing of a folder, or of what cannot be read."""
    try:
        if not path.is_dir():
            with path.open("rb") as file:
                return file.read(_HEAD)
    except OSError:
        pass
    return b""


def _importers() -> list[tuple[str, Any]]:
    """The importers that recognise files, the general ones last."""
    known = []
    for name in registry.names("echoset.importers"):
        try:
            module = registry.load("echoset.importers", name)
        except Exception:  # a plugin of others that does not load has nothing to say here
            continue
        if hasattr(module, "recognises"):
            known.append((name, module))
    return sorted(known, key=lambda pair: getattr(pair[1], "GENERAL", False))

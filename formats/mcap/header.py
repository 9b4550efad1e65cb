"""What an MCAP file says of itself at its end, read without its messages."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from .. import leaves
from ..damage import damage
from .container import ending, value


def header(source: Path, path: object) -> dict[str, Any]:
    """Kind, digests, name and provenance of a file that is complete.

    Raises
    ------
    FormatError : it was cut, or its end is damaged or not one of ours
    """
    with damage(path, "end of file"):
        with source.open("rb") as file:
            first, trailer = ending(file)
        version(trailer)
        provenance = json.loads(trailer["provenance"])[""]
        found = value(first)["leaves"]
        own = {name: found[name] for name in ("kind", "name")}
        return {**trailer, **own, "provenance": provenance}


def version(trailer: dict[str, str]) -> None:
    """Refuse a file of another version."""
    if trailer["format_version"] != str(leaves.FORMAT_VERSION):
        raise ValueError(f"format version {trailer['format_version']} is not known here")

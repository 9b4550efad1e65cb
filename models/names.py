"""Names: the scenario in that of a recording, and any as it is shown."""

from __future__ import annotations

import re

_RUN = re.compile(r"-s\d+-\d+$")


def scenario(recording: str) -> str:
    """The name of a recording without ``-s<seed>-<run>``, or of a pool without ``-*``."""
    return _RUN.sub("", recording).removesuffix("-*")


def printable(text: str) -> str:
    """``text`` with what would move the cursor or cannot be shown as escapes: ``\\x1b``."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else _escaped(c) for c in text)


def _escaped(character: str) -> str:
    code = ord(character)
    if 0xDC80 <= code <= 0xDCFF:
        return f"\\x{code - 0xDC00:02x}"
    return character.encode("unicode_escape").decode()

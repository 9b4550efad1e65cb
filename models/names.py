"""Names: the scenario in that of a recording, the order of them, and any as it is shown."""

from __future__ import annotations

import re

_DIGITS = re.compile(r"(\d{1,18})", re.ASCII)
_RUN = re.compile(r"-s\d+-\d+$")


def scenario(recording: str) -> str:
    """The name of a recording without ``-s<seed>-<run>``, or of a pool without ``-*``."""
    return _RUN.sub("", recording).removesuffix("-*")


def natural(name: str) -> tuple[tuple[str, int], ...]:
    """A key that sorts S2 before S10: texts by their letters, the numbers in them by value."""
    parts = _DIGITS.split(name)
    return tuple(("", int(p)) if p.isdecimal() else (p, -1) for p in parts)


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

"""Names as they are shown, whatever bytes or characters they are made of."""

from __future__ import annotations

import json
import re
from typing import Any

_ALONE = re.compile("[\ud800-\udfff]")
"""Bytes of file names that are not UTF-8."""


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


def json_text(value: Any, **how: Any) -> str:
    """``value`` as JSON that is UTF-8 text, also where names in it are not."""
    text = json.dumps(value, ensure_ascii=False, **how)
    return _ALONE.sub(lambda found: f"\\u{ord(found[0]):04x}", text)

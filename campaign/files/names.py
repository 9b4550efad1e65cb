"""Names as they are shown, whatever bytes or characters they are made of."""

from __future__ import annotations

import json
import re
from typing import Any

_ALONE = re.compile("[\ud800-\udfff]")
"""Bytes of file names that are not UTF-8."""


def json_text(value: Any, **how: Any) -> str:
    """``value`` as JSON that is UTF-8 text, also where names in it are not."""
    text = json.dumps(value, ensure_ascii=False, **how)
    return _ALONE.sub(lambda found: f"\\u{ord(found[0]):04x}", text)

"""JSON documents of others, read whole: strictly, and with their numbers exact."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from ...models.errors import FormatError
from ..plain_json import parse
from .text import TextFile, read_text


@dataclass(frozen=True, slots=True)
class Document:
    """A JSON document whose numbers are ``Decimal``, and the file that it was."""

    file: TextFile
    content: Any

    def fail(self, where: str, reason: str) -> NoReturn:
        """Raise what is wrong at a place in the document."""
        raise FormatError(self.file.path, where, reason)

    def finite(self, value: object, where: str) -> Decimal:
        """``value`` if it is a number that a float can hold."""
        if not isinstance(value, Decimal) or not np.isfinite(float(value)):
            self.fail(where, f"{shown(value)} is not a finite number")
        return value

    def vector(self, value: object, where: str, *lengths: int) -> list[float]:
        """``value`` if it is a list of numbers of one of ``lengths``, any if none are given."""
        if not isinstance(value, list) or (lengths and len(value) not in lengths):
            size = f" of {' or '.join(map(str, lengths))}" if lengths else ""
            self.fail(where, f"{shown(value)} is not a list{size} numbers")
        return [float(self.finite(v, f"{where}[{i}]")) for i, v in enumerate(value)]


def shown(value: object) -> str:
    """A value as messages speak of it."""
    if isinstance(value, list):
        return f"a list of {len(value)}"
    if isinstance(value, dict):
        return "an object"
    text = str(value) if isinstance(value, Decimal) else repr(value)
    return text if len(text) <= 40 else text[:40] + "..."


def read_json(path: Path) -> Document:
    """The document at ``path``.

    Raises
    ------
    FormatError : the file cannot be read or is no JSON
    """
    file = read_text(path, of_lines=False)
    return Document(file, parse(file.text, path, Decimal))

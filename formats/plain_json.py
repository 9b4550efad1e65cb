"""JSON of plain data: no key twice, nothing that is not finite, and errors that say where."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any, NoReturn

from ..models.errors import FormatError

_DIGITS = 300
"""Digits that an integer may have: as many as a float can be large."""
_DEPTH = 64
"""How deep an object may be nested."""


def parse(text: str, path: object, number: Callable[[str], Any] | None = None) -> Any:
    """The value of a JSON text, its numbers made by ``number`` where that is given.

    Raises
    ------
    FormatError : it is no JSON, or more than plain data
    """

    refused: list[str] = []

    def refuse(found: str) -> NoReturn:
        refused.append(found)
        raise ValueError(f"{found[:40]} is not a finite number")

    def finite(found: str) -> float:
        value = float(found)
        return refuse(found) if math.isinf(value) else value

    def integer(found: str) -> int:
        return refuse(found) if len(found) > _DIGITS else int(found)

    try:
        return json.loads(
            text,
            parse_float=number or finite,
            parse_int=number or integer,
            parse_constant=refuse,
            object_pairs_hook=_once,
        )
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise FormatError(path, place, f"not JSON: {error.msg}") from None
    except RecursionError:
        raise FormatError(path, "line 1", "not JSON that can be read: nested too deeply") from None
    except (ValueError, ArithmeticError) as error:
        line = text.count("\n", 0, text.find(refused[0]) if refused else 0) + 1
        reason = " ".join(str(error).split())[:200]
        raise FormatError(path, f"line {line}", f"not JSON that can be read: {reason}") from None


def json_object(text: str, path: object) -> dict[str, Any]:
    """The JSON object that ``text`` is, nested no deeper than can be written again.

    Raises
    ------
    FormatError : it is none, or more than plain data
    """
    found = parse(text, path)
    if not isinstance(found, dict):
        raise FormatError(path, "line 1", "not a JSON object")
    level: list[Any] = [found]
    for _ in range(_DEPTH):
        inside = [v.values() if isinstance(v, dict) else v for v in level]
        level = [v for values in inside for v in values if isinstance(v, dict | list)]
    if level:
        raise FormatError(path, "line 1", "nested too deeply")
    return found


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        twice = next(key for i, (key, _) in enumerate(pairs) if key in dict(pairs[:i]))
        raise ValueError(f"the key {twice[:40]!r} twice in one object")
    return found

"""JSON of plain data: no key twice, no NaN or infinity, and errors that say where."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Any, NoReturn

from ..models.errors import FormatError

_CONSTANT = re.compile(r"-?\b(NaN|Infinity)\b")


def parse(text: str, path: object, number: Callable[[str], Any] | None = None) -> Any:
    """The value of a JSON text, its numbers made by ``number`` where that is given.

    Raises
    ------
    FormatError : it is no JSON, or more than plain data
    """

    def refuse(constant: str) -> NoReturn:
        raise ValueError(f"{constant} is not a finite number")

    try:
        return json.loads(
            text,
            parse_float=number,
            parse_int=number,
            parse_constant=refuse,
            object_pairs_hook=_once,
        )
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise FormatError(path, place, f"not JSON: {error.msg}") from None
    except RecursionError:
        raise FormatError(path, "line 1", "not JSON that can be read: nested too deeply") from None
    except (ValueError, ArithmeticError) as error:
        found = _CONSTANT.search(text)
        line = text.count("\n", 0, found.start() if found else 0) + 1
        reason = " ".join(str(error).split())[:200]
        raise FormatError(path, f"line {line}", f"not JSON that can be read: {reason}") from None


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        twice = next(key for i, (key, _) in enumerate(pairs) if key in dict(pairs[:i]))
        raise ValueError(f"the key {twice[:40]!r} twice in one object")
    return found

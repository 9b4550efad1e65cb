"""Resume: an output is made, made again, or left, by its own header and provenance.

No timestamp counts, and only headers are read; ``echoset validate`` reads all data.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...models.errors import FormatError
from ..files.outputs import Target

RUN, REDO, SKIP = "run", "redo", "skip"


@dataclass(frozen=True, slots=True)
class Decision:
    """The action on an output, ``run``, ``redo`` or ``skip``, and its reason."""

    action: str
    reason: str


def decide(target: Target, expected: Callable[[], Mapping[str, Any]]) -> Decision:
    """The action on ``target``, whose header and provenance are compared with ``expected``.

    Raises
    ------
    OutputError : it exists and is not to be replaced
    """
    from ...formats.atomic import refuse_existing

    path = target.path
    if path is None or not os.path.exists(path):
        return Decision(RUN, "goes to stdout" if path is None else "is missing")
    reason = "is overwritten"
    if target.resume and os.path.isfile(path):
        reason = _reason(path, {"format": target.format}, expected)
        if not reason:
            return Decision(SKIP, "is complete")
    refuse_existing(path, target.overwrite)
    return Decision(REDO, reason)


def _reason(path: Path, form: Mapping[str, Any], expected: Callable[[], Mapping[str, Any]]) -> str:
    """Why the output at ``path`` cannot stay; nothing if it can."""
    from ...formats import header

    try:
        found = header(path)
    except FormatError as error:
        return ": ".join(part for part in (error.where, error.reason) if part)
    return _difference("", found, {**form, **expected()})


def _difference(prefix: str, found: Any, expected: Any) -> str:
    """The first place where ``found`` is not as ``expected``, with both values; or nothing."""
    if isinstance(expected, Mapping) and isinstance(found, Mapping):
        for key, value in expected.items():
            where = f"{prefix}.{key}" if prefix else str(key)
            told = _difference(where, found.get(key), value)
            if told:
                return told
        return ""
    if found == expected:
        return ""
    return f"{prefix} was {_short(found)}, is {_short(expected)}"


def _short(value: Any) -> str:
    text = str(value)
    return text if len(text) <= 20 else f"{text[:12]}..."

"""Whether an output has to be made, made again, or is there already.

That is told by what the output itself says: that it is complete, and its provenance. No clock is
asked, and no data but headers are read; ``echoset validate`` reads all of them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...models.errors import FormatError
from ..outputs import Target

RUN, REDO, SKIP = "run", "redo", "skip"


@dataclass(frozen=True, slots=True)
class Decision:
    """What is done about an output: ``run``, ``redo`` or ``skip``; and why."""

    action: str
    reason: str


def decide(target: Target, expected: Callable[[], Mapping[str, Any]]) -> Decision:
    """What to do about ``target``, whose header and provenance should say what is ``expected``.

    Raises
    ------
    OutputError : it exists and is not to be replaced
    """
    from ...formats.atomic import refuse_existing

    path = target.path
    if path is None or not path.exists():
        return Decision(RUN, "goes to stdout" if path is None else "is missing")
    reason = "is overwritten"
    if target.resume and path.is_file():
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

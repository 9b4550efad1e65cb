"""Rules for make: which files each output was made from, as compilers write them by ``-MD``."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

from ...models.errors import ParameterError
from ..files.outputs import Target

Rule = tuple[Target | None, Iterable[str | None]]
"""An output, and the files that it was made from."""

_NEVER = re.compile(r"[;\t\n\r]")
_SPECIAL = re.compile(r"(\\*)([ #:*?[])")


def check(deps: str | None, targets: Iterable[Target | None], inputs: Iterable[str | None]) -> None:
    """Refuse what no rule can say, before the work begins.

    Raises
    ------
    ParameterError : an output goes to stdout, or a name has characters that make cannot take
    """
    if deps is None:
        return
    for target in targets:
        if target is None or target.path is None:
            raise ParameterError("--deps needs outputs in files: stdout has no rule")
        _escaped(str(target.path))
    for name in filter(None, inputs):
        _escaped(name)


def write(deps: str, rules: Iterable[Rule]) -> None:
    """Write ``rules`` to the file ``deps``, which is replaced.

    Raises
    ------
    OutputError : it cannot be written
    """
    lines = [
        f"{_escaped(str(target.path)).replace('%', chr(92) + '%')}: "
        + " ".join(_escaped(name).replace("|", "\\|") for name in names if name is not None)
        for target, names in rules
        if target is not None
    ]
    Target(Path(deps), "text", overwrite=True).write_text("".join(f"{line}\n" for line in lines))


def _escaped(name: str) -> str:
    """``name`` as GNU make reads it."""
    if _NEVER.search(name):
        raise ParameterError(f"--deps: make takes no name like {name!r}")
    name = _SPECIAL.sub(r"\1\1\\\2", name).replace("$", "$$").replace("=", "$(or =)")
    name = re.sub(r"(\\+)$", r"\1\1", name)
    return f"./{name}" if name.startswith("~") else name

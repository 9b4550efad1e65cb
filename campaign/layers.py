"""Parameters that the user gives: YAML files and ``--set name=value``."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

from ..models.errors import ParameterError
from ..models.parameters import Layer
from ..models.plain_yaml import parse

_MAX_BYTES = 1 << 20


def load(path: Path) -> dict[str, Any]:
    """The mapping in a YAML file; an empty file is an empty one.

    Raises
    ------
    ParameterError : the file cannot be read, or holds something else
    """
    try:
        with path.open("rb") as file:
            data = file.read(_MAX_BYTES + 1)
        text = data.decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = getattr(error, "strerror", None) or "not UTF-8 text"
        raise ParameterError(f"{path}: {reason}") from None
    if len(data) > _MAX_BYTES:
        raise ParameterError(f"{path}: more than {_MAX_BYTES} bytes of parameters")
    return _mapping(parse(text, str(path)) or {}, str(path))


def assignments(items: Iterable[str]) -> dict[str, Any]:
    """The mapping that ``name=value`` items make; ``a.b=value`` sets ``b`` within ``a``.

    Raises
    ------
    ParameterError : an item is not of this form
    """
    found: dict[str, Any] = {}
    for item in items:
        name, equals, text = item.partition("=")
        *groups, last = name.strip().split(".")
        if not equals or not all((*groups, last)):
            raise ParameterError(f"--set must be NAME=VALUE, got {item!r}")
        inner = found
        for group in groups:
            inner = inner.setdefault(group, {})
            if not isinstance(inner, dict):
                raise ParameterError(f"--set {item}: {group!r} is a value already")
        inner[last] = parse(text, f"--set {item}")
    return found


def layers(config: str | None, settings: Iterable[str]) -> tuple[Layer, ...]:
    """The user's layers, the later winning: the file of ``--config``, then ``--set``."""
    file = ((config, load(Path(config))),) if config else ()
    return *file, ("--set", assignments(settings))


def _mapping(value: Any, source: str) -> dict[str, Any]:
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        raise ParameterError(f"{source}: must be a mapping of names to values")
    return value

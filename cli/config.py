"""Parameters that the user gives: YAML files and ``--set name=value``.

Plain data only: no objects, no aliases (with which a small file can hold a huge mapping), no key
twice; 1e-3 is a number and a date is text.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Mapping
from pathlib import Path
from typing import Any

import yaml

from ..models.errors import ParameterError

Layer = tuple[str, Mapping[str, Any]]
"""Values of parameters and where they come from."""

_MAX_BYTES = 1 << 20


class _Loader(yaml.SafeLoader):
    """YAML as said above."""

    yaml_implicit_resolvers = {  # noqa: RUF012
        first: [(tag, pattern) for tag, pattern in found if not tag.endswith(":timestamp")]
        for first, found in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def compose_node(self, parent: Any, index: Any) -> Any:
        if self.check_event(yaml.AliasEvent):
            raise yaml.YAMLError("aliases are not allowed")
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Hashable, Any]:
        found = super().construct_mapping(node, deep)
        if len(found) < len(node.value):
            raise yaml.MarkedYAMLError(problem="a key twice", problem_mark=node.start_mark)
        return found


class _Dumper(yaml.SafeDumper):
    """Quotes the text that :class:`_Loader` would take for a number."""


for _kind in (_Loader, _Dumper):
    _kind.add_implicit_resolver(
        "tag:yaml.org,2002:float",
        re.compile(r"[-+]?(\d[\d_]*\.?[\d_]*|\.[\d_]+)[eE][-+]?\d+$"),
        list("-+.0123456789"),
    )


def parse(text: str, source: str) -> Any:
    """The value of a YAML text.

    Raises
    ------
    ParameterError : it is no YAML, or more than plain data
    """
    try:
        return yaml.load(text, _Loader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        line = f"line {mark.line + 1}: " if mark else ""
        reason = getattr(error, "problem", None) or f"{error or type(error).__name__}"
        raise ParameterError(f"{source}: {line}not plain YAML: {reason}") from None


def dump(value: Any) -> str:
    """A value as YAML on one line, which :func:`parse` reads back."""
    text = yaml.dump(
        _plain(value), Dumper=_Dumper, default_flow_style=True, width=10**6, sort_keys=False
    )
    return text.removesuffix("\n").removesuffix("\n...")


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(v) for key, v in value.items()}
    return [_plain(v) for v in value] if isinstance(value, tuple | list) else value


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
    """What the user gives, the later winning: the file of ``--config``, then ``--set``."""
    file = ((config, load(Path(config))),) if config else ()
    return *file, ("--set", assignments(settings))


def _mapping(value: Any, source: str) -> dict[str, Any]:
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        raise ParameterError(f"{source}: must be a mapping of names to values")
    return value

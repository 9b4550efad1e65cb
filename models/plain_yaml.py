"""YAML of plain data, in which people write parameters and mappings.

No objects, no aliases (with which a small file can hold a huge mapping), no key twice; 1e-3 is a
number and a date is text. Keys are names, so that ``0x1A``, ``007`` and ``no`` are what they say.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Mapping
from typing import Any

import yaml

from .errors import ParameterError


class _Loader(yaml.SafeLoader):
    """YAML as said above."""

    yaml_implicit_resolvers = {  # noqa: RUF012
        first: [(tag, pattern) for tag, pattern in found if not tag.endswith(":timestamp")]
        for first, found in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }

    def compose_node(self, parent: Any, index: Any) -> Any:
        event = self.peek_event()  # type: ignore[no-untyped-call]
        if isinstance(event, yaml.AliasEvent):
            raise yaml.YAMLError("aliases are not allowed")
        key = isinstance(parent, yaml.MappingNode) and index is None
        if key and getattr(event, "tag", None) is not None:
            reason = f"a key with the tag {event.tag[:80]}"
            raise yaml.MarkedYAMLError(problem=reason, problem_mark=event.start_mark)
        return super().compose_node(parent, index)

    def construct_mapping(self, node: Any, deep: bool = False) -> dict[Hashable, Any]:
        for key, _ in node.value:
            if isinstance(key, yaml.ScalarNode):
                key.tag = "tag:yaml.org,2002:str"
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
        raise ParameterError(f"{source}: {line}{reason}") from None


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

"""Scenarios by name or from a YAML file: the module, and its parameters in layers.

A file has two keys, ``scenario`` (a name from ``echoset list scenarios``) and ``parameters``. The
defaults of a named scenario stand in such a file beside its module, ``scenarios/<name>.yaml``.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..models import registry
from ..models.errors import ParameterError
from ..models.parameters import Layer, shown, suggestion
from .layers import load

GROUP = "echoset.scenarios"
_KEYS = ("scenario", "parameters")


@dataclass(frozen=True, slots=True)
class Scenario:
    """A scenario: what its recordings are called, its entry point, its parameters, its file."""

    title: str
    name: str
    layers: tuple[Layer, ...]
    file: str | None = None

    @property
    def module(self) -> Any:
        """The module that simulates it."""
        return registry.load(GROUP, self.name)


def find(text: str) -> Scenario:
    """The scenario called ``text``, or in the YAML file ``text``, by whose stem it then goes.

    Raises
    ------
    ParameterError : there is none, or the file is not one of a scenario
    """
    if not text.endswith((".yaml", ".yml")):
        return Scenario(text, text, _defaults(text))
    path = Path(text)
    name, parameters = _read(path)
    try:
        registry.load(GROUP, name)
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None
    return Scenario(path.stem, name, (*_defaults(name), (text, parameters)), text)


def _defaults(name: str) -> tuple[Layer, ...]:
    module = registry.load(GROUP, name)
    path = Path(module.__file__).parent / "scenarios" / f"{name}.yaml"
    return ((path.name, _read(path)[1]),) if path.exists() else ()


def _read(path: Path) -> tuple[str, dict[str, Any]]:
    found = load(path)
    for key in found:
        if key not in _KEYS:
            raise ParameterError(f"{path}: unknown key {shown(key)}{suggestion(key, _KEYS)}")
    name, parameters = found.get("scenario"), found.get("parameters") or {}
    if not isinstance(name, str):
        raise ParameterError(f"{path}: needs the key 'scenario', a name")
    if not isinstance(parameters, dict) or not all(isinstance(k, str) for k in parameters):
        raise ParameterError(f"{path}: 'parameters' must map names to values")
    return name, parameters

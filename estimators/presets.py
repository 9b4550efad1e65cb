"""Presets as data: YAML files beside an estimator, read when they are asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib.resources import files
from typing import Any

from ..models.errors import ParameterError
from ..models.parameters import suggestion
from ..models.plain_yaml import parse
from ..models.registry import load, names

GROUP = "echoset.presets"


class Presets(Mapping[str, Mapping[str, Any]]):
    """The presets ``<estimator>.<preset>.yaml`` in the folder ``presets`` of ``package``.

    A comment at the top of a file says what it is for and how it was chosen.
    """

    def __init__(self, package: str, estimator: str) -> None:
        self._package, self._prefix = package, f"{estimator}."

    @cached_property
    def _texts(self) -> dict[str, str]:
        folder = files(self._package) / "presets"
        found = {path.name: path for path in folder.iterdir() if path.name.startswith(self._prefix)}
        return {
            name.removeprefix(self._prefix).removesuffix(".yaml"): found[name].read_text("utf-8")
            for name in sorted(found)
        }

    def __getitem__(self, name: str) -> Mapping[str, Any]:
        return dict(parse(self._texts[name], f"{self._prefix}{name}.yaml") or {})

    def __iter__(self) -> Iterator[str]:
        return iter(self._texts)

    def __len__(self) -> int:
        return len(self._texts)

    def comment(self, name: str) -> str:
        """The comment at the top of the preset's file, in one line."""
        lines = self._texts[name].splitlines()
        start = [line.removeprefix("#").strip() for line in lines if line.startswith("#")]
        return " ".join(start)


def presets(estimator: str) -> Mapping[str, Mapping[str, Any]]:
    """The presets of ``estimator``: its own, and those that plugins add.

    A plugin adds a mapping of parameters by the entry point ``<estimator>.<preset>`` of the group
    ``echoset.presets``.
    """
    own: Mapping[str, Mapping[str, Any]] = load("echoset.estimators", estimator).PRESETS
    prefix = f"{estimator}."
    added = [name for name in names(GROUP) if name.startswith(prefix)]
    if not added:
        return own
    return {**own, **{name.removeprefix(prefix): load(GROUP, name) for name in added}}


def preset(estimator: str, name: str) -> Mapping[str, Any]:
    """The parameters of one preset of ``estimator``.

    Raises
    ------
    ParameterError : it has no such preset
    """
    found = presets(estimator)
    if name not in found:
        hint = suggestion(name, found) or f"; there are: {' '.join(found)}"
        raise ParameterError(f"{estimator} has no preset {name!r}{hint}")
    return found[name]

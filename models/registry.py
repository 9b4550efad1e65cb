"""Plugins by entry point: formats, importers, estimators, scenarios and metrics, ours included."""

from __future__ import annotations

import logging
from dataclasses import fields
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from .errors import ParameterError
from .parameters import shown, suggestion

_log = logging.getLogger(__name__)


@cache
def _points(group: str) -> dict[str, EntryPoint]:
    return {point.name: point for point in sorted(entry_points(group=group))}


def names(group: str) -> list[str]:
    """Names in the entry-point group, such as ``echoset.estimators``, in order."""
    return list(_points(group))


def load(group: str, name: str) -> Any:
    """The object that the entry point ``name`` of ``group`` refers to.

    Raises
    ------
    ParameterError : no such name, with the closest that there is
    """
    points = _points(group)
    if name not in points:
        kind = group.rpartition(".")[2].replace("ies", "y").removesuffix("s")
        raise ParameterError(f"unknown {kind} {shown(name)}{suggestion(name, points)}")
    return points[name].load()


@cache
def parameters(*groups: str) -> frozenset[str]:
    """Names of the parameters of all that is in the entry-point ``groups`` and can be loaded."""
    found: set[str] = set()
    for group in groups:
        for name, point in _points(group).items():
            try:
                found |= {field.name for field in fields(point.load().Params)}
            except Exception as error:
                _log.info("%s %s does not load: %s", group, name, error)
    return frozenset(found)

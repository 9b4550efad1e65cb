"""Gathers estimates of single steps into windows, so that files grow in blocks."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..models.records import Estimates, Objects

_PER_STEP = ("time_ns",)
_PER_OBJECT = (
    "label",
    "state",
    "covariance",
    "existence",
    "class_index",
    "class_probability",
    "semi_axes",
    "rotation",
)


class Windows:
    """Takes estimates of any number of steps, gives out windows of ``size`` steps."""

    def __init__(self, size: int) -> None:
        self._size = size
        self._pending: list[Estimates] = []
        self._count = 0

    def add(self, estimates: Estimates) -> Iterator[Estimates]:
        """Take ``estimates`` and yield every window that is full."""
        self._pending.append(estimates)
        self._count += len(estimates.objects.time_ns)
        while self._count > self._size:
            whole = concatenate(self._pending)
            yield part(whole, 0, self._size)
            self._pending = [part(whole, self._size, self._count)]
            self._count -= self._size

    def rest(self) -> Estimates:
        """What has not been given out; at least one step, once anything was added."""
        return concatenate(self._pending)


def concatenate(parts: Sequence[Estimates]) -> Estimates:
    """Estimates of consecutive steps as one record."""
    if len(parts) == 1:
        return parts[0]
    objects = [p.objects for p in parts]
    first = objects[0]
    offsets = [np.zeros(1, np.int64), *(np.diff(o.row_offset) for o in objects)]
    columns: dict[str, Any] = {
        name: None
        if getattr(first, name) is None
        else np.concatenate([getattr(o, name) for o in objects])
        for name in (*_PER_STEP, *_PER_OBJECT)
    }
    return replace(
        parts[0],
        objects=replace(first, row_offset=np.cumsum(np.concatenate(offsets)), **columns),
        steps={k: np.concatenate([p.steps[k] for p in parts]) for k in parts[0].steps},
    )


def part(whole: Estimates, start: int, stop: int) -> Estimates:
    """The steps ``start:stop`` as a record of their own."""
    o: Objects = whole.objects
    rows = slice(o.row_offset[start], o.row_offset[stop])
    columns: dict[str, Any] = {
        name: None if getattr(o, name) is None else getattr(o, name)[rows] for name in _PER_OBJECT
    }
    return replace(
        whole,
        objects=replace(
            o,
            time_ns=o.time_ns[start:stop],
            row_offset=o.row_offset[start : stop + 1] - o.row_offset[start],
            **columns,
        ),
        steps={k: v[start:stop] for k, v in whole.steps.items()},
    )

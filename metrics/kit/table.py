"""Rows of scores: made from columns, and grouped."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...models.records import Scores
from ...models.runs import Runs

Key = tuple[str, str, str, str]
"""The names of a row: recording, estimator, metric, part."""


def rows(key: Key, time: Any, value: Any, n: Any = 1, stderr: Any = np.nan) -> Scores:
    """Rows with the same names; the numbers are broadcast against each other, (k,)."""
    t, v, count, error = np.broadcast_arrays(*map(np.atleast_1d, (time, value, n, stderr)))
    recording, estimator, metric, part = (Runs([(name, len(v))]) for name in key)
    t, v, error = (x.astype(float) for x in (t, v, error))
    return Scores(recording, estimator, metric, part, t, v, count.astype(np.int64), error)


def keys(scores: Scores) -> list[Key]:
    """The names of every row."""
    return list(zip(scores.recording, scores.estimator, scores.metric, scores.part, strict=True))


def groups(names: Sequence[Any]) -> dict[Any, list[int]]:
    """Indices of the rows of each distinct name, in the order of first appearance."""
    found: dict[Any, list[int]] = {}
    for i, name in enumerate(names):
        found.setdefault(name, []).append(i)
    return found

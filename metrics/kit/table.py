"""Rows of scores: made from columns, and grouped."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...models.records import Array, Scores
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


def groups(*columns: Sequence[str]) -> dict[tuple[str, ...], Array]:
    """Indices (k,) of the rows of each distinct combination, in the order of first appearance."""
    code = np.zeros(len(columns[0]), np.int64)
    for column in columns:
        known: dict[str, int] = {}
        found = [(known.setdefault(text, len(known)), n) for text, n in Runs.of(column).runs()]
        numbers, counts = np.array(found, np.int64).reshape(-1, 2).T
        _, code = np.unique(code * len(known) + np.repeat(numbers, counts), return_inverse=True)
    order = np.argsort(code, kind="stable")
    members = np.split(order, np.cumsum(np.bincount(code))[:-1]) if len(order) else []
    members.sort(key=lambda rows: int(rows[0]))
    return {tuple(column[rows[0]] for column in columns): rows for rows in members}

"""Scores as tables: made from columns, chained, and cut."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ...models.records import Array, Scores
from ...models.words import Words, chain

Key = tuple[str, str, str, str]
"""The names of a row: recording, estimator, metric, part."""


def rows(key: Key, time: Any, value: Any, n: Any = 1, stderr: Any = np.nan) -> Scores:
    """Rows with the same names; the numbers are broadcast against each other, (k,)."""
    t, v, count, error = np.broadcast_arrays(*map(np.atleast_1d, (time, value, n, stderr)))
    recording, estimator, metric, part = (Words([(name, len(v))]) for name in key)
    t, v, error = (x.astype(float) for x in (t, v, error))
    return Scores(recording, estimator, metric, part, t, v, count.astype(np.int64), error)


def concatenate(tables: Iterable[Scores]) -> Scores:
    """The rows of all ``tables`` in order.

    The provenance is theirs if it is one, otherwise the list of all different ones, ``inputs``.
    """
    parts = list(tables)
    if len(parts) == 1:
        return parts[0]

    def text(name: str) -> Words:
        return chain(getattr(p, name) for p in parts)

    def numbers(name: str, kind: type) -> Array:
        return np.concatenate([np.zeros(0, kind), *(getattr(p, name) for p in parts)])

    known: list[dict[str, Any]] = []
    for p in parts:
        if p.provenance and dict(p.provenance) not in known:
            known.append(dict(p.provenance))
    return Scores(
        text("recording"),
        text("estimator"),
        text("metric"),
        text("part"),
        numbers("time", float),
        numbers("value", float),
        numbers("n", np.int64),
        numbers("stderr", float),
        known[0] if len(known) == 1 else {"inputs": known} if known else {},
    )


def keys(scores: Scores) -> list[Key]:
    """The names of every row."""
    return list(zip(scores.recording, scores.estimator, scores.metric, scores.part, strict=True))


def groups(names: Sequence[Any]) -> dict[Any, list[int]]:
    """Indices of the rows of each distinct name, in the order of first appearance."""
    found: dict[Any, list[int]] = {}
    for i, name in enumerate(names):
        found.setdefault(name, []).append(i)
    return found

"""Scores as columns and as series over time, with the names that pictures give them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models.names import scenario
from ...models.records import Array, Scores
from ..pivot import records
from .protocol import Selection

QUANTITIES = {
    "rmse": ("RMSE", "m"),
    "nees": ("NEES", "1"),
    "ospa": ("OSPA", "m"),
    "ospa-normalised": ("normalised OSPA", "m"),
    "ospa2": ("OSPA$^{(2)}$", "m"),
    "ospa-gw": ("OSPA with extents", "m"),
    "gospa": ("GOSPA", "m"),
    "cardinality": ("number of objects", "1"),
    "regional": ("error of the number of targets", "1"),
}
"""Name and unit of the metrics that have a value per time."""


def quantity(metric: str, part: str = "") -> str:
    """The label of an axis: a metric and the part that it scores, with its unit."""
    name, unit = QUANTITIES.get(metric, (metric, ""))
    of = {"": "", "error": ", error"}.get(part, f" of the {part}")
    return f"{name}{of}" + (f" [{unit}]" if unit else "")


def several(metrics: Sequence[str]) -> list[str]:
    """Metrics, each once, known ones first."""
    rank = {name: i for i, name in enumerate(QUANTITIES)}
    return sorted(set(metrics), key=lambda m: (rank.get(m, len(rank)), m))


@dataclass(frozen=True, slots=True, eq=False)
class Columns:
    """Rows of scores as arrays of equal length (m,)."""

    scenario: Array
    recording: Array
    estimator: Array
    metric: Array
    part: Array
    time: Array
    value: Array

    @staticmethod
    def of(scores: Scores, selection: Selection | None = None) -> Columns:
        """All rows of ``scores``, or those per time within ``selection``."""
        names = (scores.recording, scores.estimator, scores.metric, scores.part)
        short = {name: scenario(name) for name in set(scores.recording)}
        texts = [np.array(c, object) for c in ([short[r] for r in scores.recording], *names)]
        found = Columns(*[*texts, scores.time, scores.value])
        if selection is None:
            return found
        t = scores.time
        return found.where((selection.start <= t) & (t <= selection.stop))

    def where(self, mask: Array) -> Columns:
        """The rows of ``mask`` (m,)."""
        return Columns(*(getattr(self, name)[mask] for name in self.__dataclass_fields__))

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """Pooled values over ``time`` (n,) [s] of one ``label``, with standard errors, and validity."""

    label: str
    bound: bool
    time: Array
    value: Array
    stderr: Array
    valid: Array


def series(pooled: Scores, metric: str, part: str, selection: Selection) -> list[Series]:
    """The series of a metric's part, estimators first, then bounds (see :mod:`..pivot`)."""
    bounds = set(pooled.where(estimator="").metric)
    asked = (metric, bool), (None, "")
    some = Scores.join(pooled.where(metric=m, estimator=e, part=part) for m, e in asked)
    rows = [r for r in records(some) if r.metric == metric]
    rows = [r for r in rows if selection.start <= r.time <= selection.stop]
    many = len({r.scenario for r in rows}) > 1
    found = []
    for key in dict.fromkeys((r.scenario, r.estimator) for r in rows):
        mine = sorted((r for r in rows if (r.scenario, r.estimator) == key), key=lambda r: r.time)
        columns: list[Any] = [
            np.array([getattr(r, c) for r in mine]) for c in ("time", "value", "stderr", "valid")
        ]
        found.append(Series(" ".join(key if many else key[1:]), key[1] in bounds, *columns))
    return found


def title(pooled: Scores) -> str:
    """The scenarios of the scores and how many recordings were pooled."""
    runs: dict[str, int] = {}
    some = pooled.where(recording=lambda name: name.endswith("*"), estimator=bool)
    for name, n in zip(some.recording, some.n.tolist(), strict=True):
        runs[scenario(name)] = max(runs.get(scenario(name), 0), n)
    counts = {name: f"{n} run{'s' * (n > 1)}" for name, n in runs.items()}
    return "; ".join(n if name == "*" else f"{name}, {n}" for name, n in counts.items())

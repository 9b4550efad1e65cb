"""Scores as columns and as series over time, with the names that pictures give them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...models.names import scenario
from ...models.records import Array, Scores
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
    """The series of a metric's part, estimators first, then its bounds (see :mod:`..pivot`)."""
    timed = pooled.where(part=part, timed=True)
    inside = (selection.start <= timed.time) & (timed.time <= selection.stop)
    timed = timed.take(np.flatnonzero(inside))
    own = timed.where(metric=metric, estimator=bool)
    found = [(pair, own.where(*pair), False) for pair in _pairs(own.recording, own.estimator)]
    if metric == "rmse":
        limits = timed.where(estimator="", metric=lambda name: not name.endswith("-valid"))
        for pair in _pairs(limits.recording, limits.metric):
            found.append((pair, limits.where(pair[0], metric=pair[1]), True))
    many = len({scenario(recording) for (recording, _), *_ in found}) > 1
    made = []
    for (recording, name), rows, bound in found:
        rows = rows.take(np.argsort(rows.time, kind="stable"))
        valid = np.ones(len(rows), bool)
        if bound:
            said = timed.where(recording, "", f"{name}-valid")
            valid = ~np.isin(rows.time, said.time[said.value != 1.0])
        label = f"{scenario(recording)} {name}" if many else name
        made.append(Series(label, bound, rows.time, rows.value, rows.stderr, valid))
    return made


def _pairs(first: Sequence[str], second: Sequence[str]) -> list[tuple[str, str]]:
    """All different pairs of two columns, in order."""
    return list(dict.fromkeys(zip(first, second, strict=True)))


def title(pooled: Scores) -> str:
    """The scenarios of the scores and how many recordings were pooled."""
    runs: dict[str, int] = {}
    some = pooled.where(recording=lambda name: name.endswith("*"), estimator=bool)
    for name, n in zip(some.recording, some.n.tolist(), strict=True):
        runs[scenario(name)] = max(runs.get(scenario(name), 0), n)
    counts = {name: f"{n} run{'s' * (n > 1)}" for name, n in runs.items()}
    return "; ".join(n if name == "*" else f"{name}, {n}" for name, n in counts.items())

"""What a report says first of each scenario: what was compared, which is best, and by how much."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..models.names import scenario
from ..models.records import Scores
from ..models.runs import Runs
from .gaps import left_out
from .table import Number, figures

_ERRORS = (
    *(("rmse-mean", part, f"RMSE of the {part}, averaged over time,") for part in
      ("device", "centre", "extent")),
    ("gospa", "", "GOSPA"),
    ("ospa", "", "OSPA"),
    ("ospa2", "", "OSPA(2)"),
    ("ospa-gw", "", "OSPA with extents"),
    ("ospa-normalised", "", "normalised OSPA"),
)  # fmt: skip
"""Metric, part and name [m] of what estimators are compared by: the first that most have."""
_APART = 2.0
"""Standard errors of a difference below which two estimators are not told apart."""
FEW = 0.5
"""Share of steps below which a score is said to be of few."""


@dataclass(frozen=True, slots=True)
class Headline:
    """A paragraph on a scenario, and the metric (empty: none) that it compares by."""

    scenario: str
    text: str
    metric: str


def headlines(scores: Scores, pooled: Scores) -> list[Headline]:
    """A headline for each scenario of the ``scores``, which are ``pooled`` by scenario."""
    whole = pooled.where(timed=False, part=lambda part: "@" not in part)
    scored = steps(scores)
    found = []
    for scene in dict.fromkeys(map(scenario, whole.recording)):
        mine = whole.take(
            np.flatnonzero(Runs.of(whole.recording).map(scenario).where(scene.__eq__))
        )
        names = list(dict.fromkeys(filter(None, mine.estimator)))
        if not names:
            continue
        runs = int(mine.where(estimator=bool).n.max())
        sentences = [f"{_list(names)} on {runs} recording{'s' * (runs != 1)}."]
        metric, sentence = _comparison(mine)
        sentences += [sentence] if sentence else []
        base = metric.removesuffix("-mean")
        if (scene, base) in scored:
            count, of = scored[scene, base]
            only = "only " if count < FEW * of else ""
            sentences.append(f"Scored were {only}{count:,} of {of:,} steps.")
        found.append(Headline(scene, " ".join(sentences), base))
    return found


def steps(scores: Scores) -> dict[tuple[str, str], tuple[int, int]]:
    """How many steps were scored and how many there were, by scenario and metric."""
    found: dict[tuple[str, str], tuple[int, int]] = {}
    for (scene, _, metric), (out, of) in left_out(scores).items():
        count, before = found.get((scene, metric), (0, 0))
        found[scene, metric] = count + of - out, before + of
    return found


def few(scores: Scores) -> Iterator[str]:
    """A line for each scenario and metric of which less than half of the steps were scored."""
    for (scene, metric), (count, of) in steps(scores).items():
        if count < FEW * of:
            yield (
                f"{scene}: {metric} is of {count} of {of} steps: the others lack an estimate, or "
                f"truth within {metric}.max_gap of score"
            )


def _comparison(scores: Scores) -> tuple[str, str]:
    """The metric and a sentence on who is best by it; empty where nothing says that."""
    tables = [(m, name, scores.where(metric=m, estimator=bool, part=p)) for m, p, name in _ERRORS]
    metric, name, rows = max(tables, key=lambda table: len(table[2]))
    if not len(rows):
        return "", ""
    order = np.argsort(rows.value, kind="stable")
    best, *others = [
        (rows.estimator[i], Number(float(rows.value[i]), float(rows.stderr[i])))
        for i in order.tolist()
    ]
    text = f"{name} is {f'smallest with {best[0]}: ' if others else ''}{figures(best[1])} m"
    text = f"The {text}" if name.startswith("RMSE") else text
    said = [_beside(estimator, number, best[1]) for estimator, number in others]
    bound = _bound(scores, rows.part[0]) if name.startswith("RMSE") else ""
    return metric, "; ".join(filter(None, (text, *said, bound))) + "."


def _beside(estimator: str, number: Number, best: Number) -> str:
    """How much worse an estimator is, and whether that can be told."""
    text = f"{estimator} has {figures(number)} m"
    if best.value > 0 and number.value > best.value:
        text += f", {number.value / best.value:.3g} times as much"
    spread = np.hypot(best.stderr, number.stderr)
    if number.value - best.value < _APART * spread:
        text += " (the standard errors do not tell them apart)"
    return text


def _bound(scores: Scores, part: str) -> str:
    """What the bounds say of a part, where they are valid."""
    rows = scores.where(estimator="", part=part, metric=lambda name: name.endswith("-mean"))
    said = []
    for metric, value in zip(rows.metric, rows.value.tolist(), strict=True):
        name = metric.removesuffix("-mean")
        valid = scores.where(estimator="", part=part, metric=f"{name}-valid").value
        if (valid == 1.0).all():
            said.append(f"the bound {name} is {figures(Number(value))} m")
    return "; ".join(said)


def _list(names: list[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))

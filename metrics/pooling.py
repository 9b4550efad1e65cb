"""Scores of recordings pooled into scores of a campaign, with standard errors over recordings.

Rows of equal estimator, metric, part and time become one row whose ``n`` is the number of
recordings. Metrics that are roots of mean squares (:func:`is_rms`) are pooled as such, all others
by their mean; in an aggregate each recording weighs with its ``n``, so that fractions and roots of
mean squares are those over all steps of all recordings. From the rows per time of such a metric
``m`` comes ``m-mean``: the mean over time of the pooled values.

Standard errors are those of :data:`RESAMPLES` resamples of the recordings, the same for every row.
A single recording keeps its own.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from ..models import registry
from ..models.errors import InputError
from ..models.names import scenario
from ..models.records import Array, Scores
from ..models.runs import Runs
from .kit.bootstrap import recording_weights
from .kit.table import groups, rows
from .protocol import GROUP, load

RESAMPLES = 1000


def is_rms(name: str) -> bool:
    """Whether rows called ``name`` are roots of mean squares: so says the metric they are of."""
    return name in _rms_names()


@cache
def _rms_names() -> frozenset[str]:
    return frozenset(row for name in registry.names(GROUP) for row in load(name).QUADRATIC)


def pool(scores: Scores, by_scenario: bool = False) -> Scores:
    """Pool ``scores`` over recordings: ``recording`` is ``*``, or ``<scenario>-*``.

    Rows that are pooled already pass unchanged, without those that are found anew.

    Raises
    ------
    InputError : a recording was scored twice for the same estimator, with different results
    """
    raw = scores.where(lambda name: not name.endswith("*"))
    ready = scores.where(lambda name: name.endswith("*"))
    pools = Runs.of(raw.recording).map(lambda name: f"{scenario(name)}-*" if by_scenario else "*")
    tables = []
    for key, members in groups(pools, raw.estimator, raw.metric, raw.part).items():
        tables += _pool_rows(raw.take(members), key)
    fresh = Scores.join(tables)
    del tables
    if not len(ready):
        return replace(fresh, provenance=scores.provenance)
    facts = set(_facts(fresh))
    other = np.array([fact not in facts for fact in _facts(ready)], bool)
    return replace(
        Scores.join([fresh, ready.take(np.flatnonzero(other))]), provenance=scores.provenance
    )


def _facts(scores: Scores) -> list[tuple[object, ...]]:
    """Each row without its recording; the time as text, so that NaN equals NaN."""
    times = map(repr, scores.time.tolist())
    numbers = times, scores.value.tolist(), scores.n.tolist()
    return list(zip(scores.estimator, scores.metric, scores.part, *numbers, strict=True))


def _pool_rows(scores: Scores, key: tuple[str, ...]) -> list[Scores]:
    """``scores`` of equal names as pooled rows: per time, aggregate, mean over time."""
    pool_, estimator, metric, part = key
    name, rms = (pool_, estimator, metric, part), is_rms(metric)
    tables = []
    timed = ~np.isnan(scores.time)
    if timed.any():
        table = scores.take(np.flatnonzero(timed))
        times, column = np.unique(table.time, return_inverse=True)
        value, weight, own = _matrix(table, column)
        seen = weight > 0
        pooled, spread, of_mean = _pooled(value, seen, own.sum(0), rms)
        tables.append(rows(name, times, pooled, seen.sum(0), spread))
        if rms:
            mean = pool_, estimator, f"{metric}-mean", part
            tables.append(rows(mean, np.nan, pooled.mean(), len(value), of_mean))
    if not timed.all():
        table = scores.take(np.flatnonzero(~timed))
        value, weight, own = _matrix(table, np.zeros(len(table), int))
        pooled, spread, _ = _pooled(value, weight, own[0], rms)
        tables.append(rows(name, np.nan, pooled, len(value), spread))
    return tables


def _matrix(scores: Scores, column: Array) -> tuple[Array, Array, Array]:
    """Values, weights ``n`` and standard errors by recording and column (R, K), 0 for no row."""
    recordings = groups(scores.recording)
    row = np.empty(len(scores), int)
    for r, members in enumerate(recordings.values()):
        row[members] = r
    value, weight, own = (np.zeros((len(recordings), column.max() + 1)) for _ in range(3))
    n = np.maximum(scores.n, 1)
    for table, source in ((value, scores.value), (weight, n), (own, scores.stderr)):
        table[row, column] = source
    different = np.flatnonzero(value[row, column] != scores.value)
    if len(different):
        i = int(different[0])
        raise InputError(
            f"{scores.recording[i]}: scored more than once for {scores.estimator[i]!r}, "
            f"with different {scores.metric[i]}"
        )
    return value, weight, own


_COLUMNS = 512
"""Columns whose resamples are held at a time."""


def _pooled(value: Array, weight: Array, own: Array, rms: bool) -> tuple[Array, Array, float]:
    """Pooled values (K,), their standard errors (K,), and that of their mean.

    Values and weights (R, K) are by recording; where there is one alone it keeps its ``own``
    standard error (K,), and the mean has none.
    """
    number = len(value)
    draws = recording_weights(number, RESAMPLES) if number > 1 else np.zeros((0, 1))
    parts, sums, counts = [], np.zeros(len(draws)), np.zeros(len(draws))
    for start in range(0, value.shape[1], _COLUMNS):
        part = slice(start, start + _COLUMNS)
        pooled, resampled = _means(value[:, part], weight[:, part], draws, rms)
        spread = own[part]
        if number > 1:
            known = ~np.isnan(resampled)
            above = resampled - np.nanmin(resampled, axis=0)
            several = (weight[:, part] > 0).sum(0) > 1
            spread = np.where(several, np.nanstd(above, axis=0, ddof=1), spread)
            sums += np.nansum(resampled, 1)
            counts += known.sum(1)
        parts.append((pooled, spread))
    of_mean = sums / counts
    above = of_mean - of_mean.min(initial=np.inf)
    found, spread = (np.concatenate(column) for column in zip(*parts, strict=True))
    return found, spread, float(np.std(above, ddof=1)) if number > 1 else np.nan


def _means(value: Array, weight: Array, draws: Array, rms: bool) -> tuple[Array, Array]:
    """Weighted means over recordings (K,), and those of every resample (B, K) in ``draws`` (B, R).

    About the largest value, so that the mean of equal values is exact, and never below the least,
    as rounding has it: a square below zero has no root.
    """
    power = value**2 if rms else value
    base = power.max(axis=0, where=weight > 0, initial=-np.inf)
    least = power.min(axis=0, where=weight > 0, initial=np.inf)
    excess = np.where(weight > 0, (power - base) * weight, 0.0)
    times = np.vstack([np.ones(len(value)), draws])
    total = times @ weight
    means = base + np.divide(
        times @ excess, total, out=np.full(total.shape, np.nan), where=total > 0
    )
    means = np.maximum(means, least)
    means = np.sqrt(means) if rms else means
    return means[0].copy(), means[1:]

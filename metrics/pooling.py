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
from .kit.bootstrap import recording_weights
from .kit.table import Key, groups, rows
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
    done = np.array([name.endswith("*") for name in scores.recording], bool)
    pools = [f"{scenario(name)}-*" if by_scenario else "*" for name in scores.recording]
    names = list(zip(pools, scores.estimator, scores.metric, scores.part, strict=True))
    raw, tables = np.flatnonzero(~done), []
    for key, members in groups([names[i] for i in raw]).items():
        tables += _pool_rows(scores, raw[members], key)
    fresh = Scores.join(tables)
    facts = set(_facts(fresh))
    ready = [i for i, fact in enumerate(_facts(scores)) if done[i] and fact not in facts]
    return replace(
        Scores.join([fresh, scores.take(np.array(ready, int))]), provenance=scores.provenance
    )


def _facts(scores: Scores) -> list[tuple[object, ...]]:
    """Each row without its recording; the time as text, so that NaN equals NaN."""
    times = map(repr, scores.time.tolist())
    numbers = times, scores.value.tolist(), scores.n.tolist()
    return list(zip(scores.estimator, scores.metric, scores.part, *numbers, strict=True))


_UNKNOWN = np.full(1, np.nan)


def _pool_rows(scores: Scores, indices: Array, key: Key) -> list[Scores]:
    """The rows ``indices`` of equal names as pooled rows: per time, aggregate, mean over time."""
    time, rms = scores.time[indices], is_rms(key[2])
    tables = []
    timed = ~np.isnan(time)
    if timed.any():
        times = np.unique(time[timed])
        value, weight, own = _matrix(scores, indices[timed], np.searchsorted(times, time[timed]))
        seen = weight > 0
        pooled, resampled = _means(value, seen, rms)
        spread = _spread(resampled, seen.sum(0), own.sum(0))
        tables.append(rows(key, times, pooled, seen.sum(0), spread))
        if rms:
            mean = key[0], key[1], f"{key[2]}-mean", key[3]
            spread = _spread(np.nanmean(resampled, 1)[:, None], np.array([len(value)]), _UNKNOWN)
            tables.append(rows(mean, np.nan, pooled.mean(), len(value), spread))
    if not timed.all():
        zero = np.zeros((~timed).sum(), int)
        value, weight, own = _matrix(scores, indices[~timed], zero)
        pooled, resampled = _means(value, weight, rms)
        spread = _spread(resampled, np.array([len(value)]), own[0])
        tables.append(rows(key, np.nan, pooled, len(value), spread))
    return tables


def _matrix(scores: Scores, indices: Array, column: Array) -> tuple[Array, Array, Array]:
    """Values, weights ``n`` and standard errors by recording and column (R, K), 0 for no row."""
    recordings = groups([scores.recording[i] for i in indices])
    row = np.empty(len(indices), int)
    for r, members in enumerate(recordings.values()):
        row[members] = r
    value, weight, own = (np.zeros((len(recordings), column.max() + 1)) for _ in range(3))
    n = np.maximum(scores.n, 1)
    for table, source in ((value, scores.value), (weight, n), (own, scores.stderr)):
        table[row, column] = source[indices]
    different = np.flatnonzero(value[row, column] != scores.value[indices])
    if len(different):
        i = indices[different[0]]
        raise InputError(
            f"{scores.recording[i]}: scored more than once for {scores.estimator[i]!r}, "
            f"with different {scores.metric[i]}"
        )
    return value, weight, own


def _means(value: Array, weight: Array, rms: bool) -> tuple[Array, Array]:
    """Weighted means over recordings (K,), and those of every resample (B, K).

    About the largest value, so that the mean of equal values is exact.
    """
    power = value**2 if rms else value
    base = power.max(axis=0, where=weight > 0, initial=-np.inf)
    excess = np.where(weight > 0, (power - base) * weight, 0.0)
    draws = np.vstack([np.ones(len(value)), recording_weights(len(value), RESAMPLES)])
    total = draws @ weight
    means = base + np.divide(
        draws @ excess, total, out=np.full(total.shape, np.nan), where=total > 0
    )
    means = np.sqrt(means) if rms else means
    return means[0], means[1:]


def _spread(resampled: Array, recordings: Array, own: Array) -> Array:
    """Standard errors (K,) from resamples (B, K), or their ``own`` where there is one recording."""
    above = resampled - np.nanmin(resampled, axis=0)
    return np.where(recordings > 1, np.nanstd(above, axis=0, ddof=1), own)

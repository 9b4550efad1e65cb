"""A value per step as scores: the rows over time, and their mean with a standard error."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ...models.parameters import parameter
from ...models.records import Array, Scores
from .alignment import Scored
from .table import Key, rows

_BLOCK = "steps in a block of the bootstrap behind standard errors, 0 for none"


@dataclass(frozen=True, slots=True)
class Steps(Scored):
    """Which steps are scored, and how the standard error of their mean is found."""

    block: int = parameter(50, "1", _BLOCK, within="[0, inf)")


@dataclass(frozen=True, slots=True)
class Pairing(Scored):
    """Which steps are scored, and which true and estimated objects belong together."""

    order: float = parameter(2.0, "1", "order p: how much outliers weigh", within="[1, inf)")
    cutoff: float = parameter(
        10.0, "m", "cut-off c: no pair this far apart is assigned", within="(0, inf)"
    )


@dataclass(frozen=True, slots=True)
class Distance(Pairing):
    """The same, and how the standard error of their mean is found."""

    block: int = parameter(50, "1", _BLOCK, within="[0, inf)")


class Aligned(Protocol):
    """Scored steps at ``time`` (n,) [s], and the number of steps left out."""

    @property
    def time(self) -> Array: ...

    @property
    def left_out(self) -> int: ...

    def __len__(self) -> int: ...


def mean_stderr(values: Array, block: int) -> float:
    """Standard error of the mean of ``values`` (n,), which depend on their neighbours.

    That of the bootstrap by blocks of consecutive values on a circle, in its closed form for
    infinitely many resamples; NaN if ``block`` is 0 or there are not two blocks. Politis and
    Romano, A circular block-resampling procedure for stationary data, 1992.
    """
    n = len(values)
    if block == 0 or n < 2 * block:
        return float("nan")
    total = np.cumsum(np.concatenate(([0.0], values, values[: block - 1])))
    means = (total[block:] - total[:-block]) / block
    return float(np.std(means) / np.sqrt(n / block))


def series(key: Key, time: Array, values: Array, block: int) -> Scores:
    """``values`` (n,) at ``time`` (n,) [s] and their mean, called ``key``."""
    spread = mean_stderr(values, block)
    mean = rows(key, np.nan, values.mean(), len(values), spread)
    return Scores.join([rows(key, time, values), mean])


def parts(
    key: tuple[str, str, str], aligned: Aligned, values: Mapping[str, Array], block: int
) -> Scores:
    """The series of every part in ``values``, and the number of steps left out.

    ``key`` names recording, estimator and metric.
    """
    recording, estimator, metric = key
    tables = [series((*key, part), aligned.time, v, block) for part, v in values.items()]
    steps = len(aligned) + aligned.left_out
    left_out = (recording, estimator, f"{metric}-left-out", "")
    return Scores.join([*tables, rows(left_out, np.nan, aligned.left_out, steps)])

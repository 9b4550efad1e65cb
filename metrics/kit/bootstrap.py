"""Standard errors by resampling, with random streams that are fixed once for all.

Efron and Tibshirani, An Introduction to the Bootstrap, 1993; blocks on a circle: Politis and
Romano, A circular block-resampling procedure for stationary data, 1992.
"""

from __future__ import annotations

import numpy as np

from ...models.random import generator
from ...models.records import Array


def recording_weights(count: int, resamples: int) -> Array:
    """How often each of ``count`` recordings is drawn, in each resample: (resamples, count).

    The same for every estimator, so that their resamples are paired.
    """
    rng = generator(0, "bootstrap", "recordings")
    return rng.multinomial(count, np.full(count, 1 / count), size=resamples).astype(float)


def block_weights(count: int, block: int, resamples: int) -> Array:
    """How often each of ``count`` steps is drawn, in each resample: (resamples, count).

    Blocks of ``block`` consecutive steps on a circle with uniform starts; as many as cover the
    steps, the last one cut.
    """
    rng = generator(0, "bootstrap", "blocks")
    starts = rng.integers(count, size=(resamples, -(-count // block)))
    drawn = (starts[..., None] + np.arange(block)).reshape(resamples, -1)[:, :count] % count
    weights = np.zeros((resamples, count))
    np.add.at(weights, (np.arange(resamples)[:, None], drawn), 1.0)
    return weights


def block_stderr(squares: Array, block: int, resamples: int) -> float:
    """Standard error of the root of the mean of ``squares`` (k,), by blocks of consecutive steps.

    NaN if ``block`` is 0 or there are not two blocks.
    """
    if block == 0 or len(squares) < 2 * block:
        return float("nan")
    weights = block_weights(len(squares), block, resamples)
    return float(np.std(np.sqrt(weights @ squares / len(squares)), ddof=1))

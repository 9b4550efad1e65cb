"""Draws from a posterior that is far narrower than its prior: a tempered sequential sampler.

The likelihood enters by powers that rise from 0 to 1, each so much that half of the particles stay
effective; after each rise the particles are resampled and moved by random-walk Metropolis steps
with their own covariance. Del Moral, Doucet and Jasra, "Sequential Monte Carlo samplers", JRSS B 68
(2006); the choice of the powers after Jasra et al., Scand. J. Statistics 38 (2011).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...models.records import Array
from .resampling import effective_sample_size, normalise, systematic

MOVES = 3
"""Metropolis steps after each rise."""
LOG_SCALES = (np.log(0.05), np.log(1.0))
"""Bounds of the random walk's scale, in units of the particles' spread; drawn log-uniformly."""


def temper(
    log_likelihood: Callable[[Array], Array], dimension: int, n: int, rng: np.random.Generator
) -> Array:
    """Draws (dimension, n) of standard normal variables given their log-likelihood.

    ``log_likelihood`` maps (dimension, n) to (n,). A prior of another shape is a map from standard
    normal variables inside it.
    """
    x = rng.normal(size=(dimension, n))
    log_l = log_likelihood(x)
    power = 0.0
    while power < 1.0:
        rise = _rise(log_l, 1.0 - power)
        power += rise
        index = systematic(normalise(rise * log_l), rng.random(), n)
        x, log_l = x[:, index], log_l[index]
        for _ in range(MOVES):
            root = np.linalg.cholesky(np.cov(x) + 1e-12 * np.eye(dimension))
            scale = np.exp(rng.uniform(*LOG_SCALES, n))
            y = x + scale * (root @ rng.normal(size=x.shape))
            log_y = log_likelihood(y)
            ratio = power * (log_y - log_l) + ((x**2).sum(0) - (y**2).sum(0)) / 2
            accept = np.log(rng.random(n)) < ratio
            x, log_l = np.where(accept, y, x), np.where(accept, log_y, log_l)
    return x


def _rise(log_l: Array, most: float) -> float:
    """The largest rise up to ``most`` that leaves half of the particles effective."""
    half = len(log_l) / 2
    if effective_sample_size(normalise(most * log_l)) >= half:
        return most
    low, high = 0.0, most
    for _ in range(50):
        middle = (low + high) / 2
        if effective_sample_size(normalise(middle * log_l)) >= half:
            low = middle
        else:
            high = middle
    return high

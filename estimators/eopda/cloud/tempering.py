"""Draws from a posterior that is far narrower than its prior: a tempered sequential sampler.

From draws of a reference density q the way to the posterior goes over ``q^(1-t) (prior x
likelihood)^t`` with powers t that rise from 0 to 1, each so much that half of the particles stay
effective; after each rise the particles are resampled and moved by Metropolis steps along the
difference of two others, which are as short or long as the modes need. Del Moral, Doucet and Jasra,
"Sequential Monte Carlo samplers", JRSS B 68 (2006); the choice of the powers after Jasra et al.,
Scand. J. Statistics 38 (2011), the moves after ter Braak, Statistics and Computing 16 (2006).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ....models.records import Array
from .resampling import effective_sample_size, normalise, systematic

Jump = Callable[[Array, np.random.Generator], tuple[Array, Array]]
"""A symmetric proposal for draws (dimension, n), and the logs (n,) of its Jacobian."""
MOVES = 3
"""Metropolis steps after each rise."""
LOG_SCALES = (np.log(0.05), np.log(1.0))
"""Bounds of a step's length in units of the difference; drawn log-uniformly."""


def temper(
    log_posterior: Callable[[Array], Array],
    log_reference: Callable[[Array], Array],
    x: Array,
    rng: np.random.Generator,
    jump: Jump | None = None,
) -> tuple[Array, float]:
    """Draws (dimension, n) from a density given draws ``x`` of a reference, and its log integral.

    With ``jump`` each rise ends with one more Metropolis step, from mode to mode.

    ``log_posterior`` and ``log_reference`` map (dimension, n) to (n,); the first may be up to any
    factor, whose integral is returned, and minus infinity where nothing is.

    Raises
    ------
    EstimatorError : the posterior vanishes at all draws
    """
    n = x.shape[1]
    moves = [_along_a_difference] * MOVES + ([] if jump is None else [jump])
    log_p, log_q = log_posterior(x), log_reference(x)
    power, log_z = 0.0, 0.0
    while power < 1.0:
        with np.errstate(invalid="ignore"):
            log_r = log_p - log_q
        rise = _rise(log_r, 1.0 - power)
        power += rise
        log_w = rise * log_r
        top = log_w.max()
        index = systematic(normalise(log_w), rng.random(), n)
        log_z += float(top + np.log(np.mean(np.exp(log_w - top))))
        x, log_p, log_q = x[:, index], log_p[index], log_q[index]
        for propose in moves:
            y, log_jacobian = propose(x, rng)
            new_p, new_q = log_posterior(y), log_reference(y)
            with np.errstate(invalid="ignore"):
                # where nothing can be, both are minus infinity, and no comparison holds
                ratio = power * (new_p - log_p) + (1 - power) * (new_q - log_q)
                accept = np.log(rng.random(n)) < ratio + log_jacobian
            x = np.where(accept, y, x)
            log_p, log_q = np.where(accept, new_p, log_p), np.where(accept, new_q, log_q)
    return x, log_z


def _along_a_difference(x: Array, rng: np.random.Generator) -> tuple[Array, Array]:
    """Steps along the differences of two others."""
    n = x.shape[1]
    scale = np.exp(rng.uniform(*LOG_SCALES, n))
    a, b = rng.integers(0, n, (2, n))
    y = x + scale * (x[:, a] - x[:, b]) + 1e-9 * rng.normal(size=x.shape)
    return y, np.zeros(n)


def _rise(log_r: Array, most: float) -> float:
    """The largest rise up to ``most`` that leaves half of the particles effective."""
    half = len(log_r) / 2
    if effective_sample_size(normalise(most * log_r)) >= half:
        return most
    low, high = 0.0, most
    for _ in range(50):
        middle = (low + high) / 2
        if effective_sample_size(normalise(middle * log_r)) >= half:
            low = middle
        else:
            high = middle
    return high

"""Weights of particles and their systematic resampling."""

from __future__ import annotations

import numpy as np

from ....models.errors import EstimatorError
from ....models.records import Array


def normalise(log_w: Array) -> Array:
    """Weights (n,) that sum to one from their logarithms (n,) up to a constant.

    Raises
    ------
    EstimatorError : all weights vanish, or one is not a number
    """
    top = log_w.max()
    if not np.isfinite(top):
        raise EstimatorError("all particle weights vanish" if top < 0 else "weights not finite")
    w = np.exp(log_w - top)
    return np.asarray(w / w.sum())


def log_mean(w: Array, log_factor: Array) -> float:
    """Logarithm of the mean of a factor, given as logarithms (n,), by weights ``w`` (n,)."""
    top = log_factor.max()
    return float(top + np.log(np.exp(log_factor - top) @ w))


def effective_sample_size(w: Array) -> float:
    """``1 / sum w^2`` of normalised weights (n,)."""
    return float(1.0 / np.sum(w * w))


def systematic(w: Array, u: float, n: int) -> Array:
    """Indices (n,) of particles drawn by their weights ``w``, with one uniform number ``u``."""
    edges = np.cumsum(w)
    return np.searchsorted(edges / edges[-1], (np.arange(n) + u) / n)

"""How much a Markov chain tells."""

from __future__ import annotations

import numpy as np

from ....models.records import Array


def effective_sample_size(x: Array) -> float:
    """Effective number of independent values in a stationary series x (n,).

    n over the autocorrelation time, whose sum ends where pairs of neighbouring autocorrelations
    cease to be positive. C. J. Geyer, Practical Markov chain Monte Carlo, Stat. Sci. 7(4), 1992.
    """
    n = len(x)
    y = x - x.mean()
    if n < 4 or not y.any():
        return float(n)
    f = np.fft.rfft(y, 2 * n)
    covariance = np.fft.irfft(np.abs(f) ** 2)[:n]
    pairs = covariance[: n // 2 * 2].reshape(-1, 2).sum(1) / covariance[0]
    end = int(np.argmax(pairs <= 0)) if (pairs <= 0).any() else len(pairs)
    return float(n / max(2 * pairs[:end].sum() - 1, 1 / n))

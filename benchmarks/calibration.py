"""Times work beside a fixed calibration kernel: machines differ and drift, ratios do so less."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np


def fastest(work: Callable[[], object], runs: int = 3) -> float:
    """Seconds of the fastest of some runs."""
    seconds = []
    for _ in range(runs):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def kernel() -> float:
    """A fixed amount of exponentials and products."""
    x = np.linspace(0.0, 1.0, 200 * 200).reshape(200, 200)
    return float(sum((np.exp(-x * k) @ x)[0, 0] for k in range(200)))

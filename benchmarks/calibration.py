"""Times work beside a fixed calibration kernel: machines differ and drift, ratios do so less.

Whoever imports this runs with one thread: the process starts again if it does not yet.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable

import numpy as np

if os.environ.get("OMP_NUM_THREADS") != "1":
    os.environ["OMP_NUM_THREADS"] = "1"
    os.execv(sys.executable, [sys.executable, *sys.argv])


def fastest(work: Callable[[], object], runs: int = 3) -> float:
    """Processor seconds of the fastest of some runs, in which other processes do not count."""
    seconds = []
    for _ in range(runs):
        start = time.process_time()
        work()
        seconds.append(time.process_time() - start)
    return min(seconds)


def kernel() -> float:
    """A fixed amount of exponentials and products."""
    x = np.linspace(0.0, 1.0, 200 * 200).reshape(200, 200)
    return float(sum((np.exp(-x * k) @ x)[0, 0] for k in range(200)))

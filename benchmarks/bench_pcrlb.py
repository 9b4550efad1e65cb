"""Both bounds of the scenario ``uwb-olos``: ``python benchmarks/bench_pcrlb.py``.

Prints the milliseconds of the fastest of three runs and their ratio to a fixed calibration kernel
timed in the same run: machines differ and drift, ratios do so less.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from importlib.resources import files

import numpy as np
import yaml

from echoset.metrics import pcrlb, pcrlb_star
from echoset.models.parameters import resolve
from echoset.models.random import generator
from echoset.simulate import uwb


def fastest(work: Callable[[], object]) -> float:
    """Seconds of the fastest of three runs."""
    seconds = []
    for _ in range(3):
        start = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - start)
    return min(seconds)


def calibration() -> float:
    """A fixed amount of exponentials and products."""
    x = np.linspace(0.0, 1.0, 200 * 200).reshape(200, 200)
    return float(sum((np.exp(-x * k) @ x)[0, 0] for k in range(200)))


def main() -> None:
    """Time the bounds on a recording made beforehand."""
    text = (files("echoset.simulate") / "scenarios" / "uwb-olos.yaml").read_text()
    params = resolve(uwb.Params, ("uwb-olos", yaml.safe_load(text)["parameters"]))
    recording = uwb.simulate(params, generator(1, "simulate", "bench"), "bench")

    def bounds() -> None:
        pcrlb.link_information.cache_clear()
        pcrlb.bounds(recording, pcrlb.Params(), "pcrlb", blocked=False)
        pcrlb_star.bounds(recording, pcrlb.Params(), "pcrlb-star", blocked=True)

    taken, unit = fastest(bounds), fastest(calibration)
    print(f"pcrlb and pcrlb-star, 180 steps, 12 links: {1e3 * taken:.0f} ms, {taken / unit:.1f} x")


if __name__ == "__main__":
    main()

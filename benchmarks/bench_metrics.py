"""Metrics on sets over long recordings: ``python benchmarks/bench_metrics.py``.

Twenty targets walk at random in a square, wide or so narrow that most are nearer to several
others than the cut-off; nine of ten are estimated, with false objects besides. Prints the
milliseconds of scoring the loaded records, the fastest of three runs, and their ratio to the
calibration kernel.
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

from functools import partial

import numpy as np
from calibration import fastest, kernel

import echoset
from echoset.models.random import generator
from echoset.models.records import Estimates, Meta, Objects, Recording, Truth

METRICS = ("ospa", "gospa", "ospa-normalised", "ospa2", "siap", "cardinality")
TARGETS, FALSE = 20, 2


def objects(position: np.ndarray, present: np.ndarray) -> Objects:
    """Points at ``position`` (n, N, 2) where ``present`` (n, N), a second apart."""
    offset = np.concatenate(([0], np.cumsum(present.sum(1))))
    time_ns = np.arange(len(present)) * 10**9
    label = np.nonzero(present)[1]
    return Objects(time_ns, offset, label, ("x", "y"), ("m", "m"), position[present])


def scene(scans: int, side: float, rng: np.random.Generator) -> tuple[Estimates, Recording]:
    """Estimates and truth."""
    start = rng.uniform(0, side, (TARGETS, 2))
    walk = np.cumsum(rng.normal(0, 1.0, (scans, TARGETS, 2)), axis=0)
    true = (start + walk) % side
    false = rng.uniform(0, side, (scans, FALSE, 2))
    estimated = np.concatenate((true + rng.normal(size=true.shape), false), axis=1)
    present = rng.random(estimated.shape[:2]) < 0.9
    meta = Meta("bench", provenance={"estimator": "bench"})
    truth = Truth(objects(true, np.ones(true.shape[:2], bool)))
    return Estimates(meta, objects(estimated, present), {}), Recording(meta, {}, {}, truth)


def main() -> None:
    """Print the table."""
    rng = generator(1, "bench", "metrics")
    unit = fastest(kernel)
    print(f"calibration kernel {1e3 * unit:.1f} ms")
    print(f"{'metric':16} {'scans':>6} {'side m':>6} {'ms':>8} {'ratio':>7}")
    for scans in (1000, 20_000):
        for side in (1000.0, 30.0):
            estimates, recording = scene(scans, side, rng)
            for name in METRICS:
                score = partial(echoset.score, estimates, recording, name)
                score()
                cost = fastest(score)
                ratio = cost / unit
                print(f"{name:16} {scans:6} {side:6.0f} {1e3 * cost:8.1f} {ratio:7.3f}")


if __name__ == "__main__":
    main()

"""Estimates and truth with all that metrics look at, at random."""

from __future__ import annotations

import numpy as np

from echoset.models.records import Estimates, Meta, Objects, Recording, Truth

SECOND = 10**9


def some(rng: np.random.Generator, times: np.ndarray, labels: int, alone: bool) -> Objects:
    """Objects with all that metrics look at, up to ``labels`` at a time."""
    count = np.ones(len(times), int) if alone else rng.integers(0, labels + 1, len(times))
    m = int(count.sum())
    picked = [np.sort(rng.permutation(labels)[:c]) for c in count]
    return Objects(
        times,
        np.concatenate(([0], np.cumsum(count))),
        np.zeros(m, np.int64) if alone else np.concatenate(picked).astype(np.int64),
        ("x", "y", "device_x", "device_y"),
        ("m",) * 4,
        rng.uniform(0, 10, (m, 4)),
        covariance=np.tile(np.eye(4), (m, 1, 1)),
        class_names=("a", "b"),
        class_index=rng.integers(0, 2, m),
        extent_kind="ellipse",
        semi_axes=rng.uniform(0.5, 2, (m, 2)),
        rotation=rng.uniform(0, 3, m),
    )


def scene(alone: bool, seed: int = 4, name: str = "r") -> tuple[Estimates, Recording]:
    """Estimates every second, and a truth at other times with a gap."""
    rng = np.random.default_rng(seed)
    times = np.arange(60, dtype=np.int64) * SECOND
    known = np.sort(rng.choice(np.arange(-3, 66), 50, replace=False)) * SECOND
    provenance = {"estimator": "e", "parameters": {"regions": {"R": [0, 5, 0, 5]}}}
    numbers = {"cardinality_mean": rng.uniform(0, 4, 60)}
    numbers |= {f"region_{k}_R": rng.uniform(0, 4, 60) for k in ("mean", "variance")}
    estimates = Estimates(Meta(name, provenance=provenance), some(rng, times, 5, alone), numbers)
    return estimates, Recording(Meta(name), {}, {}, Truth(some(rng, known, 4, alone)))

"""Fixes of several objects, each at its own times, as whole sets."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...models.records import Array, Objects

Fixes = dict[int, dict[int, tuple[float, float]]]
"""Position x, y [m] of each object, by its label, at each time [ns]."""


def align(fixes: Fixes, max_gap: float) -> Objects:
    """All objects at every time of a fix at which each of them is known.

    Between two fixes at most ``max_gap`` [s] apart an object moves on a line; it is not known
    before its first, after its last, or between two that are farther apart.
    """
    time = np.unique([t for track in fixes.values() for t in track])
    labels = sorted(fixes)
    states, known = zip(*(_at(time, fixes[label], max_gap) for label in labels), strict=True)
    kept = np.logical_and.reduce(known)
    n, count = int(kept.sum()), len(labels)
    return Objects(
        time[kept],
        np.arange(n + 1) * count,
        np.tile(np.array(labels, np.int64), n),
        ("x", "y"),
        ("m", "m"),
        np.stack(states, 1)[kept].reshape(-1, 2),
    )


def _at(
    time: Array, track: Mapping[int, tuple[float, float]], max_gap: float
) -> tuple[Array, Array]:
    """Positions (n, 2) of one object at ``time`` (n,), and whether they are known (n,)."""
    t = np.array(sorted(track), np.int64)
    p = np.array([track[key] for key in t.tolist()])
    after = np.searchsorted(t, time).clip(max=len(t) - 1)
    before = np.where(t[after] == time, after, np.maximum(after - 1, 0))
    gap = t[after] - t[before]
    known = (t[before] <= time) & (time <= t[after]) & (gap <= max_gap * 1e9)
    w = (time - t[before]) / np.maximum(gap, 1)
    with np.errstate(over="ignore", invalid="ignore"):
        return p[before] + w[:, None] * (p[after] - p[before]), known

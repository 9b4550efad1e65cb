"""The estimates of all times from one trajectory, or from several that may be right."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ....models.records import Array, Estimates, Meta, Objects
from .solution import Solution


def shown(
    solutions: Sequence[Solution], weights: Array, found: dict[str, Any]
) -> Iterator[Estimates]:
    """The estimates of each time: mean and covariance of the mixture of ``solutions`` (k).

    What is wrong with ranges is that of the most probable; offsets are averaged over the anchors.
    """
    best = solutions[int(np.argmax(weights))]
    names, units, G = _rows(best)
    L, both = best.problem.layout, [k for k in (0, 1, 2, 3, best.problem.layout.heading) if k >= 0]
    covariances = [one.problem.covariance(one.x) for one in solutions]
    x, P = best.x.copy(), covariances[int(np.argmax(weights))].copy()
    states = np.array([one.x[:, both] for one in solutions])
    mean = np.tensordot(weights, states, 1)
    apart = states - mean
    spread = np.einsum("k,kni,knj->nij", weights, apart, apart)
    own = np.array([C[:, both][:, :, both] for C in covariances])
    rows = np.array(both)
    x[:, rows] = mean
    P[:, rows[:, None], rows] = np.tensordot(weights, own, 1) + spread
    state, C = x @ G.T, G @ _regular(P) @ G.T
    if L.heading >= 0:
        state[:, 4] = np.angle(np.exp(1j * state[:, 4]))
    if "range_bias" in names:
        state[:, names.index("range_bias")] += best.problem.params.range_bias
    about = Meta("", provenance={"found": found} if found else {})
    steps = {"cardinality_mean": np.ones(1), "cardinality_variance": np.zeros(1)}
    for k, t in enumerate(best.problem.data.time_ns.tolist()):
        objects = Objects(
            np.array([t], np.int64),
            np.array([0, 1], np.int64),
            np.zeros(1, np.int64),
            names,
            units,
            state[k : k + 1],
            covariance=(C[k : k + 1] + C[k : k + 1].swapaxes(1, 2)) / 2,
            existence=np.ones(1),
        )
        yield Estimates(about, objects, steps)


def _rows(best: Solution) -> tuple[tuple[str, ...], tuple[str, ...], Array]:
    """Names, units and rows (k, d) of what is shown."""
    L = best.problem.layout
    names, units, rows = ["x", "y", "vx", "vy"], ["m", "m", "m s-1", "m s-1"], [*np.eye(L.size)[:4]]
    more = (("heading", "rad", L.heading), ("height", "m", L.height), ("range_scale", "1", L.scale))
    for name, unit, k in more:
        if k >= 0:
            names, units, rows = [*names, name], [*units, unit], [*rows, np.eye(L.size)[k]]
    if L.bias >= 0:
        mean = np.zeros(L.size)
        mean[L.biases] = 1 / best.problem.data.anchors
        names, units, rows = [*names, "range_bias"], [*units, "m"], [*rows, mean]
    if not best.problem.data.offset.any():
        names, units = [*names, "device_x", "device_y"], [*units, "m", "m"]
        rows += rows[:2]
    return tuple(names), tuple(units), np.array(rows)


def _regular(P: Array) -> Array:
    """Covariances in which no correlation exceeds one, after blocks of them have changed."""
    low = np.linalg.eigvalsh(P)[:, 0]
    if (low >= 0).all():
        return P
    value, vector = np.linalg.eigh(P)
    return np.asarray((vector * value.clip(0)[:, None]) @ vector.swapaxes(1, 2))

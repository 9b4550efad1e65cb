"""Centres and extents as estimates, with labels that persist."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment

from ...models.geometry import extent
from ...models.records import Array, Objects
from .plane import columns


class Labels:
    """Gives targets that stay where they were the label that they had."""

    def __init__(self) -> None:
        self._c, self._label = np.zeros((0, 3)), np.zeros(0, np.int64)
        self._next = 0

    def of(self, c: Array, reach: float) -> Array:
        """Labels (L,) of the centres c (L, 3); within ``reach`` [m] of a former one its own."""
        distance = np.linalg.norm(c[:, None] - self._c, axis=-1)
        i, j = linear_sum_assignment(np.minimum(distance, 2 * reach))
        near = distance[i, j] < reach
        label = np.full(len(c), -1, np.int64)
        label[i[near]] = self._label[j[near]]
        new = np.flatnonzero(label < 0)
        label[new] = self._next + np.arange(len(new))
        self._next += len(new)
        self._c, self._label = c, label
        return label


def objects(time_ns: int, x: Array, label: Array, d: int, P: Array | None = None) -> Objects:
    """Targets x (L, 9), centres and extents, at one time; ``P`` is their covariance."""
    order = np.argsort(label)
    at = columns(d)
    state = x[order][:, at]
    kind, axes, rotation = extent.ellipsoid(extent.covariance(state[:, d:]))
    return Objects(
        np.array([time_ns], np.int64),
        np.array([0, len(state)], np.int64),
        label[order],
        (*"xyz"[:d], *extent.names(d)),
        ("m",) * len(at),
        state,
        covariance=None if P is None else P[order][:, at][:, :, at],
        extent_kind=kind,
        semi_axes=axes,
        rotation=rotation,
    )

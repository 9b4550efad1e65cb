"""OSPA distance between sets of extended objects, based on the Gaussian-Wasserstein distance.

An object is the Gaussian of its centre and of the covariance S whose ellipsoid of one standard
deviation is its extent. With the distance d of two of them (Yang, Baum and Granstrom, Metrics for
performance evaluation of elliptic extended object tracking methods, 2016)::

    d^2 = |m_X - m_Y|^2 + tr(S_X + S_Y - 2 (S_Y^1/2 S_X S_Y^1/2)^1/2)

OSPA (see :mod:`.ospa`) is over optimal assignments. The parts ``centre`` and ``extent`` are the
roots of the mean squares of both terms over the pairs assigned, zero where there is none.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...models.errors import InputError
from ...models.geometry.extent import from_axes, squared_wasserstein
from ...models.records import Array, Objects
from ..kit.assignment import assign, ospa_parts
from ..kit.distance import distance
from ..kit.sets import AlignedSets

SUMMARY = "OSPA distance of extended objects, with the Gaussian-Wasserstein distance, and its parts"
PARTS = ("localisation", "cardinality", "centre", "extent")


def _covariances(objects: Objects) -> Array:
    """Covariances (m, d, d) [m2] with the semi-axes of ``objects`` as standard deviations.

    Raises
    ------
    InputError : they have no extent
    """
    if objects.semi_axes is None or objects.rotation is None:
        raise InputError("truth or estimates have no extent")
    return from_axes(objects.semi_axes, objects.rotation)


def ospa_gw(aligned: AlignedSets, order: float, cutoff: float) -> dict[str, Array]:
    """The distance (n,) [m] at each step, called ``""``, and its parts by name."""
    pairs = aligned.near(cutoff)
    truth, estimate = _covariances(aligned.truth), _covariances(aligned.estimate)
    if truth.shape[1] != estimate.shape[1]:
        raise InputError("the extents of truth and estimates have different dimensions")
    extent2 = squared_wasserstein(truth[pairs.first], estimate[pairs.second])
    whole = np.sqrt(pairs.distance**2 + extent2)
    chosen = assign(replace(pairs, distance=whole), cutoff**order - whole**order)

    def per_step(value: Array) -> Array:
        """Sums (n,) over the pairs that are assigned."""
        return np.bincount(pairs.step[chosen], value[chosen], len(aligned))

    count = per_step(np.ones(len(whole)))
    values = ospa_parts(per_step(whole**order), count, aligned.counts, order, cutoff)
    for part, square in (("centre", pairs.distance**2), ("extent", extent2)):
        values[part] = np.sqrt(per_step(square) / np.maximum(count, 1))
    return values


METRIC = distance("ospa-gw", SUMMARY, PARTS, ospa_gw)

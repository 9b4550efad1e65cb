"""OSPA distance between sets of extended objects, based on the Gaussian-Wasserstein distance.

An object is the Gaussian of its centre and of the covariance S whose ellipsoid of one standard
deviation is its extent. With the distance d of two of them (Yang, Baum and Granstrom, Metrics for
performance evaluation of elliptic extended object tracking methods, 2016)::

    d^2 = |m_X - m_Y|^2 + tr(S_X + S_Y - 2 (S_Y^1/2 S_X S_Y^1/2)^1/2)

OSPA (see :mod:`.ospa`) is over optimal assignments. The parts ``centre`` and ``extent`` are the
roots of the mean squares of both terms over the pairs assigned, zero where there is none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from ..models.errors import InputError
from ..models.records import Objects, Scores
from .kit.assignment import Near, assign
from .kit.measured import Measured, Names, of_sets, scorer
from .kit.series import Distance, parts
from .kit.sets import Sets

SUMMARY = "OSPA distance of extended objects, with the Gaussian-Wasserstein distance, and its parts"
PARTS = ("localisation", "cardinality", "centre", "extent")
STREAMS = ()
FOR_SETS = True
QUADRATIC = ()
Array = np.ndarray[Any, Any]


@dataclass(frozen=True, slots=True)
class Params(Distance):
    """Which steps are scored, with which order and cut-off."""


def covariance(objects: Objects) -> Array:
    """Covariances (m, d, d) [m2] with the semi-axes of ``objects`` as standard deviations.

    Raises
    ------
    InputError : they have no extent
    """
    if objects.semi_axes is None or objects.rotation is None:
        raise InputError("truth or estimates have no extent")
    axes, rotation = objects.semi_axes, objects.rotation
    if rotation.ndim == 2:
        R = Rotation.from_quat(rotation).as_matrix() if len(rotation) else np.zeros((0, 3, 3))
    else:
        c, s = np.cos(rotation), np.sin(rotation)
        R = np.stack([np.stack([c, -s], -1), np.stack([s, c], -1)], -2)
    return np.asarray(R * axes[:, None] ** 2 @ R.swapaxes(-1, -2))


def squared_wasserstein(A: Array, B: Array) -> Array:
    """tr(A + B - 2 (A^1/2 B A^1/2)^1/2) (m,) [m2] of covariances (m, d, d)."""
    w, U = np.linalg.eigh(A)
    root = U * np.sqrt(w.clip(min=0))[:, None] @ U.swapaxes(-1, -2)
    cross = np.sqrt(np.linalg.eigvalsh(root @ B @ root).clip(min=0)).sum(-1)
    return np.asarray((np.trace(A + B, axis1=-2, axis2=-1) - 2 * cross).clip(min=0))


def ospa_gw(aligned: Sets, order: float, cutoff: float) -> dict[str, Array]:
    """The distance (n,) [m] at each step, called ``""``, and its parts by name."""
    pairs = aligned.near(cutoff)
    truth, estimate = covariance(aligned.truth), covariance(aligned.estimate)
    if truth.shape[1] != estimate.shape[1]:
        raise InputError("the extents of truth and estimates have different dimensions")
    extent2 = squared_wasserstein(truth[pairs.first], estimate[pairs.second])
    whole = np.sqrt(pairs.distance**2 + extent2)
    centre2, near = pairs.distance**2, replace(pairs, distance=whole)
    m, n = np.sort(aligned.counts, axis=0)
    size = np.maximum(n, 1)
    chosen = assign(near, cutoff**order - whole**order)
    count = _per_step(near, chosen, np.ones(len(whole)), len(aligned))
    power = _per_step(near, chosen, whole**order, len(aligned))
    localisation = (power + cutoff**order * (m - count)) / size
    cardinality = cutoff**order * (n - m) / size
    powers = (localisation + cardinality, localisation, cardinality)
    values = {k: v ** (1 / order) for k, v in zip(("", *PARTS), powers, strict=False)}
    for part, square in (("centre", centre2), ("extent", extent2)):
        mean = _per_step(near, chosen, square, len(aligned)) / np.maximum(count, 1)
        values[part] = np.sqrt(mean)
    return values


def _per_step(pairs: Near, chosen: Array, value: Array, steps: int) -> Array:
    """Sums (steps,) over the pairs ``chosen`` at each step."""
    return np.bincount(pairs.step[chosen], value[chosen], steps)


def summarise(names: Names, measured: Measured, params: Params) -> Scores:
    """The distance [m] and its parts per step, their means, and the number of steps left out."""
    return parts((*names, "ospa-gw"), measured, measured.values, params.block)


measure = of_sets(lambda aligned, params: ospa_gw(aligned, params.order, params.cutoff))
score = scorer(measure, summarise)

"""Log-likelihood of the ranges of UWB links, for many particles.

A link's ranges are a Poisson process: clutter, the line of sight (active links) and scattered
paths, so ``log L = sum over ranges of log(clutter + los f_LOS + scatter f_scat)`` up to a constant,
eq. (11) of Zhu et al. and its active twin. ``geo`` and ``ideal`` differ in f_scat; ``point`` is
the classic sum of probabilistic data association over at most one range of the object a link.

All take the same first arguments: ``centre`` (2, N), ``device`` (2, N) and ``height`` (N,) [m] of
both, ``anchors`` (J, 3) [m] and the links: ``tx`` (L,) with J for the device, ``rx`` (L,),
``offset`` (L + 1,) into ``z`` (M,) [m] and ``variance`` (M,) [m^2]; what the ranges of a link have
too much, mean ``shift`` [m] and variance ``doubt`` [m^2], both (L, N), or (0, 0) for nothing; then
``clutter`` [1/m], the density of false ranges. They return (N,).

A Gaussian is zero beyond eight standard deviations.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ....models.records import Array
from ....models.scatter import path_moments, scatter_ellipse, sector
from ....models.uwb import at_height, distance, scatter_distance


def geo(
    centre: Array,
    device: Array,
    height: Array,
    anchors: Array,
    tx: Array,
    rx: Array,
    offset: Array,
    z: Array,
    variance: Array,
    shift: Array,
    doubt: Array,
    clutter: float,
    los: float,
    scatter: float,
    radius: Array,
    width: Array,
    opening: float,
    transform: bool,
) -> Array:
    """One Gaussian of the scatter ellipse, eq. (8): ``radius`` (N,), ``width`` (N,) [m].

    ``los`` and ``scatter`` are mean numbers of ranges a link, ``opening`` [rad]; the mean is that
    of the unscented ``transform``, or else the path over the ellipse's centre.
    """
    log_l = np.zeros(centre.shape[1])
    for e, (t, a) in enumerate(_ends(device, height, anchors, tx, rx)):
        zl, v = _rows(e, offset, z, shift, variance, doubt)
        middle, root = scatter_ellipse(centre.T, a, radius, width, opening)
        upright = np.concatenate((root, np.zeros_like(root[..., :1, :])), axis=-2)
        h, mean, spread = path_moments(t, a, at_height(middle, height), upright)
        f = clutter + scatter * _normal(zl - (mean if transform else h), v + spread)
        if tx[e] == len(anchors):
            f += los * _normal(zl - distance(t, a), v)
        log_l += np.log(f).sum(0)
    return log_l


def ideal(
    centre: Array,
    device: Array,
    height: Array,
    anchors: Array,
    tx: Array,
    rx: Array,
    offset: Array,
    z: Array,
    variance: Array,
    shift: Array,
    doubt: Array,
    clutter: float,
    los: float,
    scatter: float,
    semi_axes: Array,
    width: Array,
    opening: float,
    u: Array,
    s: Array,
) -> Array:
    """Average of Gaussians over scatterers of the sector, eq. (12).

    ``semi_axes`` (2, N), ``width`` (N,) [m]; ``u`` (I',), ``s`` (I',) are points of the unit
    square (see :func:`echoset.models.scatter.sector`).
    """
    log_l = np.zeros(centre.shape[1])
    for e, (t, a) in enumerate(_ends(device, height, anchors, tx, rx)):
        zl, v = _rows(e, offset, z, shift, variance, doubt)
        q = sector(u[:, None], s[:, None], centre.T, a, semi_axes.T, width, opening)
        h = scatter_distance(t, at_height(q, height), a)
        f = clutter + scatter * _normal(zl[:, None] - h, v[:, None]).mean(1)
        if tx[e] == len(anchors):
            f += los * _normal(zl - distance(t, a), v)
        log_l += np.log(f).sum(0)
    return log_l


def point(
    centre: Array,
    device: Array,
    height: Array,
    anchors: Array,
    tx: Array,
    rx: Array,
    offset: Array,
    z: Array,
    variance: Array,
    shift: Array,
    doubt: Array,
    clutter: float,
    p_detect: float,
) -> Array:
    """At most one range a link, detected with ``p_detect``: direct, or scattered at the centre."""
    log_l = np.zeros(centre.shape[1])
    for e, (t, a) in enumerate(_ends(device, height, anchors, tx, rx)):
        zl, v = _rows(e, offset, z, shift, variance, doubt)
        active = tx[e] == len(anchors)
        h = distance(t, a) if active else scatter_distance(t, at_height(centre.T, height), a)
        log_l += np.log((1 - p_detect) + p_detect / clutter * _normal(zl - h, v).sum(0))
    return log_l


def _ends(
    device: Array, height: Array, anchors: Array, tx: Array, rx: Array
) -> list[tuple[Array, Array]]:
    """Positions of transmitter and receiver of each link."""
    J, m = len(anchors), at_height(device.T, height)
    return [(m if i == J else anchors[i], anchors[j]) for i, j in zip(tx, rx, strict=True)]


def _rows(
    e: int, offset: Array, z: Array, shift: Array, variance: Array, doubt: Array
) -> tuple[Array, Array]:
    """Ranges and variances, both (M_l, N) or (M_l, 1), of link ``e``, the shift taken off."""
    rows = slice(offset[e], offset[e + 1])
    if not len(shift):
        return z[rows, None], variance[rows, None]
    return z[rows, None] - shift[e], variance[rows, None] + doubt[e]


def _normal(d: Any, variance: Any) -> Array:
    exponent = d**2 / (2 * variance)
    f: Array = np.exp(-exponent) * (exponent < 32) / np.sqrt(2 * np.pi * variance)
    return f

"""Posterior Cramér-Rao bound of a device alone: its ranges, and differences of two.

The state is x y vx vy. A link has a direct range or difference of known noise among false ones, a
Poisson process (:mod:`.information`); differences that one anchor is taken off share its noise, so
that their information is that of their joint Gaussian. Offsets are taken for known.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Any

import numpy as np

from ...models.columns import ACTIVE, TDOA
from ...models.errors import InputError
from ...models.geometry.poses import pose_at
from ...models.motion import constant_velocity, motion_noise
from ...models.records import Array, Recording, Stream
from ...models.uwb import Region, free_space_amplitude, range_std
from .information import covariance_bounds, information


@dataclass(frozen=True, slots=True, eq=False)
class Links:
    """Direct links of one time: anchors ``place`` (L, 3) [m], of differences ``other`` (L, 3) that
    is taken off, else NaN, and which ``reference`` (L,) it is, else -1; ``std`` (L,) [m]."""

    place: Array
    other: Array
    reference: Array
    std: Array


def links(recording: Recording, stream: Stream, steps: Array, params: Any) -> Iterator[Links]:
    """The links of each of the times ``steps`` (n,), those of one device.

    Raises
    ------
    InputError : nothing tells the noise of ranges
    """
    scan, rows = stream.scan, stream.rows
    count = np.diff(stream.row_offset)
    std = np.full(len(stream), np.nan)
    if "std" in rows:
        some = count > 0
        std[some] = rows["std"][stream.row_offset[:-1][some]]
        std[~some] = np.nanmedian(std) if some.any() else np.nan
    elif params.sigma is not None:
        std[:] = params.sigma
    at = np.searchsorted(steps, stream.time_ns).clip(max=len(steps) - 1)
    direct = (scan["mode"] == ACTIVE) | (scan["mode"] == TDOA)
    direct &= steps[at] == stream.time_ns
    events = np.flatnonzero(direct).tolist()
    rows_of = {int(k): list(group) for k, group in groupby(events, lambda i: at[i])}
    reference = scan.get("reference", np.full(len(stream), -1))
    for k, time in enumerate(steps.tolist()):
        own = np.array(rows_of.get(k, []), np.int64)
        places = {
            node: pose_at(recording.sensors[stream.nodes[node]], time)[0]
            for node in {*scan["rx"][own].tolist(), *reference[own].tolist()} - {-1}
        }
        nowhere = np.full(3, np.nan)
        yield Links(
            np.array([places[i] for i in scan["rx"][own].tolist()]).reshape(-1, 3),
            np.array([places.get(i, nowhere) for i in reference[own].tolist()]).reshape(-1, 3),
            reference[own],
            std[own],
        )


def direct_information(p: Array, own: Links, params: Any) -> Array:
    """Fisher information (2, 2) of the links of one time about the position ``p`` (2,)."""
    at = np.array([*p, params.device_height])
    H, length = _gradient(at, own.place)
    two = own.reference >= 0
    off, _ = _gradient(at, own.other)
    H[two] -= off[two]
    std = np.where(
        np.isnan(own.std),
        range_std(free_space_amplitude(length, params.snr_db), params.rms_bandwidth),
        own.std,
    )
    J = np.zeros((2, 2))
    for reference in np.unique(own.reference).tolist():
        k = np.flatnonzero(own.reference == reference)
        c = params.tdoa_correlation if reference >= 0 else 0.0
        C = np.where(np.eye(len(k)) == 1, 1.0, c) * np.outer(std[k], std[k])
        # what false ones among them leave of the information of each
        left = np.sqrt([kept(s, params) for s in std[k].tolist()])
        J += (H[k].T * left) @ np.linalg.solve(C, left[:, None] * H[k])
    return J


def kept(std: float, params: Any) -> float:
    """The share of its information that a direct range keeps among false ones."""
    background = params.mean_clutter / params.max_range
    one, weight = np.array([0.0]), np.array([params.mean_los])
    J = information(one, np.array([std]), weight, np.ones((1, 1)), background)
    return float(J[0, 0] * std**2)


def bound(
    recording: Recording,
    stream: Stream,
    steps: Array,
    p: Array,
    params: Any,
    recursion: Callable[[Array, Array, Array, Array], Array] = covariance_bounds,
) -> Array:
    """Covariances (n, 4, 4) that no estimate at ``steps`` (n,) undercuts, at positions (n, 2).

    Raises
    ------
    InputError : there is no anchor
    """
    J = np.zeros((len(steps), 4, 4))
    corners = []
    for k, own in enumerate(links(recording, stream, steps, params)):
        J[k, :2, :2] = direct_information(p[k], own, params)
        corners.append(own.place[:, :2])
    anchors = np.unique(np.concatenate(corners), axis=0)
    if not len(anchors):
        raise InputError(f"{recording.meta.name}: no link of a device to an anchor")
    P = np.zeros((4, 4))
    P[:2, :2] = Region(anchors, params.max_range).covariance()
    P[2:, 2:] = params.speed_std**2 * np.eye(2)
    dt = np.diff(steps, prepend=steps[:1]) / 1e9
    F = np.array([constant_velocity(t)[0] for t in dt.tolist()])
    Q = np.array([motion_noise(params.acceleration_std, t) for t in dt.tolist()])
    return recursion(P, F, Q, J)


def _gradient(p: Array, place: Array) -> tuple[Array, Array]:
    """Gradients (L, 2) of the distances of a point (3,) to places (L, 3), and these (L,)."""
    away = p - place
    d = np.linalg.norm(away, axis=1)
    return away[:, :2] / d[:, None], d

"""How the sensor of one scan of point detections sees: as tables over the region.

A sensor is known by its detection probability and its error covariance as functions of position:
tables that the recording states for every scan (``p_detect_table``, ``cov_xx_table``, ... on the
nodes ``grid_origin + i grid_spacing``), or else what the parameters or the rows say, tabulated
here. Problems in the plane are laid into space, see :mod:`.plane`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import TypeVar

import numpy as np

from ...models.errors import InputError
from ...models.geometry.grids import Grid
from ...models.geometry.poses import pose_at
from ...models.parameters import Layer, is_preset, listed, resolved_by_stream
from ...models.radar.detection import View, polar
from ...models.radar.ofdm import MOUNTING
from ...models.records import Array, Recording, Scan, Stream
from . import plane
from .params import SceneParams

STREAMS = SceneParams.STREAMS
OF_ONE = (
    "p_detect", "resolution", "std_position", "std_range", "std_azimuth", "std_elevation",
    "max_range",
)  # fmt: skip
"""Parameters that may differ from stream to stream."""
P = TypeVar("P", bound=SceneParams)
UPPER = np.triu_indices(3)
"""Rows and columns of xx xy xz yy yz zz."""
_TABLES = ("p_detect_table", *(f"cov_{'xyz'[i]}{'xyz'[j]}_table" for i, j in np.transpose(UPPER)))
_ROWS = {"position": ("x", "y", "z"), "range_bearing": ("range", "azimuth", "elevation")}


@dataclass(frozen=True, slots=True, eq=False)
class SensorState:
    """One scan: detections z (m, 3) along x in the map frame, and how its sensor sees.

    ``order`` (m,) are the rows of the scan in that order. ``table`` (nx, ny, nz, 7), ``position``
    (3,), ``frame`` (3, 3) and ``cell`` (5,) are those of :class:`.kernels.posterior.Scene`.
    """

    z: Array
    order: Array
    table: Array
    position: Array
    frame: Array
    cell: Array


def resolved(cls: type[P], setup: Recording, stated: Sequence[Layer], layers: Sequence[Layer]) -> P:
    """The parameters of a recording, see :func:`echoset.models.parameters.resolved_by_stream`.

    Raises
    ------
    ParameterError : ``sensors`` names no stream, or what does not hold for single streams
    InputError : streams state different regions, and nobody says which
    """
    said = any("clutter_region" in x for source, x in layers if not is_preset(source))
    regions = {str(x["clutter_region"]) for _, x in stated if "clutter_region" in x}
    if len(regions) > 1 and not said:
        raise InputError(f"the streams state the regions {listed(sorted(regions))}: give one")
    groups = {name: [name] for name in sorted(setup.streams)}
    return resolved_by_stream(cls, OF_ONE, groups, stated, layers)


def sensor_state(
    params: SceneParams, setup: Recording, scan: Scan, number: int, grid: Grid
) -> SensorState:
    """The scan, which is the ``number``-th of its stream.

    Raises
    ------
    InputError : noise or detection probability are not known, or a covariance is not positive
    """
    stream, d = setup.streams[scan.stream], params.dimension
    position, rotation = pose_at(setup.sensors[stream.nodes[0]], scan.time_ns)
    if d == 2:
        position = position * (1, 1, 0)
    local = np.zeros((len(next(iter(scan.rows.values()))), 3))
    for i, key in enumerate(_ROWS[stream.kind][:d]):
        if key not in scan.rows:
            raise InputError(f"streams/{scan.stream}: three dimensions need the column {key!r}")
        local[:, i] = scan.rows[key]
    if stream.kind == "range_bearing":
        local = _cartesian(local)
    z = position + local @ rotation.T
    if "p_detect_table" in stream.model:
        table = _stated(stream, scan.stream, number, grid)
    else:
        table = _assumed(params, stream, scan, position, rotation, grid)
    _check(table, scan.stream, number)
    if d == 2:
        table = plane.sensed(table)
    keys = ("bandwidth", "side", "azimuth_factor", "elevation_factor", "max_resolution")
    known = all(k in stream.model for k in keys) and d == 3
    cell = [stream.model[k] for k in keys] if known else [0.0, 0.0, 0.0, 0.0, params.resolution]
    order = np.argsort(z[:, 0], kind="stable")
    frame = MOUNTING @ rotation.T
    return SensorState(z[order], order, table, position, frame, np.array(cell, float))


def _stated(stream: Stream, name: str, number: int, nodes: Grid) -> Array:
    """The table (nx, ny, nz, 7) of a scan that the recording states."""
    for key in _TABLES:
        shape = np.shape(stream.model.get(key, 0))
        if shape[:1] <= (number,) or shape[1:] != nodes.shape:
            raise InputError(f"streams/{name}: the model has no {key} for scan {number}")
    return np.stack([stream.model[key][number] for key in _TABLES], -1)


def _assumed(
    params: SceneParams, stream: Stream, scan: Scan, position: Array, rotation: Array, grid: Grid
) -> Array:
    """The table (nx, ny, nz, 7) that the parameters and the rows' noise amount to."""
    if params.p_detect is None:
        raise InputError("the detection probability is not known: give p_detect")
    local = (grid.nodes() - position) @ rotation
    view = View.of(scan.scan, params.max_range or inf)
    table = np.zeros((*grid.shape, 7))
    table[..., 0] = params.p_detect * view.contains(*polar(local[..., :2]))
    d, rows = params.dimension, scan.rows
    if stream.kind == "position":
        C = np.eye(3)
        axes = "xyz"[:d]
        if "cov_xx" in rows and len(rows["cov_xx"]):
            for i, a in enumerate(axes):
                for j, b in enumerate(axes[i:], i):
                    C[i, j] = C[j, i] = rows[f"cov_{a}{b}"].mean()
        else:
            C *= _known("std_position", params.std_position) ** 2
        S = np.broadcast_to(rotation @ C @ rotation.T, (*grid.shape, 3, 3))
    else:
        names = ("std_range", "std_azimuth", "std_elevation")[:d]
        std = np.array([_noise(params, rows, n) for n in names] + [0.0] * (3 - d))
        J = rotation @ _jacobian(local)
        S = J * std**2 @ J.swapaxes(-1, -2)
    table[..., 1:] = S[..., *UPPER]
    return table


def _noise(params: SceneParams, rows: Mapping[str, Array], name: str) -> float:
    if len(rows.get(name, ())):
        return float(np.sqrt((rows[name] ** 2).mean()))
    return _known(name, getattr(params, name))


def _known(name: str, value: float) -> float:
    if value <= 0:
        raise InputError(f"the noise of the detections is not known: give {name}")
    return value


def _cartesian(z: Array) -> Array:
    r, azimuth, elevation = z.T
    flat = r * np.cos(elevation)
    return np.stack((flat * np.cos(azimuth), flat * np.sin(azimuth), r * np.sin(elevation)), -1)


def _jacobian(x: Array) -> Array:
    """Derivatives (..., 3, 3) of positions x (..., 3) by range, azimuth and elevation."""
    flat = np.maximum(np.hypot(x[..., 0], x[..., 1]), 1e-9)
    r = np.maximum(np.linalg.norm(x, axis=-1), 1e-9)
    a = np.stack((-x[..., 1], x[..., 0], np.zeros_like(r)), -1)
    e = np.stack((-x[..., 0] * x[..., 2] / flat, -x[..., 1] * x[..., 2] / flat, flat), -1)
    return np.stack((x / r[..., None], a, e), -1)


def noise(tables: Iterable[Array], nodes: Grid, points: Iterable[Array]) -> Array:
    """Error covariances (m, 3, 3) [m2] of ``points`` (m_k, 3) by the table of each sensor state.

    Beyond the tables those of the nearest place in them.
    """
    last = nodes.origin + nodes.spacing * (np.array(nodes.shape) - 1)
    parts = [np.zeros((0, 6))]
    for table, at in zip(tables, points, strict=True):
        inside = np.clip(at, nodes.origin, np.maximum(last, nodes.origin))
        parts.append(nodes.interpolate(table, inside, np.zeros(7))[:, 1:])
    S = np.zeros((sum(map(len, parts)), 3, 3))
    S[..., *UPPER] = S[..., *UPPER[::-1]] = np.concatenate(parts)
    return S


def _check(table: Array, stream: str, number: int) -> None:
    S = np.zeros((*table.shape[:-1], 3, 3))
    S[..., *UPPER] = S[..., *UPPER[::-1]] = table[..., 1:]
    w = np.linalg.eigvalsh(S)
    if (w[..., 0] < -1e-9 * w[..., 2]).any():
        raise InputError(
            f"streams/{stream}: the covariance of scan {number} is not positive definite: "
            f"it has the eigenvalue {w.min():.3g} m2"
        )

"""Scans of point detections as the scene that a jump chain looks at."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter

from ...models.errors import InputError
from ...models.geometry.grids import Grid
from ...models.parameters import per_stream
from ...models.records import Array, Recording, Scan
from . import plane
from .kernels.posterior import Scene, inside
from .params import SceneParams
from .sensors import SensorState, sensor_state


def grid(params: SceneParams, setup: Recording) -> Grid:
    """The grid of the recording's tables, or one that fills the region.

    Raises
    ------
    InputError : the region is not known, or the tables of two streams have different nodes
    """
    if not params.clutter_region:
        raise InputError("where targets and clutter are is not known: give clutter_region")
    found: Grid | None = None
    for name, stream in setup.streams.items():
        m = stream.model
        if "p_detect_table" not in m:
            continue
        shape = np.shape(m["p_detect_table"])[1:]
        own = Grid(np.asarray(m["grid_origin"]), np.asarray(m["grid_spacing"]), shape)
        if len(shape) != 3 or params.dimension != 3:
            raise InputError(f"streams/{name}: tables are for three dimensions")
        if found and not (_same(found.origin, own.origin) and _same(found.spacing, own.spacing)
                          and found.shape == own.shape):  # fmt: skip
            raise InputError(f"streams/{name}: its tables have other nodes than the others'")
        found = own
    if found is not None:
        return found
    lower, upper = params.box
    if params.dimension == 3:
        return Grid.around(lower, upper, params.cell)
    return plane.grid(Grid.around(lower[:2], upper[:2], params.cell))


def _same(a: Array, b: Array) -> bool:
    return bool(np.array_equal(a, b))


def epochs(
    params: SceneParams, setup: Recording, scans: Iterable[Scan], nodes: Grid
) -> Iterator[tuple[int, list[SensorState]]]:
    """The time [ns] of each epoch and the sensor states in it."""
    number, own = dict.fromkeys(setup.streams, 0), per_stream(params, list(setup.streams))
    afford(params, nodes, 1)
    for time_ns, group in groupby(scans, key=lambda scan: scan.time_ns):
        states = []
        for scan in group:
            one = own[scan.stream]
            states.append(sensor_state(one, setup, scan, number[scan.stream], nodes))
            number[scan.stream] += 1
        yield time_ns, states


def afford(params: SceneParams, nodes: Grid, tables: int) -> None:
    """Refuse more tables than there may be, kept twice, beside what one takes while it is made.

    Raises
    ------
    InputError : they need more than the memory
    """
    need = float(np.prod(nodes.shape)) * (2 * 7 * tables + 30) * 8e-9
    if need > params.memory:
        raise InputError(
            f"{tables} tables of {' by '.join(map(str, nodes.shape))} nodes need {need:.2g} GB, "
            f"memory is {params.memory:g}: raise it, or cell"
        )


def scene(params: SceneParams, states: Iterable[SensorState], grid: Grid, **births: Any) -> Scene:
    """All sensor states together; ``births`` are ``spread``, ``uniform`` and ``informed``.

    Raises
    ------
    InputError : more detections than the memory holds
    """
    states = list(states)
    count = [len(s.z) for s in states]
    need = sum(count) * (params.places(sum(count)) + 16) * 8e-9
    if need > params.memory:
        raise InputError(
            f"{sum(count)} detections need {need:.2g} GB, memory is {params.memory:g}: raise it, "
            "or lower max_targets"
        )
    afford(params, grid, len(states))
    z = np.concatenate([s.z for s in states])
    lower, upper = params.box
    outside = np.array([params.p_false, *np.eye(3)[np.triu_indices(3)] * params.outside_variance])
    if params.dimension == 2:
        outside = plane.sensed(outside)
    return Scene(
        np.ascontiguousarray(z.T),
        np.concatenate([[0], np.cumsum(count)]).astype(np.int64),
        np.array([s.table for s in states]),
        np.asarray(grid.origin, float),
        np.asarray(grid.spacing, float),
        outside,
        np.array([s.position for s in states]),
        np.array([s.frame for s in states]),
        np.array([s.cell for s in states]),
        lower,
        upper,
        *params.extent_box,
        float(params.hard_core_radius),
        float(params.p_false),
        float(params.gate),
        np.where(inside(z, lower, upper), 1.0, params.clutter_beyond),
        crowding(z, lower, upper, births["spread"]),
        float(births["spread"]),
        float(births["uniform"]),
        bool(births["informed"]),
    )


def crowding(z: Array, lower: Array, upper: Array, width: float) -> Array:
    """Smoothed number (M,) of detections in the cells, ``width`` wide, of the detections."""
    count = np.clip(np.ceil((upper - lower) / width).astype(int), 1, 128)
    size = np.where(upper > lower, upper - lower, 1.0)
    cell = np.clip(((z - lower) / size * count).astype(int), 0, count - 1)
    hits = np.zeros(count)
    np.add.at(hits, tuple(cell.T), 1.0)
    return np.asarray(gaussian_filter(hits, 1.0, mode="constant")[tuple(cell.T)])

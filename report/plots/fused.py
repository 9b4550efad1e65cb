"""The maps of all stations summed on the plane, in decibels over the noise.

For the eye: on as many cells as a picture shows, power is interpolated bilinearly in range and
azimuth and summed; cells that no station sees stay empty.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from ...models.geometry.poses import pose_at
from ...models.records import Array, Recording, Stream
from . import places
from .clock import moment
from .protocol import Inputs, Selection
from .range_angle import FLOOR, RING, decibels, grid, last_maps, true_centres
from .style import LABEL, SURFACE, VERMILION

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUMMARY = "range-angle maps of all stations, summed on the plane"
NEEDS: tuple[str, ...] = ("recording",)
USES: tuple[str, ...] = ("estimates",)
SIZE = (12.0, 8.8)
CELLS = 400
"""Cells along the longer side."""


def draw(figure: Figure, inputs: Inputs, selection: Selection) -> None:
    """The last scans of the span; true centres as white rings, estimates as crosses.

    Raises
    ------
    InputError : no maps
    """
    recording = inputs.recording
    found = last_maps(recording, selection, "fused")
    now = max(int(stream.time_ns[k]) for _, stream, k in found)
    truth = true_centres(recording, now)
    x, y = _area(recording, found, truth)
    power = fuse(recording, found, x, y)
    figure.set_layout_engine("compressed")
    axes = figure.subplots()
    with np.errstate(invalid="ignore"):
        shown = np.where(np.isnan(power), np.nan, decibels(power))
    image = axes.pcolormesh(
        x, y, shown, cmap=SURFACE, vmin=FLOOR, shading="nearest", rasterized=True
    )
    axes.plot(*truth.T, label="truth", **RING)
    for e in inputs.estimates:
        at = Selection(stop=now / 1e9).times(places.seconds(e.objects.time_ns))[-1:]
        rows = slice(*e.objects.row_offset[[*at, *(at + 1)]]) if len(at) else slice(0)
        axes.plot(
            *e.objects.columns("x", "y")[rows].T,
            ls="",
            marker="x",
            markersize=5,
            markeredgecolor=VERMILION,
            markeredgewidth=1.3,
            label=e.estimator,
        )
    for _, stream, _ in found:
        position, _ = pose_at(recording.sensors[stream.nodes[0]], now)
        axes.plot(*position[:2], "ks", markersize=5)
        axes.annotate(
            stream.nodes[0],
            (position[0], position[1]),
            xytext=(4, 4),
            textcoords="offset points",
            bbox=LABEL,
        )
    axes.grid(False)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    figure.colorbar(image, ax=axes, label="power over the noise [dB]", extend="min")
    figure.suptitle(f"{recording.meta.name}, {moment(now / 1e9, inputs)}")


def _area(
    recording: Recording, found: list[tuple[str, Stream, int]], truth: Array
) -> tuple[Array, Array]:
    """Cell centres along x and y of the box around stations and objects, or what one sees."""
    at = [pose_at(recording.sensors[s.nodes[0]], int(s.time_ns[k]))[0][:2] for _, s, k in found]
    corners = np.vstack([*at, truth])
    if len(at) < 3:
        corners = np.vstack([corners, *places.views(recording, Selection())])
    low, high = corners.min(0), corners.max(0)
    margin = 0.04 * (high - low).max()
    cell = ((high - low).max() + 2 * margin) / CELLS
    return (
        np.arange(low[0] - margin, high[0] + margin, cell),
        np.arange(low[1] - margin, high[1] + margin, cell),
    )


def fuse(recording: Recording, found: list[tuple[str, Stream, int]], x: Array, y: Array) -> Array:
    """Summed linear power (ny, nx) at the points ``x`` (nx,), ``y`` (ny,) [m]; NaN: not seen."""
    points = np.stack(np.meshgrid(x, y), -1)
    total, seen = np.zeros(points.shape[:2]), np.zeros(points.shape[:2], bool)
    for name, stream, k in found:
        position, R = pose_at(recording.sensors[stream.nodes[0]], int(stream.time_ns[k]))
        local = (points - position[:2]) @ R[:2, :2]
        polar = np.stack((np.hypot(*np.moveaxis(local, -1, 0)),
                          np.arctan2(local[..., 1], local[..., 0])), -1)  # fmt: skip
        read = RegularGridInterpolator(
            grid(name, stream), stream.scan["map"][k].astype(float), bounds_error=False
        )
        power = read(polar)
        inside = ~np.isnan(power)
        total[inside] += power[inside]
        seen |= inside
    return np.where(seen, total, np.nan)

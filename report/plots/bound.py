"""The least error that the sensors allow in one go, over the area.

With UWB anchors: one range from each. With radars whose recording states tables of detection
probability and covariance: one detection in each scan, its information times the probability.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...models.errors import InputError
from ...models.records import Array, Recording, Stream
from ...models.uwb import error_bound, free_space_amplitude, range_std
from . import places
from .protocol import Inputs, Selection
from .style import BLACK, LABEL, SURFACE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUMMARY = "position error bound over the area, of UWB anchors or of radars that state tables"
NEEDS: tuple[str, ...] = ("recording",)
USES: tuple[str, ...] = ()
SIZE = (12.0, 9.0)
CELLS = 160
"""Cells along the longer side of the area around anchors."""
SMOOTH = 40
"""Cells along both sides from which on there are contour lines."""
_UPPER = np.triu_indices(3)


def draw(figure: Figure, inputs: Inputs, selection: Selection) -> None:
    """The bound as a field with contour lines, the true paths on it.

    Raises
    ------
    InputError : neither anchors with a known noise nor tables
    """
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

    recording = inputs.recording
    tables = [s for _, s in places.radars(recording, ("position",)) if "p_detect_table" in s.model]
    made = of_tables(tables, selection) if tables else of_anchors(recording)
    x, y, bound, note = made
    figure.set_layout_engine("compressed")
    axes = figure.subplots()
    finite = bound[np.isfinite(bound) & (bound > 0)]
    if not len(finite):
        raise InputError("bound: no position of the area is observed in full")
    low, high = np.quantile(finite, (0.0, 0.95))
    norm = LogNorm(low, max(high, low * 1.01))
    image = axes.pcolormesh(
        x, y, bound, cmap=SURFACE, norm=norm, shading="nearest", rasterized=True
    )
    levels = _levels(low, high)
    if min(bound.shape) >= SMOOTH and len(levels):
        lines = axes.contour(x, y, bound, levels=levels, colors="white", linewidths=0.7)
        axes.clabel(lines, fmt="%g m", fontsize=7)
    _path(axes, recording, selection)
    for name, sensor in recording.sensors.items():
        if len(sensor.time_ns):
            at = selection.times(places.seconds(sensor.time_ns))
            place = sensor.position[at if len(at) else [0], :2]
            axes.plot(*place.T, color=BLACK, marker="^" if sensor.kind == "anchor" else "s",
                      ls="-", lw=0.8, markersize=5)  # fmt: skip
            axes.annotate(name, place[-1], xytext=(5, 5), textcoords="offset points", bbox=LABEL)
    axes.grid(False)
    axes.use_sticky_edges = not tables
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    bar = figure.colorbar(image, ax=axes, label="position error bound [m]", extend="max")
    bar.ax.yaxis.set_major_locator(FixedLocator(levels.tolist()))
    bar.ax.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    bar.ax.yaxis.set_minor_locator(NullLocator())
    figure.suptitle(f"{recording.meta.name}, {note}")


def _levels(low: float, high: float) -> Array:
    """Round numbers between ``low`` and ``high``, at least three where these are not too close."""
    for steps in (
        (1, 2, 5),
        (1, 1.5, 2, 3, 4, 5, 6, 8),
        np.arange(2, 20) / 2,
        np.arange(20, 200) / 20,
    ):
        levels = np.array([m * 10.0**e for e in range(-9, 6) for m in steps])
        levels = np.unique(levels[(levels > low) & (levels < high)].round(12))
        if len(levels) >= 3:
            break
    return levels


def _path(axes: Any, recording: Recording, selection: Selection) -> None:
    """The true paths, or places, in white."""
    if recording.truth is None or "x" not in recording.truth.objects.state_names:
        return
    objects = recording.truth.objects
    for label in np.unique(objects.label):
        xy = objects.columns("x", "y")[objects.label == label]
        axes.plot(*xy.T, color="white", lw=1.0, ls=(0, (1, 1)))
        axes.plot(*xy[-1], color="white", marker="+", markersize=5)


def of_anchors(recording: Recording) -> tuple[Array, Array, Array, str]:
    """x (nx,), y (ny,) [m], the bound (ny, nx) [m] of one range from each anchor, and a note.

    Raises
    ------
    InputError : fewer than two anchors, or the noise of their ranges is not known
    """
    anchors = np.array([s.position[0] for s in recording.sensors.values() if s.kind == "anchor"])
    if len(anchors) < 2:
        raise InputError("bound: the recording has neither two anchors nor tables of radars")
    streams = [s for s in recording.streams.values() if s.kind == "uwb"]
    if not streams:
        raise InputError("bound: the recording has anchors but no stream of UWB events")
    low, high = anchors[:, :2].min(0), anchors[:, :2].max(0)
    margin = 0.15 * (high - low).max()
    cell = ((high - low).max() + 2 * margin) / CELLS
    x, y = (np.arange(low[i] - margin, high[i] + margin, cell) for i in (0, 1))
    points = np.stack(np.meshgrid(x, y), -1)
    std = _noise(
        recording, streams[0], np.linalg.norm(points[..., None, :] - anchors[:, :2], axis=-1)
    )
    return x, y, error_bound(points, anchors[:, :2], std), "one range from each anchor"


def _noise(recording: Recording, stream: Stream, distance: Array) -> Array:
    """Standard deviations (...) [m] of ranges over the direct path ``distance`` (...) [m]."""
    if len(stream.rows.get("std", ())):
        return np.full(distance.shape, np.sqrt(np.mean(stream.rows["std"] ** 2)))
    known = {**recording.meta.provenance.get("parameters", {}), **stream.model}
    for key in ("snr_db", "rms_bandwidth"):
        if key not in known:
            raise InputError(f"bound: the noise of the ranges is not known: no std and no {key}")
    near = np.maximum(distance, 1e-3)
    amplitude = free_space_amplitude(near, float(known["snr_db"]))
    return np.asarray(range_std(amplitude, float(known["rms_bandwidth"])))


def of_tables(streams: list[Stream], selection: Selection) -> tuple[Array, Array, Array, str]:
    """x (nx,), y (ny,) [m], the bound (ny, nx) [m] of all scans at half height, and a note.

    A scan counts with its information times its probability of detection, as on average; a
    variance of zero says that the direction was not observed.
    """
    model = streams[0].model
    J: Any = 0.0
    scans = 0
    for s in streams:
        for k in selection.times(places.seconds(s.time_ns)).tolist():
            S = np.zeros((*s.model["p_detect_table"][k].shape, 3, 3))
            for i, j in zip(*_UPPER, strict=True):
                S[..., i, j] = S[..., j, i] = s.model[f"cov_{'xyz'[i]}{'xyz'[j]}_table"][k]
            p = s.model["p_detect_table"][k][..., None, None]
            J = J + p * np.linalg.pinv(S, hermitian=True)
            scans += 1
    nz = J.shape[2]
    J = J[1:-1, 1:-1, nz // 2] if min(J.shape[:2]) > 2 else J[:, :, nz // 2]
    w = np.linalg.eigvalsh(J)
    bound = np.sqrt(np.where(w > 1e-9, 1 / np.maximum(w, 1e-9), np.inf).sum(-1))
    origin, spacing = np.asarray(model["grid_origin"]), np.asarray(model["grid_spacing"])
    first = 1 if bound.shape != model["p_detect_table"].shape[1:3] else 0
    x, y = (origin[i] + (first + np.arange(bound.shape[i])) * spacing[i] for i in (0, 1))
    height = origin[2] + nz // 2 * spacing[2]
    return x, y, bound.T, f"{scans} scans, height {height:.3g} m"

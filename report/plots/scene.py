"""A scene from above and over time: truth, estimates, detections, sensors, views and regions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...models.errors import InputError
from ...models.records import Array, Objects, Recording, Sensor
from . import places
from .blockages import shade
from .clock import time_axis
from .labels import place
from .panels import legend
from .protocol import Inputs, Selection
from .style import (
    BLACK,
    BLUE,
    DIVERGING,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    SURFACE,
    VERMILION,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUMMARY = "truth, estimates, detections and sensors from above and over time"
NEEDS: tuple[str, ...] = ("recording",)
USES: tuple[str, ...] = ("estimates",)
SIZE = (17.0, 9.5)
ELLIPSES = 10
"""Times at which the extents of objects are drawn."""
MANY = 3000
"""Dots above which a vector picture holds them as pixels."""
MOST = 6000
"""Objects at a time, of one file, above which the picture is thinned."""
_TRUTH: dict[str, Any] = {"color": BLUE, "lw": 1.0, "zorder": 5}
_ESTIMATES = ((VERMILION, "o"), (GREEN, "x"), (ORANGE, "v"), (PURPLE, "D"))


def draw(figure: Figure, inputs: Inputs, selection: Selection) -> None:
    """The map beside x and y over time.

    Raises
    ------
    InputError : neither truth nor estimates nor detections
    """
    recording = inputs.recording
    sets = [(e.estimator, e.objects) for e in inputs.estimates]
    time, detected = places.detections(recording, selection)
    if recording.truth is None and not sets and not len(time):
        raise InputError("scene: the recording has neither truth nor detections to draw")
    axes = figure.subplot_mosaic([["map", "x"], ["map", "y"]], width_ratios=(1.35, 1))
    above, over = axes["map"], (axes["x"], axes["y"])
    dots: dict[str, Any] = {"color": GREY, "s": 1.5, "lw": 0, "alpha": 0.6, "zorder": 1}
    dots["rasterized"] = len(time) > MANY
    if len(time):
        above.plot([], [], color=GREY, ls="", marker=".", markersize=4, label="detections")
        _detections(figure, axes, time, detected, places.shades(recording, selection), dots)
    for outline in places.views(recording, selection):
        _outline(above, outline, color=SKY, lw=0.9, ls=(0, (6, 2)), label="field of view")
    for name, corners in places.regions(recording, inputs.estimates).items():
        _outline(above, corners, color=GREEN, lw=1.0, ls=(0, (1, 1)), label="regions")
        above.annotate(name, corners.max(0) * (0, 1) + corners.min(0) * (1, 0), **_NOTE)
    thinned = 1
    if recording.truth is not None:
        thinned = _objects(axes, recording.truth.objects, selection, None, "truth")
    for i, (name, objects) in enumerate(sets):
        thinned = max(thinned, _objects(axes, objects, selection, i, name))
    _frame(axes, recording, sets)
    _sensors(above, recording, selection)
    above.set(xlabel="x [m]", ylabel="y [m]")
    shade(over, recording)
    over[0].set(ylabel="x [m]")
    over[1].set_ylabel("y [m]")
    over[0].sharex(over[1])
    time_axis(over[1], inputs)
    over[0].tick_params(labelbottom=False)
    note = f", objects at one of {thinned} times" if thinned > 1 else ""
    figure.suptitle(recording.meta.name + note)
    legend(figure, above, over[1])
    _true_to_scale(figure, above)
    place(above, *_stands(recording, selection))


_SHADES = {
    "doppler": ("Doppler [m/s]", DIVERGING),
    "power": ("power over the noise [dB]", SURFACE),
    "amplitude": ("amplitude [dB]", SURFACE),
    "rcs": ("radar cross-section [dBsm]", SURFACE),
}
_OUTER = 1.0
"""Percent of the detections at either end that share the last colours."""


def _detections(
    figure: Figure,
    axes: dict[str, Axes],
    time: Array,
    place: Array,
    shades: tuple[str, Array],
    dots: dict[str, Any],
) -> None:
    """Dots from above and over time; in colour where something tells them apart, else grey."""
    pairs = ((axes["map"], place[:, 0], 1), (axes["x"], time, 0), (axes["y"], time, 1))
    column, values = shades
    known = np.isfinite(values)
    for a, x, k in pairs:
        a.scatter(x[~known], place[~known, k], **dots)
    if not known.any():
        return
    label, colours = _SHADES[column]
    low, high = np.percentile(values[known], [_OUTER, 100 - _OUTER])
    if column == "doppler":
        high = max(abs(low), abs(high), 1e-3)
        low = -high
    shown = {k: v for k, v in dots.items() if k != "color"} | {"cmap": colours, "s": 2.5}
    shown |= {"vmin": low, "vmax": max(high, low + 1e-3), "alpha": 0.9}
    for a, x, k in pairs:
        image = a.scatter(x[known], place[known, k], c=values[known], **shown)
    figure.colorbar(image, ax=[axes["x"], axes["y"]], label=label, extend="both", aspect=40)


_NOTE: dict[str, Any] = {
    "xytext": (0, 2),
    "textcoords": "offset points",
    "va": "bottom",
    "fontsize": 7,
    "color": "#005f45",
}


def _outline(axes: Axes, corners: Array, **kwargs: Any) -> None:
    closed = np.vstack((corners, corners[:1]))
    axes.plot(closed[:, 0], closed[:, 1], zorder=2, **kwargs)


def _frame(axes: dict[str, Axes], recording: Recording, sets: list[tuple[str, Objects]]) -> None:
    """Show where objects and sensors are; clutter and views beyond are cut off."""
    known = [o for _, o in sets] + ([recording.truth.objects] if recording.truth else [])
    points = [o.columns("x", "y") for o in known if {"x", "y"} <= set(o.state_names)]
    objects = np.concatenate([np.zeros((0, 2)), *points])
    if not len(objects):
        return
    for a, column in ((axes["x"], objects[:, 0]), (axes["y"], objects[:, 1])):
        a.set_ylim(*_around(column, 0.2))
    sensors = [s.position[:, :2] for s in recording.sensors.values()]
    x, y = np.vstack([objects, *sensors]).T
    axes["map"].set(xlim=_around(x, 0.08), ylim=_around(y, 0.08))


def _true_to_scale(figure: Figure, axes: Axes) -> None:
    """Widen one axis until a metre is as long along both, in the place that the layout leaves."""
    figure.draw_without_rendering()
    width, height = axes.get_window_extent().size
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    metre = min(width / (x1 - x0), height / (y1 - y0))
    more_x, more_y = width / metre - (x1 - x0), height / metre - (y1 - y0)
    axes.set(xlim=(x0 - more_x / 2, x1 + more_x / 2), ylim=(y0 - more_y / 2, y1 + more_y / 2))
    axes.set_aspect("equal", adjustable="box")


def _around(values: Array, margin: float) -> tuple[float, float]:
    """The range of ``values`` and a share ``margin`` of it to both sides, at least 1 m in all."""
    low, high = float(values.min()), float(values.max())
    more = max(margin * (high - low), 0.5 * (1 - (high - low)))
    return low - more, high + more


def _objects(
    axes: dict[str, Axes], objects: Objects, selection: Selection, index: int | None, name: str
) -> int:
    """Centres, devices and extents; ``index`` is None for the truth, drawn as lines.

    Of so many that nobody could tell them apart, those of one of the returned number of times.
    """
    at = selection.times(places.seconds(objects.time_ns))
    every = -(-int(np.diff(objects.row_offset)[at].sum()) // MOST) or 1
    at = at[::every]
    step = np.repeat(np.arange(len(objects.time_ns)), np.diff(objects.row_offset))
    rows = np.flatnonzero(np.isin(step, at))
    time = places.seconds(objects.time_ns)[step]
    for prefix, part in (("", ""), ("device_", ", device")):
        columns = (f"{prefix}x", f"{prefix}y")
        if not set(columns) <= set(objects.state_names):
            continue
        xy, label = objects.columns(*columns), name + part
        for k, mine in enumerate(_lines(objects, rows, index is None) if len(rows) else ()):
            style = _look(index, bool(prefix)) | {"label": label if k == 0 else None}
            axes["map"].plot(xy[mine, 0], xy[mine, 1], **style)
            axes["x"].plot(time[mine], xy[mine, 0], **style)
            axes["y"].plot(time[mine], xy[mine, 1], **style)
    if "x" in objects.state_names:
        few = at[np.linspace(0, len(at) - 1, min(ELLIPSES, len(at))).round().astype(int)]
        shown = np.flatnonzero(np.isin(step, few))
        colour = BLUE if index is None else _ESTIMATES[index % len(_ESTIMATES)][0]
        for x, y in places.outlines(objects, shown.tolist()):
            axes["map"].plot(x, y, color=colour, lw=0.7, zorder=3 if index is None else 4)
    return every


def _lines(objects: Objects, rows: Array, by_label: bool) -> list[Array]:
    """The rows of each object, to be joined by a line, or all as dots."""
    if not by_label:
        return [rows]
    label = objects.label[rows]
    return [rows[label == name] for name in np.unique(label)]


def _look(index: int | None, device: bool) -> dict[str, Any]:
    if index is None:
        return _TRUTH | ({"ls": (0, (1, 1)), "color": "#004c75"} if device else {})
    colour, marker = _ESTIMATES[index % len(_ESTIMATES)]
    shape = {"marker": "+" if device else marker, "markersize": 3.2 if device else 2.4}
    return {"color": colour, "ls": "", "markeredgewidth": 0.5, "alpha": 0.8, "zorder": 4} | shape


def _sensors(axes: Axes, recording: Recording, selection: Selection) -> None:
    """Anchors and radars, with the path of those that move."""
    for sensor in recording.sensors.values():
        path = _path(sensor, selection)
        if len(path) > 1:
            axes.plot(*path.T, color=BLACK, lw=0.8, ls=(0, (4, 1, 1, 1)), label="path of a sensor")
        if len(path):
            marker = "^" if sensor.kind == "anchor" else "s"
            axes.plot(
                *path[-1], color=BLACK, marker=marker, ls="", markersize=5, label=sensor.kind,
                zorder=6,
            )  # fmt: skip


def _path(sensor: Sensor, selection: Selection) -> Array:
    """Where a sensor was (k, 2), or first is; nothing of one without a place."""
    if not len(sensor.time_ns):
        return np.zeros((0, 2))
    at = selection.times(places.seconds(sensor.time_ns))
    return sensor.position[at if len(at) else [0], :2]


def _stands(recording: Recording, selection: Selection) -> tuple[list[str], Array]:
    """The names of sensors, and where they stand at last (n, 2)."""
    paths = {name: _path(sensor, selection) for name, sensor in recording.sensors.items()}
    last = {name: path[-1] for name, path in paths.items() if len(path)}
    return list(last), np.array(list(last.values())).reshape(-1, 2)

"""Where things are on the map: detections, views of sensors, outlines of objects, regions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import inf
from typing import Any

import numpy as np

from ...models.errors import ParameterError
from ...models.geometry.extent import in_plane
from ...models.geometry.poses import pose_at, rotation
from ...models.geometry.regions import polygon
from ...models.radar.detection import View
from ...models.records import Array, Estimates, Making, Objects, Recording, Stream
from .protocol import Selection

RADARS = ("position", "range_bearing")


def seconds(time_ns: Array) -> Array:
    """Times [s]."""
    return np.asarray(time_ns / 1e9)


def radars(recording: Recording, kinds: Iterable[str] = RADARS) -> Iterator[tuple[str, Stream]]:
    """The streams of radars, by name."""
    return ((n, s) for n, s in sorted(recording.streams.items()) if s.kind in kinds)


def detections(recording: Recording, selection: Selection) -> tuple[Array, Array]:
    """Times (m,) [s] and positions (m, 3) [m] on the map of all detections of radars."""
    times, places = [np.zeros(0)], [np.zeros((0, 3))]
    for _, stream in radars(recording):
        time = seconds(stream.time_ns)
        local = _local(stream)
        for k in selection.times(time).tolist():
            rows = slice(stream.row_offset[k], stream.row_offset[k + 1])
            position, R = pose_at(recording.sensors[stream.nodes[0]], int(stream.time_ns[k]))
            places.append(position + local[rows] @ R.T)
            times.append(np.full(len(places[-1]), time[k]))
    return np.concatenate(times), np.concatenate(places)


_STRENGTH = {"power": 10.0, "amplitude": 20.0, "rcs": 10.0}
"""Columns that tell how strong a detection is, and what makes decibels of their logarithms."""


def shades(recording: Recording, selection: Selection) -> tuple[str, Array]:
    """What tells detections apart, and its value for each (m,), in the order of :func:`detections`.

    Doppler [m/s] where a radar has it, or else how strong they are [dB]; NaN for detections that do
    not have it. Empty without either.
    """
    streams = [stream for _, stream in radars(recording)]
    known = {column for stream in streams for column in stream.rows}
    column = next((c for c in ("doppler", *_STRENGTH) if c in known), "")
    values = [np.zeros(0)]
    for stream in streams:
        own = stream.rows.get(column, np.full(int(stream.row_offset[-1]), np.nan))
        for k in selection.times(seconds(stream.time_ns)).tolist():
            values.append(own[stream.row_offset[k] : stream.row_offset[k + 1]])
    found = np.concatenate(values)
    if column in _STRENGTH:
        with np.errstate(divide="ignore"):
            decibels = _STRENGTH[column] * np.log10(found)
        found = np.where(np.isfinite(decibels), decibels, np.nan)
    return column, found


def _local(stream: Stream) -> Array:
    """Positions (m, 3) of the rows in the sensor's frame."""
    rows = stream.rows
    if stream.kind == "position":
        zero = np.zeros(len(rows["x"]))
        return np.stack((rows["x"], rows["y"], rows.get("z", zero)), 1)
    elevation = rows.get("elevation", np.zeros(len(rows["range"])))
    flat = rows["range"] * np.cos(elevation)
    xy = flat * np.cos(rows["azimuth"]), flat * np.sin(rows["azimuth"])
    return np.stack((*xy, rows["range"] * np.sin(elevation)), 1)


def views(recording: Recording, selection: Selection) -> list[Array]:
    """Outlines (v, 2) on the map of what radars had in view: a moving one's last, else all."""
    found: dict[tuple[float, ...], Array] = {}
    for name, stream in radars(recording, (*RADARS, "range_angle_map")):
        sensor = recording.sensors[stream.nodes[0]]
        chosen = selection.times(seconds(stream.time_ns)).tolist()
        for k in chosen[-1:] if len(sensor.time_ns) > 1 else chosen:
            view = _view(stream, k)
            key = hash(name), view.azimuth_min, view.azimuth_max, view.range_min, view.range_max
            if view.bounded and key not in found:
                position, R = pose_at(sensor, int(stream.time_ns[k]))
                corners = view.corners()
                if view.width >= 2 * np.pi:
                    corners = corners[: len(corners) // 2 + 1] if view.range_min else corners[:-1]
                found[key] = position[:2] + corners @ R[:2, :2].T
    return list(found.values())


def _view(stream: Stream, k: int) -> View:
    """The view of scan ``k``."""
    model = stream.model
    if "range_axis" in model and "azimuth_axis" in model:
        r, a = np.asarray(model["range_axis"]), np.asarray(model["azimuth_axis"])
        return View(float(a[0]), float(a[-1]), float(r[0]), float(r[-1]))
    scan = {c: v[k] for c, v in stream.scan.items() if c.startswith("view_")}
    return View.of(scan, float(model.get("max_range", inf)))


def outlines(objects: Objects, rows: Iterable[int]) -> Iterator[tuple[Array, Array]]:
    """Closed outlines (2, v) on the map of the extents of ``rows``, a solid's as seen from above.

    An ellipse is that of a covariance with its semi-axes as standard deviations.
    """
    if objects.semi_axes is None:
        return
    at = objects.columns("x", "y")
    around = np.linspace(0, 2 * np.pi, 61)
    for row in rows:
        axes = objects.semi_axes[row]
        angle = np.zeros(()) if objects.rotation is None else objects.rotation[row]
        R = rotation(angle) if angle.shape else in_plane(angle)
        if objects.extent_kind == "rectangle":
            c = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]]) * axes[:2]
            line = c @ R[:2, :2].T
        else:
            axes = np.repeat(axes, 2)[:2] if len(axes) == 1 else axes
            S = (R[:2, : len(axes)] * axes[: R.shape[1]] ** 2) @ R[:2, : len(axes)].T
            w, U = np.linalg.eigh(S)
            circle = np.stack((np.cos(around), np.sin(around)), 1)
            line = circle @ (U * np.sqrt(np.maximum(w, 0.0))).T
        yield at[row, 0] + line[:, 0], at[row, 1] + line[:, 1]


def regions(recording: Recording, estimates: Iterable[Estimates]) -> dict[str, Array]:
    """Corners (v, 2) of the regions that estimates or the scenario counted in, by name."""
    scenario = Making.of(recording.meta.provenance).parameters
    for parameters in (*(e.making.parameters for e in estimates), scenario):
        known = parameters.get("regions")
        if known and isinstance(known, Mapping | Sequence):
            named = known.items() if isinstance(known, Mapping) else enumerate(known, 1)
            return {f"region {n}" if isinstance(n, int) else n: c for n, c in _polygons(named)}
    return {}


def _polygons(named: Iterable[tuple[Any, Any]]) -> Iterator[tuple[Any, Array]]:
    for name, corners in named:
        try:
            yield name, polygon(corners)
        except ParameterError:
            continue

"""Range-angle maps, station by station, in decibels over the noise."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...models.errors import InputError
from ...models.geometry.poses import pose_at
from ...models.records import Array, Recording, Stream
from . import places
from .clock import moment
from .panels import even, panels
from .protocol import Inputs, Selection
from .style import SURFACE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUMMARY = "range-angle map of every station at a time"
NEEDS: tuple[str, ...] = ("recording",)
USES: tuple[str, ...] = ()
SIZE = (16.0, 6.5)
FLOOR = -10.0
"""Least power [dB] that has a colour of its own."""


def draw(figure: Figure, inputs: Inputs, selection: Selection) -> None:
    """One panel for each station, the last scan of the span; true centres as rings.

    Raises
    ------
    InputError : no maps
    """
    recording = inputs.recording
    found = last_maps(recording, selection, "map")
    highest = max(float(decibels(stream.scan["map"][k]).max()) for _, stream, k in found)
    axes = panels(figure, len(found), sharex=True, sharey=True)
    for a, (name, stream, k) in zip(axes, found, strict=True):
        r, azimuth = grid(name, stream)
        image = a.pcolormesh(
            np.degrees(azimuth),
            r,
            decibels(stream.scan["map"][k]),
            cmap=SURFACE,
            vmin=FLOOR,
            vmax=highest,
            shading="nearest",
            rasterized=True,
        )
        truth = true_centres(recording, int(stream.time_ns[k]))
        position, R = pose_at(recording.sensors[stream.nodes[0]], int(stream.time_ns[k]))
        local = (truth - position[:2]) @ R[:2, :2]
        distance, angle = np.hypot(*local.T), np.arctan2(local[:, 1], local[:, 0])
        seen = (distance <= r[-1]) & (azimuth[0] <= angle) & (angle <= azimuth[-1])
        a.plot(np.degrees(angle[seen]), distance[seen], **RING)
        a.set_title(f"{stream.nodes[0]}, {moment(stream.time_ns[k] / 1e9, inputs)}")
        a.grid(False)
        a.set(ylabel="range [m]")
    for a in axes[-even(figure, len(axes)) :]:
        a.set_xlabel("azimuth [°]")
    figure.colorbar(image, ax=axes, label="power over the noise [dB]", extend="min")
    figure.suptitle(recording.meta.name)


RING: dict[str, Any] = {
    "color": "#ffffff",
    "marker": "o",
    "ls": "",
    "markersize": 7,
    "markerfacecolor": "none",
    "markeredgewidth": 0.8,
}


def last_maps(
    recording: Recording, selection: Selection, kind: str
) -> list[tuple[str, Stream, int]]:
    """Name and stream of every station with maps, and its last scan of the span.

    Raises
    ------
    InputError : there is none
    """
    found = []
    for name, stream in places.radars(recording, ("range_angle_map",)):
        at = selection.times(places.seconds(stream.time_ns))
        if len(at):
            found.append((name, stream, int(at[-1])))
    if not found:
        raise InputError(f"{kind}: the recording has no range_angle_map in this span")
    return found


def grid(name: str, stream: Stream) -> tuple[Array, Array]:
    """The axes of a station's maps: ranges [m] and azimuths [rad].

    Raises
    ------
    InputError : its model does not state them
    """
    for key in ("range_axis", "azimuth_axis"):
        if key not in stream.model:
            raise InputError(f"streams/{name}: the model has no {key}")
    return np.asarray(stream.model["range_axis"]), np.asarray(stream.model["azimuth_axis"])


def decibels(power: Array) -> Array:
    """Linear ``power`` over the noise as dB."""
    return np.asarray(10 * np.log10(np.maximum(power.astype(float), 1e-10)))


def true_centres(recording: Recording, time_ns: int) -> Array:
    """Centres (m, 2) [m] of the true objects at the last known time up to ``time_ns``."""
    if recording.truth is None or "x" not in recording.truth.objects.state_names:
        return np.zeros((0, 2))
    objects = recording.truth.objects
    k = max(int(np.searchsorted(objects.time_ns, time_ns, side="right")) - 1, 0)
    first, last = objects.row_offset[[k, k + 1]] if len(objects.time_ns) else (0, 0)
    return np.asarray(objects.columns("x", "y")[first:last])

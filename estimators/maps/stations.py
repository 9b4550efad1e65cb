"""Stations and their maps on the plane: pose, scale, the soft map, and what cannot be seen there.

E. Favarelli et al., "Multi-base station cooperative sensing with AI-aided tracking", section III:
the sum of the maps, rotated, translated and resampled. Not in the paper: powers are scaled by the
reference echo that a recording states, so that thresholds and network serve any transmitter.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models.errors import InputError
from ...models.geometry.poses import pose_at
from ...models.geometry.regions import box, contains
from ...models.radar.multibeam import BaseStation, reference_echo
from ...models.records import Array, Scan, Sensor, Stream
from .frames import STAMP
from .kernels.compiled import fusion as compiled_fusion
from .kernels.fusion import Pixels, Table, table
from .params import FusionParams

REFERENCE = reference_echo(BaseStation(), 50.0)
"""The reference echo for which the defaults are: 1 m2 at 50 m before the paper's stations."""


@dataclass(frozen=True, slots=True, eq=False)
class Station:
    """A station's axes, and the table of its map for the pose that it has first.

    ``scale`` takes its powers to those of a station whose reference echo is :data:`REFERENCE`;
    ``noise`` is then their mean where nothing is, 0 where the recording does not state it.
    """

    sensor: Sensor
    distance: Array
    azimuth: Array
    position: Array
    rotation: Array
    table: Table
    scale: float
    noise: float

    @staticmethod
    def of(sensor: Sensor, model: Mapping[str, Any], pixels: Pixels) -> Station:
        """The station of a stream with this ``model``.

        Raises
        ------
        InputError : a reference echo, or a noise, that is no power
        """
        distance, azimuth = (np.asarray(model[f"{a}_axis"], float) for a in ("range", "azimuth"))
        p, R = pose_at(sensor, int(sensor.time_ns[0]))
        t = table(pixels, distance, azimuth, p, R)
        scale = REFERENCE / power(model, "reference_echo", REFERENCE)
        noise = scale * power(model, "noise_power", 1.0) if "noise_power" in model else 0.0
        scale = 1.0 if abs(scale - 1) < 1e-9 else scale
        return Station(sensor, distance, azimuth, p, R, t, scale, noise)

    def at(self, time_ns: int, pixels: Pixels) -> Table:
        """The table for the pose at a time."""
        p, R = pose_at(self.sensor, time_ns)
        if np.array_equal(p, self.position) and np.array_equal(R, self.rotation):
            return self.table
        return table(pixels, self.distance, self.azimuth, p, R)


def power(model: Mapping[str, Any], name: str, default: float) -> float:
    """The power ``name`` [unit of the map] that a stream's ``model`` states.

    Raises
    ------
    InputError : it is none
    """
    stated = model.get(name, default)
    try:
        found = float(stated)
    except (TypeError, ValueError):
        found = 0.0
    if not 0 < found < np.inf:
        raise InputError(f"{name} must be a positive power, got {stated!r}")
    return found


def fuse(
    stations: Mapping[str, Station], pixels: Pixels, time_ns: int, scans: Sequence[Scan]
) -> Array:
    """The soft map (ny, nx), float32: the sum of the maps in ``scans``, scaled and resampled.

    Raises
    ------
    InputError : a map that does not have the shape of its axes
    """
    soft = np.zeros((pixels.ny, pixels.nx), np.float32)
    for scan in scans:
        station, power = stations[scan.stream], scan.scan["map"]
        shape = len(station.distance), len(station.azimuth)
        if power.shape != shape:
            raise InputError(
                f"stream {scan.stream} at {time_ns} ns: map of {power.shape}, axes of {shape}"
            )
        if station.scale != 1:
            power = power * np.float32(station.scale)
        t = station.at(scan.scan.get(STAMP, time_ns), pixels)
        compiled_fusion.add(soft, np.ascontiguousarray(power), t.pixel, t.corner, t.u, t.v)
    return soft


def seen(
    stations: Mapping[str, Station], pixels: Pixels, time_ns: int, scans: Sequence[Scan]
) -> Array | None:
    """By which share (ny, nx) of the ``stations`` the pixels are seen; None: all by all."""
    count = np.zeros(pixels.ny * pixels.nx, np.float32)
    for scan in scans:
        count[stations[scan.stream].at(scan.scan.get(STAMP, time_ns), pixels).pixel] += 1
    if (count == len(stations)).all():
        return None
    share: Array = np.maximum(count, 1).reshape(pixels.ny, pixels.nx) / np.float32(len(stations))
    return share


def doubts(
    streams: Mapping[str, Stream], stations: Mapping[str, Station], params: FusionParams
) -> Iterator[str]:
    """What of the recording the soft map does not show, a line each."""
    x0, x1, y0, y1 = params.map_region
    lies = f"outside map_region {list(params.map_region)}"
    blind = [name for name, station in stations.items() if not len(station.table.pixel)]
    if blind:
        yield f"{' '.join(blind)}: the whole sector lies {lies}"
    for stated in {
        str(s.model["map_region"]): s for s in streams.values() if "map_region" in s.model
    }.values():
        area = np.asarray(stated.model["map_region"], float)
        if ((area - (x0, x1, y0, y1)) * (1, -1, 1, -1) < -1e-9).any():
            yield f"the area {area.tolist()} that the recording states lies partly {lies}"
    births = np.array(getattr(params, "birth_components", ()), float).reshape(-1, 9)
    outside = ~contains(box(params.map_region), births[:, 1:3])
    if streams and getattr(params, "birth", "") == "components" and outside.any():
        yield f"{outside.sum()} of {len(births)} births lie {lies}"

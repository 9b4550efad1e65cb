"""The stations of a recording and the mean of their maps, for targets anywhere.

A cell's mean is noise and, for each point that reflects, its power by the radar equation, the
Dirichlet kernel of its range, the two-way beam of its direction, and the share of its Doppler in
the column that the map shows of that direction: that of the strongest echo.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from ....models.errors import InputError
from ....models.geometry.poses import pose_at
from ....models.radar.multibeam import BaseStation, reference_echo
from ....models.radar.ofdm import LIGHT
from ....models.records import Array, Recording, Scan
from ..frames import STAMP
from ..kernels import response
from ..kernels.compiled import response as compiled
from ..kernels.response import A0, BIN, COS, DA, DR, GAIN, LATE, R0, SIN, SPEED, X, Y, Z
from ..stations import power
from .params import Params


@dataclass(frozen=True, slots=True, eq=False)
class Layout:
    """Stations (S, 13) with their beams (S, n), the ``shape`` (R, A) of their maps, and bodies.

    ``noise`` (S,) is the unit of their powers, ``floor`` (S, R) the mean of cells where nothing is.
    ``places`` (J, 2) are where new targets are looked for, with ``cell`` and ``weight`` as the
    kernel takes them.
    """

    names: tuple[str, ...]
    stations: Array
    beams: Array
    sizes: Array
    noise: Array
    floor: Array
    bodies: list[Array]
    places: Array
    cell: Array
    weight: Array

    @staticmethod
    def of(setup: Recording, names: Sequence[str], params: Params) -> Layout:
        """The layout of the streams ``names`` as their stations stand first.

        Raises
        ------
        InputError : a stream that does not state its waveform
        """
        rows, beams, sizes, noise = [], [], [], []
        for name in names:
            stream = setup.streams[name]
            station = _station(name, stream.model)
            axes = [np.asarray(stream.model[f"{a}_axis"], float) for a in ("range", "azimuth")]
            sizes.append([len(a) for a in axes])
            row = np.zeros(13)
            row[[R0, A0]] = [a[0] for a in axes]
            row[[DR, DA]] = [(a[-1] - a[0]) / (len(a) - 1) for a in axes]
            row[GAIN] = reference_echo(station, 1.0)
            row[SPEED] = 2 * station.carrier / LIGHT * station.symbols * station.symbol_time
            row[BIN] = station.range_bin
            sensor = setup.sensors[stream.nodes[0]]
            rows.append(placed(row, *pose_at(sensor, int(sensor.time_ns[0]))))
            noise.append(power(stream.model, "noise_power", 1.0))
            beams.append(_beam(station))
        found = Layout(
            tuple(names),
            np.array(rows).reshape(-1, 13),
            np.array(beams).reshape(-1, response.BEAM),
            np.array(sizes, np.int64).reshape(-1, 2),
            np.array(noise),
            _floor(np.array(rows).reshape(-1, 13), sizes, params),
            params.bodies,
            *_nowhere(),
        )
        return found.looking(params)

    def looking(self, params: Params) -> Layout:
        """The layout with the places of its region, and the cells about them."""
        x0, x1, y0, y1 = params.map_region
        n, m = (int(np.ceil((b - a) / params.birth_spacing)) for a, b in ((x0, x1), (y0, y1)))
        x, y = x0 + (np.arange(n) + 0.5) * (x1 - x0) / n, y0 + (np.arange(m) + 0.5) * (y1 - y0) / m
        places = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
        cell = np.full((len(places), len(self.stations), 2), -1, np.int64)
        weight = np.zeros(cell.shape[:2])
        for q, station in enumerate(self.stations):
            r, a = polar(station, places)
            row, column = (r - station[R0]) / station[DR], (a - station[A0]) / station[DA]
            at = np.stack((np.rint(row), np.rint(column)), 1).astype(np.int64)
            seen = ((at >= 0) & (at < self.sizes[q])).all(1)
            cell[seen, q] = at[seen]
            weight[:, q] = station[GAIN] * params.rcs_pedestrian / np.maximum(r, 1.0) ** 4
        return Layout(
            self.names, self.stations, self.beams, self.sizes, self.noise, self.floor,
            self.bodies, places, cell, weight,
        )  # fmt: skip


def _nowhere() -> tuple[Array, Array, Array]:
    return np.zeros((0, 2)), np.zeros((0, 0, 2), np.int64), np.zeros((0, 0))


def _floor(stations: Array, sizes: Sequence[Sequence[int]], params: Params) -> Array:
    """Mean power (S, R) of cells where nothing is: the noise, and what no echo rises above.

    Sidelobes of an echo fluctuate with it, so that they say nothing new, and beams to users
    lift them: they are hidden in a floor ``dynamic_range`` below 1 m2 at their range.
    """
    found = np.ones((len(stations), max((s[0] for s in sizes), default=0)))
    r = np.abs(stations[:, R0, None] + stations[:, DR, None] * np.arange(found.shape[1]))
    weakest = 10 ** (-params.dynamic_range / 10)
    return np.asarray(
        np.maximum(found, stations[:, GAIN, None] / np.maximum(r, 1.0) ** 4 * weakest)
    )


def _station(name: str, model: Mapping[str, Any]) -> BaseStation:
    needed = [f.name for f in fields(BaseStation)]
    missing = [key for key in needed if key not in model]
    if missing:
        raise InputError(
            f"stream {name}: does not state its waveform: {' '.join(missing)} missing in its model"
        )
    if not model["sensing_power"] > 0:
        raise InputError(f"stream {name}: has no power to sense with: sensing_power is 0")
    return BaseStation(**{key: model[key] for key in needed})


def placed(row: Array, position: Array, rotation: Array) -> Array:
    """The station's ``row`` at a pose; its height is over the ground."""
    row = row.copy()
    row[[X, Y, Z]] = position
    length = np.hypot(rotation[0, 0], rotation[1, 0])
    row[[COS, SIN]] = rotation[:2, 0] / length
    return row


def _beam(station: BaseStation) -> Array:
    """The two-way beam, with what beams to users elsewhere add in the mean over the sector."""
    N, share = station.transmit_elements, station.sensing_power
    elsewhere = min(2 / (N * 2 * np.sin(station.aperture)), 1.0)
    return response.two_way(N, station.receive_elements, share, elsewhere)


def polar(station: Array, places: Array) -> tuple[Array, Array]:
    """Slant range (n,) and azimuth (n,), as its array sees it, of places (n, 2)."""
    d = places - station[[X, Y]]
    x = station[COS] * d[:, 0] + station[SIN] * d[:, 1]
    y = station[COS] * d[:, 1] - station[SIN] * d[:, 0]
    return np.sqrt(x**2 + y**2 + station[Z] ** 2), np.arctan2(
        y, np.copysign(np.hypot(x, station[Z]), x)
    )


def windows(layout: Layout, x: float, y: float, reach: float) -> Array:
    """Rows and columns (S, 4) of the cells within ``reach`` [m] of a place; none where unseen."""
    found = np.zeros((len(layout.stations), 4), np.int64)
    s = layout.stations
    dx, dy = x - s[:, X], y - s[:, Y]
    ahead, left = s[:, COS] * dx + s[:, SIN] * dy, s[:, COS] * dy - s[:, SIN] * dx
    flat = np.hypot(dx, dy)
    r = np.hypot(flat, s[:, Z])
    a = np.arctan2(left, np.copysign(np.hypot(ahead, s[:, Z]), ahead))
    wide = reach / np.maximum(flat, reach) + 1.5 * s[:, DA]
    rows, columns = layout.sizes.T
    found[:, 0] = np.clip(np.ceil((r - reach - s[:, R0]) / s[:, DR]), 0, rows)
    found[:, 1] = np.clip(np.floor((r + reach - s[:, R0]) / s[:, DR]) + 1, 0, rows)
    found[:, 2] = np.clip(np.ceil((a - wide - s[:, A0]) / s[:, DA]), 0, columns)
    found[:, 3] = np.clip(np.floor((a + wide - s[:, A0]) / s[:, DA]) + 1, 0, columns)
    return found


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """Maps of one time: ``power`` (S, R, A) over the noise, of stations with ``columns`` (S, A).

    ``columns`` is the Doppler bin that a map shows of each direction.
    """

    layout: Layout
    power: Array
    columns: Array

    @staticmethod
    def of(layout: Layout, scans: Iterable[Scan], setup: Recording) -> View:
        """What the ``scans`` show; stations without one see nothing.

        Raises
        ------
        InputError : a map that does not have the shape of its axes
        """
        R, A = layout.sizes.max(0)
        power = np.zeros((len(layout.names), R, A))
        stations, sizes = layout.stations.copy(), np.zeros_like(layout.sizes)
        for scan in scans:
            q = layout.names.index(scan.stream)
            D = scan.scan["map"]
            if D.shape != tuple(layout.sizes[q]):
                raise InputError(
                    f"stream {scan.stream} at {scan.time_ns} ns: map of {D.shape}, axes of "
                    f"{tuple(layout.sizes[q].tolist())}"
                )
            sizes[q] = D.shape
            raised = layout.floor[q, : len(D), None] - 1
            power[q, : D.shape[0], : D.shape[1]] = D / layout.noise[q] + raised
            sensor = setup.sensors[setup.streams[scan.stream].nodes[0]]
            when = int(scan.scan.get(STAMP, scan.time_ns))
            stations[q, LATE] = (when - scan.time_ns) / 1e9
            if len(sensor.time_ns) > 1:
                stations[q] = placed(stations[q], *pose_at(sensor, when))
        cell = np.where((sizes[:, 0] > 0)[:, None], layout.cell, -1)
        seen = Layout(
            layout.names, stations, layout.beams, sizes, layout.noise, layout.floor,
            layout.bodies, layout.places, cell, layout.weight,
        )  # fmt: skip
        return View(seen, power, np.zeros((len(layout.names), A)))

    def add(self, mean: Array, sign: float, kind: int, target: Array, windows: Array) -> None:
        """Add ``sign`` times the mean power of a target (7,) of class ``kind``, in place."""
        layout, body = self.layout, self.layout.bodies[kind]
        for q, window in enumerate(windows):
            compiled.add(
                mean[q], sign, layout.stations[q], layout.beams[q], self.columns[q], body, target,
                window,
            )  # fmt: skip

    @property
    def whole(self) -> Array:
        """The window of all cells (S, 4)."""
        rows, columns = self.layout.sizes.T
        zero = np.zeros_like(rows)
        return np.stack((zero, rows, zero, columns), 1)

    def mean(self, kinds: Array, targets: Array) -> Array:
        """Mean (S, R, A) of the maps with ``targets`` (n, 7) of classes ``kinds`` (n,)."""
        found = np.ones_like(self.power) * self.layout.floor[:, :, None]
        for kind, target in zip(kinds.tolist(), targets, strict=True):
            self.add(found, 1.0, kind, target, self.whole)
        return found

    def shown(self, kinds: Array, targets: Array) -> View:
        """The view with the Doppler bins of the strongest of ``targets`` (n, 7) as its columns."""
        columns, peak = np.zeros_like(self.columns), np.zeros_like(self.columns)
        layout = self.layout
        for kind, target in zip(kinds.tolist(), targets, strict=True):
            body = layout.bodies[kind]
            for q in np.flatnonzero(layout.sizes[:, 0]):
                compiled.strongest(
                    columns[q], peak[q], layout.stations[q], layout.beams[q], body, target
                )
        return View(layout, self.power, columns)

    def gains(self, mean: Array, shape: float) -> Array:
        """What a pedestrian at each of the places (J,) would add to the log-likelihood."""
        layout = self.layout
        return np.asarray(compiled.gains(self.power, mean, layout.cell, layout.weight, shape))

    def fit(
        self, rest: Array, kind: int, target: Array, windows: Array, shape: float, derive: bool
    ) -> tuple[float, Array, Array]:
        """What a target (7,) adds to the log-likelihood of its windows, score and information."""
        layout = self.layout
        found: tuple[float, Array, Array] = compiled.fit(
            self.power, rest, layout.stations, layout.beams, self.columns, layout.bodies[kind],
            target, windows, shape, derive,
        )  # fmt: skip
        return found

    def log_likelihood(self, mean: Array, shape: float) -> float:
        """Log-likelihood of all cells."""
        return float(
            sum(compiled.log_likelihood(D, M, shape) for D, M in zip(self.power, mean, strict=True))
        )

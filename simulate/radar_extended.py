"""Two moving OFDM radars look at closely spaced extended targets that stand still.

The scene of the paper on doubly inhomogeneous generalised shot noise Cox processes (DI-GSNCP),
section 5. The centres are a Matern hard-core process; a target sends a Poisson number of detections
whose mean grows with its volume and the radar's resolution, from points spread over its extent,
with the noise that the Fisher information promises at each of them. The recording states, as the
estimators may know it, detection probability and covariance on a grid for every scan.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..models.geometry import extent
from ..models.geometry.grids import Grid
from ..models.parameters import parameter, require
from ..models.point_process import matern_ii
from ..models.radar import ofdm
from ..models.records import Array, Meta, Objects, Recording, Sensor, Stream, Truth

SUMMARY = "two moving OFDM radars and closely spaced extended targets, in three dimensions"
UPPER = np.triu_indices(3)
"""Rows and columns of the upper triangle xx xy xz yy yz zz of a covariance."""


@dataclass(frozen=True, slots=True)
class Params:
    """Scene, sensors, waveform and tables."""

    epochs: int = parameter(
        6, "1", "number of epochs, in each of which every sensor scans once", within="[1, inf)"
    )
    epoch: float = parameter(
        0.4, "s", "length of an epoch; its scans bear the time of its end", within="(0, inf)"
    )
    region: tuple[float, ...] = parameter(
        (0.0, 50.0, 0.0, 20.0, 0.0, 10.0), "m", "x_min x_max y_min y_max z_min z_max"
    )
    hard_core_radius: float = parameter(6.0, "m", "no two centres are within it", within="[0, inf)")
    mean_targets: float = parameter(
        9.6, "1", "mean number of targets; none at all is drawn again", within="(0, inf)"
    )
    extent_diagonal: tuple[float, float] = parameter(
        (1.0, 1.5),
        "m",
        "range of the diagonal elements of the extent's triangular matrix",
        within="(0, inf)",
    )
    extent_off_diagonal: tuple[float, float] = parameter(
        (-0.5, 0.5), "m", "range of the elements below the diagonal"
    )
    clutter_rate: float = parameter(
        35.0, "1", "mean number of false detections per scan", within="[0, inf)"
    )
    starts: tuple[tuple[float, float, float], ...] = parameter(
        ((0.0, -4.0, 5.0), (50.0, 24.0, 5.0)), "m", "positions of the sensors in the first epoch"
    )
    velocities: tuple[tuple[float, float, float], ...] = parameter(
        ((25.0, 0.0, 0.0), (-25.0, 0.0, 0.0)), "m s-1", "velocities of the sensors"
    )
    focus: tuple[float, float, float] = parameter(
        (25.0, 35.0, 5.0), "m", "point at which the directed precoders aim"
    )
    directed: int = parameter(
        2, "1", "precoders, of two slots each, aimed at the focus", within="[0, inf)"
    )
    others: int = parameter(
        8, "1", "precoders of a random vector orthogonal to them", within="[0, inf)"
    )
    carrier: float = parameter(30e9, "Hz", "carrier frequency", within="(0, inf)")
    spacing: float = parameter(125e3, "Hz", "subcarrier spacing", within="(0, inf)")
    subcarriers: int = parameter(1000, "1", "number of subcarriers")
    side: int = parameter(24, "1", "array elements along each of its axes", within="[2, inf)")
    rcs: float = parameter(50.0, "m2", "radar cross section", within="(0, inf)")
    transmit_density: float = parameter(-70.0, "dBm Hz-1", "transmitted power density")
    noise_density: float = parameter(-140.0, "dBm Hz-1", "noise power density")
    p_false: float = parameter(1e-3, "1", "probability of a false alarm per cell", within="(0, 1)")
    azimuth_factor: float = parameter(5.0, "1", "gain of the azimuth resolution")
    elevation_factor: float = parameter(4.0, "1", "gain of the elevation resolution")
    max_resolution: float = parameter(50.0, "m-3", "most points resolved per volume")
    cell: float = parameter(2.5, "m", "cell of the tables", within="(0, inf)")
    outside_variance: float = parameter(20.0, "m2", "variance stated beyond the tables")

    def __post_init__(self) -> None:
        r = self.region
        ok = len(r) == 6 and all(a < b for a, b in zip(r[::2], r[1::2], strict=True))
        require(ok, "region", "three increasing pairs", r)
        for name in ("extent_diagonal", "extent_off_diagonal"):
            low, high = getattr(self, name)
            require(low <= high, name, "increasing", (low, high))
        same = len(self.starts) == len(self.velocities) >= 1
        require(same, "velocities", "as many as starts, at least one", self.velocities)
        require(self.directed + self.others >= 1, "directed", "1 with others", self.directed)
        even = self.subcarriers >= 2 and self.subcarriers % 2 == 0
        require(even, "subcarriers", "even, at least 2", self.subcarriers)

    @property
    def box(self) -> tuple[Array, Array]:
        """Lower and upper corner (3,) of the region."""
        return np.array(self.region[::2]), np.array(self.region[1::2])

    @property
    def radar(self) -> ofdm.Radar:
        """The radars, which are alike."""
        return ofdm.Radar(**{k: getattr(self, k) for k in ofdm.Radar.__dataclass_fields__})


def simulate(params: Params, rng: np.random.Generator, name: str) -> Recording:
    """A recording of the scene with its truth, called ``name``."""
    c, e, empty = targets(params, rng)
    sensors, streams = {}, {}
    grid = Grid.around(*params.box, params.cell)
    for i in range(len(params.starts)):
        node = f"R{i}"
        states = [sensor_state(params, i, t, rng) for t in range(params.epochs)]
        scans = [_scan(params, s, c, e, rng) for s in states]
        sensors[node] = _sensor(params, states)
        streams[node] = _stream(params, grid, node, states, scans)
    meta = Meta(name, provenance={"empty_draws": empty})
    return Recording(meta, sensors, streams, Truth(_truth(params, c, e)))


def targets(params: Params, rng: np.random.Generator) -> tuple[Array, Array, int]:
    """Centres (L, 3), extents (L, 6), and how many empty draws went before."""
    lower, upper = params.box
    retained = params.mean_targets / float(np.prod(upper - lower))
    empty = 0
    while not len(c := matern_ii(lower, upper, params.hard_core_radius, retained, rng)):
        empty += 1
    row, column = np.tril_indices(3)
    ends = zip(params.extent_diagonal, params.extent_off_diagonal, strict=True)
    low, high = (np.where(row == column, d, o) for d, o in ends)
    return c, rng.uniform(low, high, size=(len(c), 6)), empty


def sensor_state(params: Params, sensor: int, epoch: int, rng: np.random.Generator) -> ofdm.State:
    """The radar ``sensor`` in ``epoch`` (from 0), with the precoders that it draws there."""
    position = np.array(params.starts[sensor]) + epoch * params.epoch * np.array(
        params.velocities[sensor]
    )
    unaimed = ofdm.State(params.radar, position, np.eye(3), np.zeros((0, params.side**2)))
    q, R = ofdm.local(unaimed, np.array(params.focus))
    f = ofdm.precoders(params.radar, q / R, params.directed, params.others, rng)
    return ofdm.State(params.radar, position, unaimed.rotation, f)


def _scan(
    params: Params, state: ofdm.State, c: Array, e: Array, rng: np.random.Generator
) -> dict[str, Array]:
    """Columns of one scan, in random order."""
    mean = ofdm.p_detect(state, c) * np.maximum(1.0, extent.volume(e) * ofdm.resolution(state, c))
    origin = np.repeat(np.arange(len(c)), rng.poisson(mean))
    m = len(origin)
    v = c[origin] + (extent.triangular(e)[origin] @ rng.normal(size=(m, 3, 1)))[..., 0]
    S = ofdm.covariance(state, v)
    noise = np.linalg.cholesky(S) @ rng.normal(size=(m, 3, 1))
    false = rng.uniform(*params.box, (rng.poisson(params.clutter_rate), 3))
    z = np.vstack([v + noise[..., 0], false]) - state.position
    point = np.vstack([v, np.full((len(false), 3), np.nan)])
    label = np.concatenate([origin, np.full(len(false), -1)]).astype(np.int32)
    order = rng.permutation(len(z))
    columns = dict(zip("xyz", z[order].T.copy(), strict=True))
    origins = zip(("origin_x", "origin_y", "origin_z"), point[order].T.copy(), strict=True)
    S = np.vstack([S[:, *UPPER], np.full((len(false), 6), np.nan)])[order]
    pairs = ("xyz"[i] + "xyz"[j] for i, j in zip(*UPPER, strict=True))
    noises = {f"origin_cov_{pair}": S[:, i].copy() for i, pair in enumerate(pairs)}
    return columns | {"origin_id": label[order]} | dict(origins) | noises


def _times(params: Params) -> Array:
    seconds = np.arange(1, params.epochs + 1) * params.epoch
    return np.asarray(np.rint(seconds * 1e9).astype(np.int64))


def _sensor(params: Params, states: list[ofdm.State]) -> Sensor:
    position = np.array([s.position for s in states])
    upright = np.tile([0.0, 0.0, 0.0, 1.0], (len(states), 1))
    return Sensor("radar", _times(params), position, upright)


def _stream(
    params: Params,
    grid: Grid,
    node: str,
    states: list[ofdm.State],
    scans: list[dict[str, Array]],
) -> Stream:
    nodes = grid.nodes()
    S = np.array([ofdm.covariance(s, nodes) for s in states])
    tables = {f"cov_{'xyz'[i]}{'xyz'[j]}_table": S[..., i, j] for i, j in zip(*UPPER, strict=True)}
    model = tables | {
        "clutter_region": np.array(params.region),
        "clutter_beyond": 1e-6,
        "hard_core_radius": params.hard_core_radius,
        "p_false": params.p_false,
        "outside_variance": params.outside_variance,
        "grid_origin": grid.origin,
        "grid_spacing": grid.spacing,
        "p_detect_table": np.array([ofdm.p_detect(s, nodes) for s in states]),
        "bandwidth": params.radar.bandwidth,
        "side": params.side,
        "azimuth_factor": params.azimuth_factor,
        "elevation_factor": params.elevation_factor,
        "max_resolution": params.max_resolution,
    }
    offset = np.concatenate([[0], np.cumsum([len(s["x"]) for s in scans])]).astype(np.int64)
    rows = {key: np.concatenate([s[key] for s in scans]) for key in scans[0]}
    return Stream("position", (node,), model, _times(params), offset, {}, rows)


def _truth(params: Params, c: Array, e: Array) -> Objects:
    n, m = params.epochs, len(c)
    kind, axes, rotation = extent.ellipsoid(extent.covariance(e))
    return Objects(
        _times(params),
        np.arange(n + 1, dtype=np.int64) * m,
        np.tile(np.arange(m, dtype=np.int64), n),
        ("x", "y", "z", *extent.names(3)),
        ("m",) * 9,
        np.tile(np.hstack([c, e]), (n, 1)),
        extent_kind=kind,
        semi_axes=np.tile(axes, (n, 1)),
        rotation=np.tile(rotation, (n, 1)),
    )

"""What the jump chain and its baselines assume about targets and sensors, and its moves."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models.parameters import parameter, require
from ...models.records import Array
from . import plane
from .kernels.posterior import KINDS, MAX_GATE


@dataclass(frozen=True, slots=True)
class TargetParams:
    """Prior of the targets."""

    TITLE = "targets"

    clutter_region: tuple[float, ...] = parameter(
        (), "m", "x_min x_max y_min y_max [z_min z_max]: where targets and clutter are"
    )
    hard_core_radius: float = parameter(6.0, "m", "no two centres are nearer", within="[0, inf)")
    extent_diagonal: tuple[float, float] = parameter(
        (1.0, 1.5),
        "m",
        "range of the diagonal elements of the extent's triangular matrix",
        within="(0, inf)",
    )
    extent_off_diagonal: tuple[float, float] = parameter(
        (-0.5, 0.5), "m", "range of the elements below the diagonal"
    )

    def __post_init__(self) -> None:
        r = self.clutter_region
        require(len(r) in (0, 4, 6), "clutter_region", "two or three pairs", r)
        full = all(a < b for a, b in zip(r[::2], r[1::2], strict=True))
        require(full, "clutter_region", "of a volume, with increasing pairs", r)
        for name in ("extent_diagonal", "extent_off_diagonal"):
            low, high = getattr(self, name)
            require(low <= high, name, "increasing", (low, high))

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return len(self.clutter_region) // 2

    @property
    def box(self) -> tuple[Array, Array]:
        """Lower and upper corner (3,) of the region, flat along z in the plane."""
        return plane.box(self.clutter_region)

    @property
    def extent_box(self) -> tuple[Array, Array]:
        """Least and largest extent parameters (6,)."""
        row, column = np.tril_indices(3)
        ends = zip(self.extent_diagonal, self.extent_off_diagonal, strict=True)
        low, high = (np.where(row == column, d, o) for d, o in ends)
        return (low, high) if self.dimension == 3 else plane.extents(low, high)


@dataclass(frozen=True, slots=True)
class SceneParams(TargetParams):
    """Prior of the targets and what is assumed about the sensors."""

    TITLE = "sensors"
    STREAMS = ("position", "range_bearing")

    clutter_beyond: float = parameter(
        1.0,
        "1",
        "density of false detections beyond the region, relative to that in it: near 0 where it is "
        "known that there are none",
        within="(0, 1]",
    )
    p_detect: float | None = parameter(
        None, "1", "detection probability, where no table is", within="[0, 1]"
    )
    p_false: float = parameter(
        1e-3, "1", "least detection probability; that beyond the tables", within="(0, 1)"
    )
    outside_variance: float = parameter(
        20.0, "m2", "variance of errors beyond the tables", within="(0, inf)"
    )
    resolution: float = parameter(
        0.0,
        "m-2 or m-3",
        "resolved points per volume of a target, where the radar's is not known",
        within="[0, inf)",
    )
    std_position: float = parameter(
        0.0, "m", "noise of positions, where the rows state none", within="[0, inf)"
    )
    std_range: float = parameter(
        0.0, "m", "noise of ranges, where the rows state none", within="[0, inf)"
    )
    std_azimuth: float = parameter(
        0.0, "rad", "noise of azimuths, where the rows state none", within="[0, inf)"
    )
    std_elevation: float = parameter(0.0, "rad", "noise of elevations", within="[0, inf)")
    max_range: float = parameter(
        0.0, "m", "end of the view where scans state none; 0: nowhere", within="[0, inf)"
    )
    cell: float = parameter(2.5, "m", "cell of tables that are made here", within="(0, inf)")
    gate: float = parameter(
        50.0,
        "1",
        "squared Mahalanobis distance beyond which eta is zero",
        within=f"(0, {MAX_GATE:g}]",
    )
    sensors: Any = parameter({}, "1", "what differs for single streams: name to parameters")
    memory: float = parameter(4.0, "GB", "refuse more detections than it holds", within="(0, inf)")
    max_targets: int = parameter(
        0,
        "1",
        "most targets at a time; 0: one for every four detections, at least 64, in half the memory",
        within="[0, inf)",
    )

    def __post_init__(self) -> None:
        TargetParams.__post_init__(self)
        require(isinstance(self.sensors, Mapping), "sensors", "a mapping", self.sensors)

    def places(self, detections: int) -> int:
        """Most targets at a time beside so many detections."""
        if self.max_targets:
            return self.max_targets
        return max(64, min(detections // 4, int(self.memory / 16e-9 / max(detections, 1))))


@dataclass(frozen=True, slots=True)
class ChainParams(SceneParams):
    """Moves, their lengths and numbers."""

    TITLE = "jump chain"

    moves: tuple[float, ...] = parameter(
        (0.3, 0.4, 0.1, 0.1, 0.1, 0.0),
        "1",
        "weights of the moves: position, extent, birth, death, relocation, and the paper's jump",
        within="[0, inf)",
    )
    informed: bool = parameter(
        True, "1", "steps that shrink with the detections expected; else the paper's"
    )
    acceptance: float = parameter(
        0.35, "1", "acceptance of steps that burn-in adapts to", within="(0, 1)"
    )
    spread: float = parameter(
        1.0, "m", "spread of births about unexplained detections", within="(0, inf)"
    )
    uniform: float = parameter(0.05, "1", "share of births anywhere", within="(0, 1]")
    table_points: int = parameter(
        100, "1", "mean number of detections in the paper's birth table", within="[1, inf)"
    )
    table_extents: int = parameter(
        20, "1", "extents that estimate its birth rates", within="[1, inf)"
    )
    table_radius: float = parameter(0.2, "m", "radius of its balls", within="(0, inf)")
    intensity: float | None = parameter(
        None,
        "m-2 or m-3",
        "intensity of targets where it is known, else estimated",
        within="(0, inf)",
    )
    clutter_rate: float | None = parameter(
        None,
        "1",
        "false detections per scan where they are known, else estimated",
        within="(0, inf)",
    )
    room: bool = parameter(
        True,
        "1",
        "the intensity of targets is their number per volume that others leave them, that of the "
        "hard-core process; else, as printed, per volume of all of the region",
    )
    smoothing: int = parameter(
        10, "1", "blocks over which estimated intensities are averaged", within="[1, inf)"
    )
    block: int = parameter(
        500, "1", "moves between updates of steps and intensities", within="[1, inf)"
    )
    burn_in: int = parameter(15_000, "1", "least number of moves of the burn-in", within="[0, inf)")
    restart: bool = parameter(
        True,
        "1",
        "a second burn-in, from clusters in the first epoch and then from no targets at all; the "
        "better goes on",
    )
    max_burn_in: int = parameter(
        40_000, "1", "largest number of moves of the burn-in", within="[1, inf)"
    )
    patience: int = parameter(
        5000, "1", "moves without a better posterior that end the burn-in", within="[1, inf)"
    )
    explore: int = parameter(
        30_000, "1", "moves, with births and deaths, that count the targets", within="[0, inf)"
    )
    max_explore: int = parameter(
        120_000, "1", "the same while the number of targets changes within so many moves"
    )
    samples: int = parameter(100, "1", "samples", within="[1, inf)")
    thin: int = parameter(300, "1", "moves from one sample to the next", within="[1, inf)")

    def __post_init__(self) -> None:
        SceneParams.__post_init__(self)
        m = self.moves
        ok = len(m) == len(KINDS) and m[0] + m[1] > 0 and m[2] == m[3]
        require(ok, "moves", "six weights, some of steps, births as often as deaths", m)
        for name in ("burn_in", "explore"):
            most = getattr(self, f"max_{name}")
            require(most >= getattr(self, name), f"max_{name}", f"at least {name}", most)

"""How range-angle maps become detections: the parameters of the way."""

from __future__ import annotations

from dataclasses import dataclass

from ...models.classifier import CELL, CLASSES
from ...models.geometry.regions import polygon
from ...models.parameters import parameter, require

LARGEST = 4_000_000
"""Pixels of the largest soft map."""


MAPS = "range_angle_map"
"""The kind of streams that hold maps."""


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class FusionParams:
    """Which maps are looked at together, and where."""

    TITLE = "maps"
    STREAMS = (MAPS,)

    map_region: tuple[float, float, float, float] = parameter(
        (-20.0, 20.0, -20.0, 20.0), "m", "x_min, x_max, y_min, y_max of the soft map"
    )
    stations: int | None = parameter(
        None, "1", "how many streams of maps are fused, the first by name; null: all"
    )
    fuse_within: float | None = parameter(
        None,
        "s",
        "maps taken within this are fused, one of a station; null: 0.9 of the shortest period of a "
        "station; 0: only those of one time",
        within="[0, inf)",
    )

    def __post_init__(self) -> None:
        polygon(self.map_region, "map_region")
        if self.stations is not None:
            require(self.stations >= 1, "stations", "at least 1, or null for all", self.stations)


@dataclass(frozen=True)
class MapParams(FusionParams):
    """The way from maps to detections; defaults suit 28 GHz maps."""

    TITLE = "from maps to detections"
    STREAMS = (MAPS,)

    detector: str = parameter(
        "clusters",
        "1",
        "what makes detections of maps. clusters: of bright pixels, by what follows; templates: "
        "what targets reflect, fitted to the maps as tbd does, for stations that state their "
        "waveform",
        within=("clusters", "templates"),
    )
    map_cell: float = parameter(0.1, "m", "side of its pixels", within="(0, inf)")
    excision: float = parameter(
        100.0,
        "1",
        "bright pixels exceed so many times the noise, which is one for each station that sees "
        "them, where 1 m2 at 50 m is 35 dB above it; the power in other recordings is scaled by "
        "the reference echo that they state",
        within="[0, inf)",
    )
    excision_new: float = parameter(
        0.0, "1", "the same for pixels of no known target, if it is more", within="[0, inf)"
    )
    gate_pedestrian: float = parameter(
        4.0,
        "m",
        "bright pixels belong to the nearest known target within this, if it walks",
        within="(0, inf)",
    )
    gate_vehicle: float = parameter(6.0, "m", "the same for a vehicle", within="(0, inf)")
    room_pedestrian: float = parameter(
        0.0,
        "m",
        "radius that a pedestrian has to itself: where two overlap, one is a double",
        within="[0, inf)",
    )
    room_vehicle: float = parameter(0.0, "m", "the same for a vehicle", within="[0, inf)")
    pair: tuple[float, float] = parameter(
        (0.0, 0.0),
        "m",
        "a pedestrian whose brightest pixels have two centres whose distance lies between these is "
        "two, if the network agrees; equal, or without network: never",
        within="[0, inf)",
    )
    min_pixels: int = parameter(
        10, "1", "least bright pixels of a known target for a detection", within="[1, inf)"
    )
    spread: float = parameter(
        1.0,
        "1",
        "variance of a detection over that of its pixels; 1: eq. 15 as it stands",
        within="(0, inf)",
    )
    dbscan_radius: float = parameter(
        3.0, "m", "neighbourhood of the other bright pixels", within="(0, inf)"
    )
    dbscan_points: int = parameter(
        50, "1", "least neighbours of a core pixel, itself included", within="[1, inf)"
    )
    identify: str = parameter(
        "cnn", "1", "who tells the classes of targets", within=("cnn", "none")
    )
    weights: str = parameter(
        "", "file", "file with the network's weights; empty: those that we ship"
    )
    class_memory: float = parameter(
        0.0,
        "1",
        "log-probabilities of a target's class are the mean of those of all scans, each with this "
        "times the weight of the next; 0: of the last alone",
        within="[0, 1)",
    )
    class_prior: tuple[float, ...] = parameter(
        (),
        "1",
        "shares of pedestrians and vehicles where the radars stand, in place of those among what "
        "the network has learnt from; empty: the same",
        within="(0, inf)",
    )

    def __post_init__(self) -> None:
        FusionParams.__post_init__(self)
        x0, x1, y0, y1 = self.map_region
        count = (x1 - x0) / self.map_cell * (y1 - y0) / self.map_cell
        require(count <= LARGEST, "map_cell", f"so that {LARGEST} pixels suffice", self.map_cell)
        require(self.pair[0] <= self.pair[1], "pair", "in order", self.pair)
        room = 2 * self.room_pedestrian
        apart = self.pair[0] == self.pair[1] or self.pair[0] >= room
        require(apart, "pair", f"at least twice room_pedestrian, {room:g}", self.pair)
        shares = len(self.class_prior) in (0, len(CLASSES))
        require(shares, "class_prior", f"one share each of {' '.join(CLASSES)}", self.class_prior)
        if self.identify == "cnn":
            rule = f"{CELL} m, the pixels of the network, unless identify is none"
            require(self.map_cell == CELL, "map_cell", rule, self.map_cell)
        else:
            same = self.gate_pedestrian == self.gate_vehicle
            rule = "gate_pedestrian where nobody tells classes"
            require(same, "gate_vehicle", rule, self.gate_vehicle)

    @property
    def gates(self) -> tuple[float, ...]:
        """The gates of all classes [m]."""
        return tuple(getattr(self, f"gate_{name}") for name in CLASSES)

    @property
    def rooms(self) -> tuple[float, ...]:
        """The rooms of all classes [m]."""
        return tuple(getattr(self, f"room_{name}") for name in CLASSES)

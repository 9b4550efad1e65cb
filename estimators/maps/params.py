"""What filters of point targets assume about range-angle maps, and how they make detections."""

from __future__ import annotations

from dataclasses import dataclass

from ...models.classifier import CELL, CLASSES
from ...models.parameters import parameter, require
from ...models.regions import polygon
from ..points.targets import TargetParams

TUNED = {
    "p_detect": 0.99,
    "p_survive": 0.999,
    "clutter_rate": 0.1,
    "std_acceleration": 2.0,
    # Not at the site plan's places: who is told apart only after leaving them would never appear.
    "birth": "detections",
    "birth_rate": 0.1,
    "birth_std_velocity": (2.0, 2.0),
    "gate_pedestrian": 3.0,
    "gate_vehicle": 5.0,
    "room_pedestrian": 0.65,
    "room_vehicle": 2.8,
    "pair": (1.5, 3.5),
    "excision_new": 400.0,
    "dbscan_points": 30,
    "spread": 0.1,
    "class_memory": 0.9,
}
"""What works best on maps of base stations in both filters, chosen on other recordings than those
that are reported: few bodies overlap, and doubles of a target and sidelobes cost the most."""
IDENTIFY = ("cnn", "none")
LARGEST = 4_000_000
"""Pixels of the largest soft map."""


@dataclass(frozen=True, slots=True)
class MapParams(TargetParams):
    """Sensors and targets, and the way from maps to detections; defaults suit 28 GHz maps."""

    map_region: tuple[float, float, float, float] = parameter(
        (-20.0, 20.0, -20.0, 20.0), "m", "x_min, x_max, y_min, y_max of the soft map"
    )
    map_cell: float = parameter(0.1, "m", "side of its pixels")
    stations: int | None = parameter(
        None, "1", "how many streams of maps are fused, the first by name; null: all"
    )
    excision: float = parameter(
        100.0, "1", "bright pixels exceed so many times the noise, which is one for each station"
    )
    excision_new: float = parameter(
        0.0, "1", "the same for pixels of no known target, if it is more"
    )
    gate_pedestrian: float = parameter(
        4.0, "m", "bright pixels belong to the nearest known target within this, if it walks"
    )
    gate_vehicle: float = parameter(6.0, "m", "the same for a vehicle")
    room_pedestrian: float = parameter(
        0.0, "m", "radius that a pedestrian has to itself: where two overlap, one is a double"
    )
    room_vehicle: float = parameter(0.0, "m", "the same for a vehicle")
    pair: tuple[float, float] = parameter(
        (0.0, 0.0),
        "m",
        "a pedestrian whose brightest pixels have two centres whose distance lies between these is "
        "two, if the network agrees; equal, or without network: never",
    )
    min_pixels: int = parameter(10, "1", "least bright pixels of a known target for a detection")
    spread: float = parameter(
        1.0, "1", "variance of a detection over that of its pixels; 1: eq. 15 as it stands"
    )
    dbscan_radius: float = parameter(3.0, "m", "neighbourhood of the other bright pixels")
    dbscan_points: int = parameter(50, "1", "least neighbours of a core pixel, itself included")
    identify: str = parameter("cnn", "1", "who tells the classes of targets: cnn or none")
    weights: str = parameter("", "1", "file with the network's weights; empty: those that we ship")
    class_memory: float = parameter(
        0.0, "1", "factor that a target's log-probabilities keep from scan to scan; 0: none"
    )

    def __post_init__(self) -> None:
        TargetParams.__post_init__(self)
        polygon(self.map_region, "map_region")
        for name in ("map_cell", "gate_pedestrian", "gate_vehicle", "dbscan_radius", "spread"):
            require(getattr(self, name) > 0, name, "positive", getattr(self, name))
        x0, x1, y0, y1 = self.map_region
        count = (x1 - x0) / self.map_cell * (y1 - y0) / self.map_cell
        require(count <= LARGEST, "map_cell", f"so that {LARGEST} pixels suffice", self.map_cell)
        for name in ("room_pedestrian", "room_vehicle"):
            require(getattr(self, name) >= 0, name, "at least 0", getattr(self, name))
        require(0 <= self.pair[0] <= self.pair[1], "pair", "at least 0 and in order", self.pair)
        room = 2 * self.room_pedestrian
        apart = self.pair[0] == self.pair[1] or self.pair[0] >= room
        require(apart, "pair", f"at least twice room_pedestrian, {room:g}", self.pair)
        for name in ("excision", "excision_new"):
            require(getattr(self, name) >= 0, name, "at least 0", getattr(self, name))
        for name in ("min_pixels", "dbscan_points"):
            require(getattr(self, name) >= 1, name, "at least 1", getattr(self, name))
        if self.stations is not None:
            require(self.stations >= 1, "stations", "at least 1, or null for all", self.stations)
        require(
            self.identify in IDENTIFY, "identify", f"one of {' '.join(IDENTIFY)}", self.identify
        )
        require(0 <= self.class_memory < 1, "class_memory", "in [0, 1)", self.class_memory)
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

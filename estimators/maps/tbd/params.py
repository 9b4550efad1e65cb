"""What track-before-detect assumes about targets and maps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....models.parameters import parameter
from ....models.radar.reflectors import Reflectors, pedestrian, vehicle
from ....models.records import Array
from ...kernels.passes import SmoothParams
from ..params import FusionParams


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class BodyParams:
    """What pedestrians and vehicles reflect, in the mean; a target's brightness scales it."""

    TITLE = "bodies"

    vehicle_length: float = parameter(4.5, "m", "length of a vehicle", within="(0, inf)")
    vehicle_width: float = parameter(1.8, "m", "width of a vehicle", within="(0, inf)")
    rcs_pedestrian: float = parameter(1.0, "m2", "of a pedestrian", within="(0, inf)")
    rcs_surface: float = parameter(20.0, "m2", "of each side of a vehicle", within="[0, inf)")
    rcs_corner: float = parameter(5.0, "m2", "of each corner", within="(0, inf)")
    std_body: float = parameter(
        0.0,
        "m",
        "deviation along each axis of a vehicle's middle from where its body has it, if that is "
        "another than the one stated: the same for long, so that no map tells and covariances that "
        "are given have it added",
        within="[0, inf)",
    )
    surface_visibility: tuple[float, float] = parameter(
        (0.05, 0.2), "rad", "off its normal a side is seen whole up to, not at all beyond"
    )
    corner_visibility: tuple[float, float] = parameter((1.7, 2.35), "rad", "likewise a corner")

    @property
    def bodies(self) -> list[Array]:
        """Points (L, 6) of a pedestrian and of a vehicle, as the kernels take them."""
        car = vehicle(
            self.vehicle_length,
            self.vehicle_width,
            (self.rcs_surface, 0.0, self.rcs_corner),
            self.surface_visibility,
            (0.0, 0.0),
            self.corner_visibility,
        )
        return [_columns(pedestrian(self.rcs_pedestrian)), _columns(car)]


def _columns(body: Reflectors) -> Array:
    shown = body.rcs > 0
    columns = body.position, body.rcs[:, None], body.axis[:, None]
    rows = np.hstack((*columns, body.inner[:, None], body.outer[:, None]))
    return np.ascontiguousarray(rows[shown])


@dataclass(frozen=True)
class Params(BodyParams, SmoothParams, FusionParams):
    """Likelihood, motion, and how targets come and go."""

    TITLE = "targets"

    shape: float = parameter(
        3.0,
        "1",
        "how well the mean of a cell is known: shape of the inverse gamma about it",
        within="(0, inf)",
    )
    weight: float = parameter(
        0.4,
        "1",
        "independent cells for one of the map: what an echo spreads over fluctuates together",
        within="(0, 1]",
    )
    dynamic_range: float = parameter(
        22.0,
        "dB",
        "what stands so far below the echo of 1 m2 at its range tells nothing: sidelobes",
        within="(0, inf)",
    )
    acceleration_density: float = parameter(
        0.5, "m2 s-3", "white acceleration in continuous time", within="(0, inf)"
    )
    turn_density: float = parameter(
        0.1, "rad2 s-1", "random walk of a vehicle's heading", within="(0, inf)"
    )
    slip: float = parameter(
        0.3, "m s-1", "deviation of a vehicle's speed across its heading", within="(0, inf)"
    )
    std_brightness: float = parameter(
        0.3,
        "1",
        "deviation of a target's log brightness from what a body of its class has",
        within="(0, inf)",
    )
    std_size: float = parameter(
        0.2, "1", "deviation of a vehicle's log size from what is stated", within="(0, inf)"
    )
    size_time: float = parameter(
        100.0, "s", "time over which it is known no more", within="(0, inf)"
    )
    brightness_time: float = parameter(2.0, "s", "time over which it changes", within="(0, inf)")
    std_speed: float = parameter(
        2.0, "m s-1", "deviation of each velocity of a new target", within="(0, inf)"
    )
    birth_spacing: float = parameter(
        0.5, "m", "spacing of the places where targets are looked for", within="(0, inf)"
    )
    birth_price: float = parameter(
        6.0, "1", "log-likelihood, by independent cells, that a new target must add"
    )
    live_price: float = parameter(
        0.5, "1", "the same that a target must add in every scan to be held", within="[0, inf)"
    )
    rethink: int = parameter(
        40, "1", "scans after which a target is explained anew", within="[1, inf)"
    )
    extract_existence: float = parameter(
        0.5, "1", "least probability of existence of what is shown", within="[0, 1)"
    )

    def __post_init__(self) -> None:
        FusionParams.__post_init__(self)
        SmoothParams.__post_init__(self)

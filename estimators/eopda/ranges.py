"""What the extended-object estimators share: how many ranges are direct, scattered and false."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from ...models.parameters import parameter, require
from ...models.records import Array
from . import params as device_params


@dataclass(frozen=True, slots=True)
class Params(device_params.Params):
    """Parameters of a carried device on an extended object that scatters."""

    TITLE = "object that scatters"
    mean_los: float = parameter(
        1.0, "1", "mean number of direct ranges per active link event", within="[0, inf)"
    )
    mean_scatter: float = parameter(
        5.0,
        "1",
        "mean number of scattered ranges per link event; 0: the device has no object",
        within="[0, inf)",
    )
    opening_angle: float = parameter(
        2 * pi / 3, "rad", "opening angle of the scattering sector", within="(0, 6.283185307179587]"
    )
    axes_prior: tuple[float, float] = parameter(
        (0.1, 0.5), "m", "range of the first semi-axes", within="(0, inf)"
    )
    width_prior: tuple[float, float] = parameter(
        (0.01, 0.2), "m", "range of the first width", within="(0, inf)"
    )
    axes_std: float = parameter(0.05, "m", "random walk of the semi-axes", within="[0, inf)")
    width_std: float = parameter(0.05, "m", "random walk of the sector's width", within="[0, inf)")

    def __post_init__(self) -> None:
        device_params.Params.__post_init__(self)
        for name in ("axes_prior", "width_prior"):
            low, high = getattr(self, name)
            require(low <= high, name, "low <= high", (low, high))

    @property
    def los(self) -> float:
        """Mean number of ranges of an active link that are its line of sight."""
        return self.mean_los

    @property
    def has_object(self) -> bool:
        """Whether there is an object that scatters."""
        return self.mean_scatter > 0

    @property
    def scatter(self) -> float:
        """Mean number of ranges of a link that are scattered."""
        return self.mean_scatter

    def prior(self, axes: int) -> Array:
        """Bounds (2, axes + 1) of the uniform prior of the semi-axes and the width."""
        return np.array([self.axes_prior] * axes + [self.width_prior]).T

    def walk(self, axes: int) -> Array:
        """Random walk (axes + 1,) [m] of the semi-axes and the width per 0.1 s."""
        return np.array([self.axes_std] * axes + [self.width_std])

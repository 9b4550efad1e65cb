"""Parameters of every filter for a UWB device that an object carries."""

from __future__ import annotations

from dataclasses import dataclass

from ...models.parameters import parameter, require

LEAST_CLUTTER = 1e-3
"""Mean number of false ranges assumed at least, so that one outlier cannot veto all particles."""


@dataclass(frozen=True, slots=True)
class Params:
    """Parameters that all filters of a carried device share; random walks are per 0.1 s."""

    TITLE = "device, start and motion"
    STREAMS = ("uwb",)
    particles: int = parameter(5000, "1", "number of particles", within="[100, inf)")
    candidates: int = parameter(
        4, "1", "device positions that each particle tries per step", within="[1, inf)"
    )
    device: str | None = parameter(None, "", "device to track, where the recording has several")
    area: tuple[float, float, float, float] | None = parameter(
        None, "m", "x min, y min, x max, y max of the start; the anchors' bounding box by default"
    )
    speed_std: float = parameter(
        1.0, "m s-1", "standard deviation of the first velocity, per axis", within="[0, inf)"
    )
    bias_prior: tuple[float, float] = parameter(
        (0.0, 0.6), "m", "range of the first b_rho", within="[0, inf)"
    )
    acceleration_std: float = parameter(
        2.0, "m s-2", "standard deviation of the acceleration", within="[0, inf)"
    )
    bias_distance_std: float = parameter(0.1, "m", "random walk of b_rho", within="[0, inf)")
    bias_angle_std: float = parameter(0.5, "rad", "random walk of b_phi", within="[0, inf)")
    mean_clutter: float = parameter(
        5.0, "1", "mean number of false ranges per link event", within="[0, inf)"
    )
    max_range: float = parameter(20.0, "m", "false ranges are uniform up to it", within="(0, inf)")
    rms_bandwidth: float | None = parameter(
        None, "Hz", "root mean squared bandwidth: amplitude to range noise", within="(0, inf)"
    )
    amplitude_threshold: float = parameter(
        1.0, "1", "lowest normalised amplitude detected", within="(0, inf)"
    )
    sigma: float | None = parameter(
        None,
        "m",
        "standard deviation of ranges that come with neither amplitude nor std",
        within="(0, inf)",
    )
    range_bias: float = parameter(0.0, "m", "constant that every range has too much")
    range_bias_std: float = parameter(
        0.0,
        "m",
        "prior standard deviation of the range bias; above 0 it is estimated",
        within="[0, inf)",
    )

    def __post_init__(self) -> None:
        low, high = self.bias_prior
        require(low <= high, "bias_prior", "low <= high", self.bias_prior)
        if self.area is not None:
            x, y, x_max, y_max = self.area
            require(x < x_max and y < y_max, "area", "x min, y min < x max, y max", self.area)

    @property
    def clutter(self) -> float:
        """Density of false ranges [1/m]."""
        return max(self.mean_clutter, LEAST_CLUTTER) / self.max_range

    @property
    def los(self) -> float:
        """Mean number of ranges of an active link that are its line of sight."""
        return 1.0

    @property
    def has_object(self) -> bool:
        """Whether there is an object that scatters; without one the device is its own centre."""
        return True

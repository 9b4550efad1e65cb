"""Parameters of every filter for a UWB device, on an object or alone."""

from __future__ import annotations

from dataclasses import dataclass

from ...models.parameters import parameter, require
from ..kernels.passes import SmoothParams
from .odometry import Odometry

LEAST_CLUTTER = 1e-3
"""Mean number of false ranges assumed at least, so that one outlier cannot veto all particles."""
LEARNABLE = ("walks", "rates", "sigma", "bias", "height", "scale")
"""What can be learnt from the recording."""


@dataclass(frozen=True, slots=True)
class Ranges(Odometry):
    """What is known about ranges: noise, what they have too much, false ones, heights."""

    TITLE = "ranges"
    STREAMS = ("uwb",)
    mean_clutter: float = parameter(
        5.0, "1", "mean number of false ranges per link event", within="[0, inf)"
    )
    max_range: float | None = parameter(
        None,
        "m",
        "false ranges are uniform up to it; without it, up to the largest at first and a margin",
        within="(0, inf)",
    )
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
    sigma_factor: float = parameter(
        1.0, "1", "factor of all standard deviations of ranges", within="(0, inf)"
    )
    tdoa_correlation: float = parameter(
        0.5,
        "1",
        "correlation of differences to one anchor: 0.5 if all arrivals are equally noisy",
        within="[0, 1)",
    )
    range_bias: float = parameter(0.0, "m", "what every range has too much, at first")
    range_bias_std: float = parameter(
        0.0, "m", "its standard deviation; above 0 it is estimated, by anchor", within="[0, inf)"
    )
    range_bias_spread: float = parameter(
        0.1, "m", "standard deviation of an anchor's own part of it", within="[0, inf)"
    )
    range_bias_walk: float = parameter(
        0.02, "m s-1/2", "random walk of an anchor's own part", within="[0, inf)"
    )
    range_scale_std: float = parameter(
        0.0,
        "1",
        "standard deviation of the share by which all are too long; above 0 it is estimated",
        within="[0, 0.5]",
    )
    range_error: str = parameter(
        "both",
        "",
        "where offset and scale are estimated: both at once, or either the one or the other",
        within=("both", "either"),
    )
    device_height: float | None = parameter(
        None,
        "m",
        "height of the device and its object; without it the anchors' heights, or estimated",
        within="[0, inf)",
    )
    device_height_std: float = parameter(
        0.0, "m", "its standard deviation; above 0 it is estimated", within="[0, inf)"
    )
    height_walk: float = parameter(
        0.02, "m s-1/2", "random walk of a height that is estimated", within="[0, inf)"
    )


@dataclass(frozen=True, slots=True)
class Params(Ranges, SmoothParams):
    """Parameters that all filters of a device share; random walks are per 0.1 s."""

    TITLE = "device, start and motion"
    STREAMS = ("uwb",)
    particles: int = parameter(5000, "1", "number of particles", within="[100, inf)")
    candidates: int = parameter(
        4, "1", "device positions that each particle tries per step", within="[1, inf)"
    )
    device: str | None = parameter(None, "", "device to track, where the recording has several")
    area: tuple[float, float, float, float] | None = parameter(
        None,
        "m",
        "x min, y min, x max, y max of the start; by default wherever an anchor could hear it",
    )
    speed_std: float = parameter(
        1.0, "m s-1", "standard deviation of the first velocity, per axis", within="(0, inf)"
    )
    bias_prior: tuple[float, float] = parameter(
        (0.0, 0.6), "m", "range of the first b_rho", within="[0, inf)"
    )
    acceleration_std: float = parameter(
        2.0, "m s-2", "standard deviation of the acceleration", within="[0, inf)"
    )
    bias_distance_std: float = parameter(0.1, "m", "random walk of b_rho", within="[0, inf)")
    bias_angle_std: float = parameter(0.5, "rad", "random walk of b_phi", within="[0, inf)")
    keep: int = parameter(
        0,
        "1",
        "device positions kept per step, drawn by weight: an ambiguity is several clouds",
        within="[0, inf)",
    )
    learn: tuple[str, ...] = parameter(
        (),
        "",
        "what to learn from the recording itself before it is estimated; all: all of them",
        within=(*LEARNABLE, "all"),
    )
    learn_span: float = parameter(
        60.0, "s", "how much of the recording is learnt from", within="(0, inf)"
    )

    def __post_init__(self) -> None:
        SmoothParams.__post_init__(self)
        low, high = self.bias_prior
        require(low <= high, "bias_prior", "low <= high", self.bias_prior)
        if self.area is not None:
            x, y, x_max, y_max = self.area
            require(x < x_max and y < y_max, "area", "x min, y min < x max, y max", self.area)

    @property
    def clutter(self) -> float:
        """Density of false ranges [1/m]; ``max_range`` must be known by now."""
        assert self.max_range is not None
        return max(self.mean_clutter, LEAST_CLUTTER) / self.max_range

    @property
    def los(self) -> float:
        """Mean number of ranges of an active link that are its line of sight."""
        return 1.0

    @property
    def late(self) -> float:
        """Share of the direct ranges that come over a detour, of mean length ``detour``."""
        return 0.0

    @property
    def detour(self) -> float:
        """Mean length [m] of what late ranges have too much."""
        return 1.0

    @property
    def noise_time(self) -> float:
        """How long [s] the error of a range stays; see :mod:`.spacing`."""
        return 0.0

    @property
    def has_object(self) -> bool:
        """Whether there is an object that scatters; without one the device is its own centre."""
        return True

    @property
    def scatter(self) -> float:
        """Mean number of ranges of a link that are scattered."""
        return 0.0

    def expected(self, active: int, passive: int) -> float:
        """Mean number of ranges of so many links that are not false."""
        return self.los * active + self.scatter * (active + passive)

    @property
    def is_biased(self) -> bool:
        """Whether what ranges have too much is estimated."""
        return self.range_bias_std > 0 or self.range_scale_std > 0

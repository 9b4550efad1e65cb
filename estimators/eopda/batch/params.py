"""Parameters of the batch."""

from __future__ import annotations

from dataclasses import dataclass

from ....models.parameters import parameter
from .. import params as device_params
from .body import offsets

LEARNABLE = ("sigma", "acceleration", "bias", "height", "scale")
"""What can be learnt from the recording."""


@dataclass(frozen=True, slots=True)
class Params(device_params.Ranges):
    """Parameters of a device alone, all its ranges at once; defaults for measured ranges."""

    TITLE = "measured ranges"
    STREAMS = ("uwb",)
    device: str | None = parameter(None, "", "device to track, where the recording has several")
    tags: str = parameter(
        "",
        "m",
        "tags on one body, each with its place x ahead and y to the left: T0 0.1 0; T1 -0.1 0",
    )
    sigma: float | None = parameter(
        0.1,
        "m",
        "standard deviation of ranges that come with neither amplitude nor std",
        within="(0, inf)",
    )
    noise_time: float = parameter(
        0.5,
        "s",
        "how long the error of a range stays: those of a link that come faster count for less",
        within="[0, inf)",
    )
    mean_clutter: float = parameter(
        0.1, "1", "mean number of false ranges per link event", within="[0, inf)"
    )
    mean_los: float = parameter(
        1.0, "1", "mean number of direct ranges per link event", within="(0, inf)"
    )
    tail: float = parameter(
        4.0, "1", "degrees of freedom of Student's noise: 1 for Cauchy's", within="[1, inf)"
    )
    range_bias_std: float = parameter(
        0.3,
        "m",
        "standard deviation of what ranges have too much; above 0 it is estimated, by anchor",
        within="[0, inf)",
    )
    acceleration_std: float = parameter(
        2.0, "m s-2", "standard deviation of the acceleration", within="(0, inf)"
    )
    speed_std: float = parameter(
        1.0, "m s-1", "standard deviation of the first velocity, per axis", within="(0, inf)"
    )
    learn: tuple[str, ...] = parameter(
        LEARNABLE,
        "",
        "what to learn from the recording itself before it is estimated; []: nothing",
        within=(*LEARNABLE, "all"),
    )
    learn_span: float = parameter(
        60.0, "s", "how much of the recording is learnt from", within="(0, inf)"
    )

    def __post_init__(self) -> None:
        offsets(self.tags)

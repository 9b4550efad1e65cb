"""Where a tag is, from ranges to anchors: the filter without an object that scatters.

For what ranging kits log: one range at a time, false ones among them, too long by an amount that
nobody calibrated. See the page "Where is my tag?" of the documentation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...models.parameters import parameter
from ...models.records import Array
from . import params as device_params
from .device_filter import DeviceFilter
from .links import Links
from .state import State, Target


@dataclass(frozen=True, slots=True)
class Params(device_params.Params):
    """Parameters of a device alone, with defaults for measured ranges."""

    TITLE = "measured ranges"
    sigma: float | None = parameter(
        0.1,
        "m",
        "standard deviation of ranges that come with neither amplitude nor std",
        within="(0, inf)",
    )
    mean_clutter: float = parameter(
        0.1, "1", "mean number of false ranges per link event", within="[0, inf)"
    )
    mean_los: float = parameter(
        1.0, "1", "mean number of direct ranges per link event", within="(0, inf)"
    )
    late: float = parameter(
        0.0, "1", "share of direct ranges that come late, over a detour", within="[0, 1]"
    )
    detour: float = parameter(
        0.3, "m", "mean of what late ranges have too much; it is exponential", within="(0, inf)"
    )
    noise_time: float = parameter(
        0.0,
        "s",
        "how long the error of a range stays: those of a link that come faster count for less",
        within="[0, inf)",
    )
    range_bias_std: float = parameter(
        0.3,
        "m",
        "standard deviation of what ranges have too much; above 0 it is estimated, by anchor",
        within="[0, inf)",
    )
    learn: tuple[str, ...] = parameter(
        ("walks", "rates", "sigma", "bias", "height", "scale"),
        "",
        "what to learn from the recording itself before it is estimated; []: nothing",
        within=(*device_params.LEARNABLE, "all"),
    )

    @property
    def los(self) -> float:
        """Mean number of ranges of an active link that are its line of sight."""
        return self.mean_los

    @property
    def has_object(self) -> bool:
        """There is none."""
        return False


def _none(
    state: State, anchors: Array, links: Links, excess: tuple[Array, Array], params: Params
) -> Array:
    return np.zeros(state.y.shape[1])


DEVICE = DeviceFilter(
    "a device or tag without a body, from its ranges to anchors, with what they have too much",
    Params,
    Target(
        extent=(),
        prior=lambda params: np.zeros((2, 0)),
        walk=lambda params: np.zeros(0),
        log_likelihood=_none,
    ),
    passive=False,
)

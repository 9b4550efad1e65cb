"""Probabilistic data association with a point target: the baseline without an extent.

Each link has at most one range of the object: the line of sight to the device (active) or the path
over the centre (passive). All else is clutter: Bar-Shalom, Daum and Huang, "The probabilistic data
association filter", IEEE Control Systems Magazine 29 (2009). Compared in section V-B of Zhu et al.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...models.parameters import parameter
from ...models.records import Array
from . import params as device_params
from .device_filter import DeviceFilter
from .kernels.compiled.link_likelihood import point
from .links import Links
from .state import State, Target


@dataclass(frozen=True, slots=True)
class Params(device_params.Params):
    """Parameters of the point target."""

    TITLE = "point target"
    p_detect: float = parameter(
        0.95, "1", "probability that a link has a range of the object", within="(0, 1)"
    )

    def expected(self, active: int, passive: int) -> float:
        """No mean number: at most one range of the object a link, which has its own probability."""
        return 0.0


def log_likelihood(
    state: State, anchors: Array, links: Links, excess: tuple[Array, Array], params: Params
) -> Array:
    """Log-likelihood (N,) of particles; see :mod:`.kernels.link_likelihood`."""
    y, density = state.y, params.clutter
    own = point(y[:2], state.device, y[-1], anchors, *links, *excess, density, params.p_detect)
    total: Array = own + len(links.z) * np.log(density)
    return total


ACTIVE_PASSIVE = DeviceFilter(
    "point target with a UWB device, classic data association, active and passive links",
    Params,
    Target(
        extent=(),
        prior=lambda params: np.zeros((2, 0)),
        walk=lambda params: np.zeros(0),
        log_likelihood=log_likelihood,
    ),
)

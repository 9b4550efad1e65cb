"""EOPDA with the geometry-based scattering model: one ellipse of scatter per receiving anchor.

Zhu et al., "Multi-Sensor Fusion of Active and Passive Measurements for Extended Object Tracking",
section III, eqs. (6) to (8) and (11). The extent is a circle of radius r with scatter ellipses of
radial semi-axis w.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...models.parameters import parameter
from ...models.records import Array
from ..presets import Presets
from . import ranges as eopda
from .device_filter import DeviceFilter
from .kernels.compiled.link_likelihood import geo
from .links import Links
from .state import State, Target


@dataclass(frozen=True, slots=True)
class Params(eopda.Params):
    """Parameters of the geometry-based model."""

    TITLE = "geometry-based scattering"
    mean: str = parameter(
        "transform",
        "",
        "path length expected: of the unscented transform, or over the centre",
        within=("transform", "centre"),
    )


def log_likelihood(
    state: State, anchors: Array, links: Links, excess: tuple[Array, Array], params: Params
) -> Array:
    """Log-likelihood (N,) of particles; see :mod:`.kernels.link_likelihood`."""
    y = state.y
    return geo(
        y[:2],
        state.device,
        y[-1],
        anchors,
        *links,
        *excess,
        params.clutter,
        params.los,
        params.mean_scatter,
        y[6],
        y[7],
        params.opening_angle,
        params.mean == "transform",
    )


CIRCLE = Target(
    extent=("r", "w"),
    prior=lambda params: params.prior(1),
    walk=lambda params: params.walk(1),
    log_likelihood=log_likelihood,
    kind="circle",
    axes=(0, 0),
)
ACTIVE_PASSIVE = DeviceFilter(
    "extended object with a UWB device, geometry-based scattering, active and passive links",
    Params,
    CIRCLE,
    PRESETS=Presets(__package__, "eopda-geo"),
)
ACTIVE = DeviceFilter(
    "extended object with a UWB device, geometry-based scattering, active links only",
    Params,
    CIRCLE,
    passive=False,
)

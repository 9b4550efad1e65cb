"""EOPDA with the geometry-based scattering model: one ellipse of scatter per receiving anchor.

Zhu et al., "Multi-Sensor Fusion of Active and Passive Measurements for Extended Object Tracking",
section III, eqs. (6) to (8) and (11). The extent is a circle of radius r with scatter ellipses of
radial semi-axis w.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...models.parameters import parameter
from ...models.records import Array
from . import ranges as eopda
from .filter import DeviceFilter, Target
from .kernels.compiled.link_likelihood import geo
from .links import Links


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


def log_likelihood(y: Array, device: Array, anchors: Array, links: Links, params: Params) -> Array:
    """Log-likelihood (N,) of particles ``y``; see :mod:`.kernels.link_likelihood`."""
    return geo(
        y[:2],
        device,
        y[-1],
        anchors,
        *links,
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
)
ACTIVE = DeviceFilter(
    "extended object with a UWB device, geometry-based scattering, active links only",
    Params,
    CIRCLE,
    passive=False,
)

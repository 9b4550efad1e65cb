"""EOPDA with the ideal scattering model: scatterers fill a sector of the object's rim.

Zhu et al., "Multi-Sensor Fusion of Active and Passive Measurements for Extended Object Tracking",
section IV, eq. (12). The extent is an ellipse with semi-axes a, b along x and y and a sector of
width w. Where the paper draws scatterers at random, they stand on a lattice of the same number,
whose error is smaller.
"""

from __future__ import annotations

from dataclasses import dataclass

from ...models.parameters import parameter
from ...models.records import Array
from ...models.scatter import unit_square_nodes
from ..presets import Presets
from . import ranges as eopda
from .device_filter import DeviceFilter
from .kernels.compiled.link_likelihood import ideal
from .links import Links
from .state import State, Target


@dataclass(frozen=True, slots=True)
class Params(eopda.Params):
    """Parameters of the ideal model."""

    TITLE = "ideal scattering"
    scatterers: int = parameter(50, "1", "scatterers I' per receiving anchor", within="[1, inf)")


def log_likelihood(
    state: State, anchors: Array, links: Links, excess: tuple[Array, Array], params: Params
) -> Array:
    """Log-likelihood (N,) of particles; see :mod:`.kernels.link_likelihood`."""
    y, (u, s) = state.y, unit_square_nodes(params.scatterers)
    return ideal(
        y[:2],
        state.device,
        y[-1],
        anchors,
        *links,
        *excess,
        params.clutter,
        params.los,
        params.mean_scatter,
        y[6:8],
        y[8],
        params.opening_angle,
        u,
        s,
    )


ELLIPSE = Target(
    extent=("a", "b", "w"),
    prior=lambda params: params.prior(2),
    walk=lambda params: params.walk(2),
    log_likelihood=log_likelihood,
    kind="ellipse",
    axes=(0, 1),
)
ACTIVE_PASSIVE = DeviceFilter(
    "extended object with a UWB device, ideal scattering, active and passive links",
    Params,
    ELLIPSE,
    PRESETS=Presets(__package__, "eopda-ideal"),
)
ACTIVE = DeviceFilter(
    "extended object with a UWB device, ideal scattering, active links only",
    Params,
    ELLIPSE,
    passive=False,
)

"""The likelihood of links for all particles, with what their ranges have too much."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...models.records import Array
from .kernels.compiled.difference import difference
from .kernels.compiled.range_error import direct
from .kernels.compiled.range_error import excess as compiled_excess
from .links import Links
from .params import Params
from .state import Event, State, Target

BODY = 1.0
"""Length [m] over which the scattered ranges of a body are spread, as seen by its direct range."""
NOTHING = (np.zeros((0, 0)), np.zeros((0, 0)))
"""The excess of ranges that have none."""


def rates(event: Event, params: Params) -> float:
    """Mean number of ranges of an event: what the likelihood of a Poisson process subtracts."""
    active = len(event.active.tx) + len(event.differences.tx)
    passive = len(event.passive.tx)
    clutter = params.clutter * float(params.max_range or 0.0)
    return (active + passive) * clutter + params.expected(active, passive)


def excess(state: State, anchors: Array, links: Links) -> tuple[Array, Array]:
    """Mean [m] and variance [m^2], both (L, N), of what the ranges of each link have too much.

    They hold for the link's own path: direct from the device, or over the centre of the object.
    """
    if not state.mean.shape[1]:
        return NOTHING
    active = links.tx == len(anchors)
    device, centre = (
        np.sqrt(((p[:, None] - anchors[:, :2].T[..., None]) ** 2).sum(0) + rise)
        for rise in ((state.y[-1] - anchors[:, 2, None]) ** 2,)
        for p in (state.device, state.y[:2])
    )
    there = np.minimum(links.tx, len(anchors) - 1)
    length = np.where(active[:, None], device[links.rx], centre[there] + centre[links.rx])
    return compiled_excess(length, state.mean, state.covariance, links.rx)


def distances(state: State, anchors: Array) -> Array:
    """Distances (J, N) of the device to the anchors."""
    away = state.device[:, None] - anchors[:, :2].T[..., None]
    return np.asarray(np.sqrt((away**2).sum(0) + (state.y[-1] - anchors[:, 2, None]) ** 2))


def weigh_object(
    state: State, anchors: Array, links: Links, target: Target, params: Params
) -> Array:
    """Log-likelihood (N,) of links by what the object looks like."""
    return target.log_likelihood(state, anchors, links, excess(state, anchors, links), params)


def weigh_differences(
    state: State, anchors: Array, links: Links, params: Params
) -> tuple[Array, State]:
    """Log-likelihood (N,) of differences, and the state that has learnt from them."""
    own, mean, covariance = difference(
        state.device,
        state.y[-1],
        anchors,
        *links,
        params.tdoa_correlation,
        state.mean,
        state.covariance,
        params.clutter,
        params.los,
    )
    return own, replace(state, mean=mean, covariance=covariance)


def weigh_active(
    state: State, anchors: Array, links: Links, target: Target, params: Params
) -> tuple[Array, State]:
    """Log-likelihood (N,) of active links, and the state that has learnt from direct ranges."""
    n = state.y.shape[1]
    if params.has_object:
        log_l = weigh_object(state, anchors, links, target, params)
        if not state.mean.shape[1]:
            return log_l, state
    floor = params.clutter + params.scatter / BODY
    own, mean, covariance = direct(
        state.device,
        np.ascontiguousarray(state.y[-1]),
        anchors,
        *links[1:],
        state.mean,
        state.covariance,
        floor,
        (1 - params.late) * params.los,
        params.late * params.los,
        params.detour,
    )
    assert own.shape == (n,)
    return log_l if params.has_object else own, replace(state, mean=mean, covariance=covariance)

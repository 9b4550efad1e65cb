"""Estimates from particles: means, covariances and what the filter says of itself."""

from __future__ import annotations

from math import pi

import numpy as np

from ...models.errors import EstimatorError
from ...models.records import Array, Estimates, Meta, Objects
from .cloud.resampling import effective_sample_size
from .params import Params
from .state import State, Target


def extract(state: State, time_ns: int, target: Target, params: Params, known: bool) -> Estimates:
    """Mean and covariance of the particles; b_phi and heading are averaged on the circle.

    Offset and extent are left out where there is no object, the height where it is ``known``, the
    range bias (averaged over the anchors) and the range scale where they are not estimated.

    Raises
    ------
    EstimatorError : the covariance is not finite
    """
    names = ["x", "y", "vx", "vy"]
    units = ["m", "m", "m s-1", "m s-1"]
    rows = list(range(4))
    if params.has_object:
        names += ["b_rho", "b_phi", *target.extent]
        units += ["m", "rad", *("m" for _ in target.extent)]
        rows = list(range(len(state.y) - 1))
    if not known:
        names, units, rows = [*names, "height"], [*units, "m"], [*rows, len(state.y) - 1]
    y, own = state.y[rows], []
    if params.range_bias_std > 0:
        names, units = [*names, "range_bias"], [*units, "m"]
        anchors = state.mean.shape[1] - 1
        y = np.vstack((y, params.range_bias + state.mean[:, 1:].mean(1)))
        own.append(state.covariance[:, 1:, 1:].sum((1, 2)) / anchors**2)
    if params.range_scale_std > 0:
        names, units = [*names, "range_scale"], [*units, "1"]
        y = np.vstack((y, state.mean[:, 0]))
        own.append(state.covariance[:, 0, 0])
    first = len(y) - len(own)
    turned = len(y) if len(state.heading) else -1
    if turned >= 0:
        names, units, y = [*names, "heading"], [*units, "rad"], np.vstack((y, state.heading))
    y, w = np.vstack((y, state.device)), state.w
    mean = y @ w
    d = y - mean[:, None]
    for k in [5] * params.has_object + [turned] * (turned >= 0):
        mean[k] = np.arctan2(np.sin(y[k]) @ w, np.cos(y[k]) @ w)
        d[k] = np.remainder(y[k] - mean[k] + pi, 2 * pi) - pi
    covariance = (w * d) @ d.T
    for k, variance in enumerate(own, first):
        covariance[k, k] += variance @ w
    if not np.isfinite(covariance).all():
        raise EstimatorError("the estimate is not finite")
    kind = target.kind if params.has_object else ""
    axes = mean[[6 + k for k in target.axes]][None] if kind else None
    objects = Objects(
        np.array([time_ns], np.int64),
        np.array([0, 1], np.int64),
        np.zeros(1, np.int64),
        (*names, "device_x", "device_y"),
        (*units, "m", "m"),
        mean[None],
        covariance=(covariance + covariance.T)[None] / 2,
        existence=np.ones(1),
        extent_kind=kind,
        semi_axes=axes,
        rotation=None if axes is None else np.zeros(1),
    )
    return Estimates(Meta(""), objects, _steps(w))


def _steps(w: Array) -> dict[str, Array]:
    return {
        "cardinality_mean": np.ones(1),
        "cardinality_variance": np.zeros(1),
        "effective_sample_size": np.array([effective_sample_size(w)]),
    }

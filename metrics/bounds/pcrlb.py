"""Posterior Cramér-Rao bound of the ideal scattering model, for the device and the centre.

A link's measurements are a Poisson process of clutter, line of sight and scatter
(:mod:`.information`), taken at the true state (:mod:`.paths`); the amplitude of a path enters as
its known noise ``sigma_d = c / (sqrt(8) pi beta_bw u)`` with u inversely proportional to the length
of the path. Transitions and prior are those of the filter
(:mod:`echoset.models.motion`); signal-to-noise ratio, bandwidth, depth of the sector and heights
are those of the recording, and so is whether ranges have an unknown offset: then the state has one
more variable for each anchor, with the filter's prior and walk. Where the truth has no extent and
no link is passive, the bound is that of a device alone (:mod:`.alone`), from ranges and
differences. ``pcrlb`` counts the links that
delivered an event, ``pcrlb-star`` (:mod:`.pcrlb_star`) the blocked ones as well, and
``pcrlb-smooth`` (:mod:`.pcrlb_smooth`) those of later steps.

The bound belongs to no estimator: that column is empty. ``<name>-valid`` is 1 while the standard
deviation of b_phi is at most 1 rad and the linearised bound on the device holds, otherwise 0; the
centre is linear in the state and always valid. The prior holds at the first event.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.linalg import block_diag

from ...models.columns import ACTIVE, PASSIVE, TDOA
from ...models.errors import InputError
from ...models.geometry.poses import pose_at
from ...models.motion import constant_velocity, motion_noise, walk_std
from ...models.parameters import parameter, require
from ...models.records import Array, Estimates, Recording, Scores, Stream
from ...models.uwb import Region, free_space_amplitude, range_std
from ..kit.alignment import ScoredObject, interpolate, seconds
from ..kit.table import rows
from . import alone, paths
from .information import covariance_bounds, information

_log = logging.getLogger(__name__)
Point = tuple[float, float, float]
Recursion = Callable[[Array, Array, Array, Array], Array]
"""Bounds by step from prior, F, Q and information, as :func:`.information.covariance_bounds`."""

SUMMARY = "posterior Cramér-Rao bound on the device and the centre, blocked links without events"
PARTS = ("device", "centre")
STREAMS = ("uwb",)
FOR_SETS = False
QUADRATIC = ("pcrlb",)


@dataclass(frozen=True, slots=True)
class Params(ScoredObject):
    """The filter's model: measurements, transitions, prior."""

    TITLE = "the filter's model"
    STREAMS = ("uwb",)
    mean_scatter: float = parameter(
        5.0, "1", "mean number of scatter measurements of a link", within="[0, inf)"
    )
    mean_clutter: float = parameter(
        5.0, "1", "mean number of clutter measurements of a link", within="[0, inf)"
    )
    mean_los: float = parameter(
        1.0, "1", "mean number of line-of-sight measurements of a link", within="[0, inf)"
    )
    max_range: float = parameter(
        20.0, "m", "clutter is uniform up to this range", within="(0, inf)"
    )
    rms_bandwidth: float = parameter(
        500e6 / 12**0.5, "Hz", "root mean square bandwidth", within="(0, inf)"
    )
    sigma: float | None = parameter(
        None, "m", "noise of ranges without a standard deviation of their own", within="(0, inf)"
    )
    tdoa_correlation: float = parameter(
        0.5, "1", "correlation of differences to one anchor", within="[0, 1)"
    )
    snr_db: float = parameter(30.0, "dB", "signal-to-noise ratio of a path of one metre")
    opening_angle: float = parameter(
        2 * np.pi / 3, "rad", "opening angle of the sector", within="(0, 6.283185307179587]"
    )
    width: float = parameter(0.1, "m", "true depth of the scattering sector", within="(0, inf)")
    device_height: float = parameter(0.0, "m", "height of the device and its object")
    range_bias_std: float = parameter(
        0.0,
        "m",
        "standard deviation of what every range has too much; 0: nothing is",
        within="[0, inf)",
    )
    range_bias_spread: float = parameter(
        0.1, "m", "standard deviation of an anchor's own part of it", within="[0, inf)"
    )
    range_bias_walk: float = parameter(
        0.02, "m s-1/2", "random walk of an anchor's own part", within="[0, inf)"
    )
    acceleration_std: float = parameter(2.0, "m s-2", "white acceleration", within="(0, inf)")
    bias_distance_std: float = parameter(
        0.1, "m", "random walk of b_rho per 0.1 s", within="(0, inf)"
    )
    bias_angle_std: float = parameter(
        0.5, "rad", "random walk of b_phi per 0.1 s", within="(0, inf)"
    )
    axes_std: float = parameter(0.05, "m", "random walk of a and b per 0.1 s", within="(0, inf)")
    width_std: float = parameter(0.05, "m", "random walk of w per 0.1 s", within="(0, inf)")
    speed_std: float = parameter(
        1.0, "m s-1", "standard deviation of v at first", within="(0, inf)"
    )
    bias_prior: tuple[float, float] = parameter(
        (0.0, 0.6), "m", "b_rho at first: uniform", within="[0, inf)"
    )
    axes_prior: tuple[float, float] = parameter(
        (0.1, 0.5), "m", "a and b at first: uniform", within="[0, inf)"
    )
    width_prior: tuple[float, float] = parameter(
        (0.01, 0.2), "m", "w at first: uniform", within="[0, inf)"
    )

    def __post_init__(self) -> None:
        ScoredObject.__post_init__(self)
        for name in ("bias_prior", "axes_prior", "width_prior"):
            low, high = getattr(self, name)
            require(low < high, name, "low < high", (low, high))


def score(estimates: Estimates, recording: Recording, params: Params) -> Scores:
    """The bound [m] per step and its root mean square, for device and centre, and its validity.

    Raises
    ------
    InputError : no UWB events, or the truth lacks device, centre or ellipse at an event
    """
    return bounds(recording, params, "pcrlb", blocked=False)


def bounds(
    recording: Recording,
    params: Params,
    name: str,
    blocked: bool,
    known: Recursion = covariance_bounds,
) -> Scores:
    """The scores called ``name`` of the links with events, and of the ``blocked`` ones if asked.

    ``known`` says from which steps' links a step is known: by default from those until then.
    """
    stream = _stream(recording)
    has_body = recording.truth is None or recording.truth.objects.semi_axes is not None
    if not has_body and PASSIVE not in stream.scan["mode"]:
        return _alone(recording, stream, params, name, known)
    if TDOA in stream.scan["mode"]:
        raise InputError(f"{recording.meta.name}: the bound of a body is not for differences")
    time_ns, tx, rx = _links(stream, recording, blocked)
    steps, step = np.unique(time_ns, return_inverse=True)
    states = true_states(recording, steps, params)
    anchors = {i: n for i, n in enumerate(stream.nodes) if recording.sensors[n].kind == "anchor"}

    def place(node: int, time: int) -> Point | None:
        """Where an anchor is at a step; None for the device."""
        if node not in anchors:
            return None
        x, y, z = pose_at(recording.sensors[anchors[node]], int(steps[time]))[0].tolist()
        return x, y, z

    size, offset = len(paths.STATE), {node: n for n, node in enumerate(anchors)}
    size += len(anchors) if params.range_bias_std > 0 else 0
    J_z = np.zeros((len(steps), size, size))
    for k, i, j in zip(step.tolist(), tx.tolist(), rx.tolist(), strict=True):
        rx_place = place(j, k)
        assert rx_place is not None
        J = link_information(tuple(states[k].tolist()), place(i, k), rx_place, params)
        seen = [*range(len(paths.STATE)), len(paths.STATE) + offset[j]][: len(J)]
        J_z[k][np.ix_(seen, seen)] += J
    dt = np.diff(seconds(steps), prepend=seconds(steps[:1]))
    first = np.array([place(node, 0) for node in anchors], float)
    model = prior(first, params), *transitions(dt, params)
    if params.range_bias_std > 0:
        model = with_offsets(*model, dt, len(anchors), params)
    P = known(*model, J_z)
    inside = params.contains(steps)
    if not inside.any():
        raise InputError(f"{recording.meta.name}: no event is within the time to be scored")
    time, tables = seconds(steps)[inside], []
    G = {
        "device": np.stack([paths.device(y)[1] for y in states]),
        "centre": np.eye(2, len(paths.STATE)),
    }
    P = P[:, : len(paths.STATE), : len(paths.STATE)]
    for part, g in G.items():
        bound = np.sqrt(np.trace(g @ P @ np.swapaxes(g, -1, -2), axis1=1, axis2=2))[inside]
        key = recording.meta.name, "", name, part
        tables += [
            rows(key, time, bound),
            rows(key, np.nan, np.sqrt(np.mean(bound**2)), len(bound)),
        ]
    valid = (P[:, 5, 5] <= 1.0)[inside]
    key = recording.meta.name, "", f"{name}-valid", "device"
    tables += [rows(key, time, valid), rows(key, np.nan, valid.mean(), len(valid))]
    return Scores.join(tables)


def _alone(
    recording: Recording, stream: Stream, params: Params, name: str, recursion: Recursion
) -> Scores:
    """The bound of a device without a body."""
    steps = np.unique(stream.time_ns)
    if len(np.unique(stream.scan["tx"][stream.scan["mode"] != PASSIVE])) > 1:
        raise InputError(f"{recording.meta.name}: the bound is for one device, there are several")
    truth, known = interpolate(recording, steps, params)
    steps = steps[known]
    try:
        p = truth.columns("device_x", "device_y")
    except KeyError as error:
        raise InputError(f"{recording.meta.name}: truth: {error.args[0]}") from None
    inside = params.contains(steps)
    if not inside.any():
        raise InputError(f"{recording.meta.name}: no event is within the time to be scored")
    if any(s.kind == "odometry" for s in recording.streams.values()):
        _log.warning("%s: the bound does not know of the odometry", recording.meta.name)
    P = alone.bound(recording, stream, steps, p, params, recursion)
    value = np.sqrt(np.trace(P[:, :2, :2], axis1=1, axis2=2))[inside]
    key = recording.meta.name, "", name, "device"
    whole = rows(key, np.nan, np.sqrt(np.mean(value**2)), len(value))
    return Scores.join([rows(key, seconds(steps)[inside], value), whole])


def _stream(recording: Recording) -> Stream:
    streams = [s for s in recording.streams.values() if s.kind == "uwb" and len(s)]
    if len(streams) != 1:
        raise InputError(
            f"{recording.meta.name}: has {len(streams)} streams of UWB events, not one"
        )
    return streams[0]


def _links(stream: Stream, recording: Recording, blocked: bool) -> tuple[Array, Array, Array]:
    """Time, sender and receiver of the links that count; the sender is -1 for the device."""
    scan = stream.scan
    active = scan["mode"] == ACTIVE
    if len(np.unique(scan["tx"][active])) > 1:
        raise InputError(f"{recording.meta.name}: the bound is for one device, there are several")
    tx = np.where(active, -1, scan["tx"])
    time_ns, rx = stream.time_ns, scan["rx"]
    if blocked and recording.truth is not None:
        more = recording.truth
        time_ns = np.concatenate([time_ns, more.blocked_time_ns])
        tx = np.concatenate([tx, np.full(len(more.blocked_tx), -1)])
        rx = np.concatenate([rx, more.blocked_rx])
    return time_ns, tx, rx


def true_states(recording: Recording, time_ns: Array, params: Params) -> Array:
    """The true states y (n, 9) at ``time_ns`` (n,)."""
    truth, known = interpolate(recording, time_ns, params)
    if not known.all():
        t = seconds(time_ns)[~known][0]
        raise InputError(
            f"{recording.meta.name}: the bound needs truth at every event, none at {t} s"
        )
    if truth.semi_axes is None or truth.extent_kind not in ("circle", "ellipse"):
        raise InputError(f"{recording.meta.name}: the bound needs an ellipse as true extent")
    if truth.rotation is not None and truth.rotation.any():
        raise InputError(f"{recording.meta.name}: the bound is for an ellipse along the axes")
    try:
        p, m = truth.columns("x", "y"), truth.columns("device_x", "device_y")
    except KeyError as error:
        raise InputError(f"{recording.meta.name}: truth: {error.args[0]}") from None
    b = m - p
    polar = np.stack([np.linalg.norm(b, axis=1), np.arctan2(b[:, 1], b[:, 0])], 1)
    depth = np.full((len(p), 1), params.width)
    return np.hstack([p, np.zeros_like(p), polar, truth.semi_axes[:, :2], depth])


@lru_cache(maxsize=1 << 14)
def link_information(
    state: tuple[float, ...], tx: Point | None, rx: Point, params: Params
) -> Array:
    """Fisher information of the link from ``tx`` (None: the device) to ``rx``.

    It is (9, 9), or (10, 10) with the offset of the ranges at ``rx``, where that is unknown.
    """
    y, anchor = np.array(state), np.array(rx)
    sender = None if tx is None else np.array(tx)
    height = params.device_height
    length, gradient = paths.scattered(y, sender, anchor, params.opening_angle, height)
    weight = params.mean_scatter * paths.nodes()[2]
    if tx is None:
        los, los_y = paths.direct(y, anchor, height)
        length, gradient = np.concatenate([los, length]), np.concatenate([los_y, gradient])
        weight = np.concatenate([[params.mean_los], weight])
    if params.range_bias_std > 0:
        gradient = np.column_stack((gradient, np.ones(len(gradient))))
    std = range_std(free_space_amplitude(length, params.snr_db), params.rms_bandwidth)
    return information(length, std, weight, gradient, params.mean_clutter / params.max_range)


def prior(anchors: Array, params: Params) -> Array:
    """The prior's covariance (9, 9): independent, the position anywhere in reach of ``anchors``."""
    widths = [
        np.ptp(params.bias_prior),
        2 * np.pi,
        *(2 * [np.ptp(params.axes_prior)]),
        np.ptp(params.width_prior),
    ]
    P = np.zeros((len(paths.STATE), len(paths.STATE)))
    P[:2, :2] = Region(anchors[:, :2], params.max_range).covariance()
    P[range(2, 9), range(2, 9)] = [*(2 * [params.speed_std**2]), *np.square(widths) / 12]
    return P


def transitions(dt: Array, params: Params) -> tuple[Array, Array]:
    """F and Q (n, 9, 9) over ``dt`` (n,) [s]; a step of no length, the first, has no noise."""
    F = np.tile(np.eye(len(paths.STATE)), (len(dt), 1, 1))
    Q = np.zeros_like(F)
    walks = np.array(
        [
            params.bias_distance_std,
            params.bias_angle_std,
            params.axes_std,
            params.axes_std,
            params.width_std,
        ]
    )
    for n, step in enumerate(dt.tolist()):
        F[n, :4, :4], _ = constant_velocity(step)
        Q[n, :4, :4] = motion_noise(params.acceleration_std, step)
        Q[n, range(4, 9), range(4, 9)] = np.square(walk_std(walks, step))
    return F, Q


def with_offsets(
    P0: Array, F: Array, Q: Array, dt: Array, anchors: int, params: Params
) -> tuple[Array, Array, Array]:
    """Prior, F and Q with an offset of the ranges for each of so many ``anchors`` behind."""
    eye = np.eye(anchors)
    own = params.range_bias_std**2 + params.range_bias_spread**2 * eye
    walks = params.range_bias_walk**2 * dt[:, None, None] * eye
    return (
        block_diag(P0, own),
        np.stack([block_diag(f, eye) for f in F]),
        np.stack([block_diag(q, walk) for q, walk in zip(Q, walks, strict=True)]),
    )

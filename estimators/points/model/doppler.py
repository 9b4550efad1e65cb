"""Doppler: how fast a target recedes, measured beside where it is.

A target at p that moves with v recedes from a sensor at q that moves with w at the rate
h = u . (v - w) with u = (p - q) / |p - q|. It comes after the position: h is expanded about the
target that the detection's place has updated, to the second order, since there the direction is
known and the velocity may not be. Y. Bar-Shalom, X. R. Li and T. Kirubarajan, "Estimation with
Applications to Tracking and Navigation", section 10.3.2. As a row beside those of the place, with
the state as that expansion has it, one joint update does the same as the two in turn.

Where Doppler is ambiguous, it is a mixture over the turns it may have made, of which a target
keeps the moments: the more turns are possible, the less it says.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import pi

import numpy as np

from ....models.errors import InputError
from ....models.parameters import parameter
from ....models.records import Array

_log = logging.getLogger(__name__)
FOLDS = 6
"""Turns of ambiguous Doppler to either side that are told apart; beyond, it says nothing."""


# Without slots: classes that have some cannot be composed.
@dataclass(frozen=True)
class DopplerParams:
    """How the Doppler of detections is used, where a stream has it."""

    TITLE = "Doppler"

    doppler: str = parameter(
        "use",
        "1",
        "use: it updates targets; gate: it only tells which detections are not theirs; ignore",
        within=("use", "gate", "ignore"),
    )
    std_doppler: float = parameter(
        0.0,
        "m s-1",
        "noise of Doppler, where the rows state none; 0: not known, Doppler is not used",
        within="[0, inf)",
    )
    doppler_max: float = parameter(
        0.0,
        "m s-1",
        "Doppler is measured modulo twice that; 0: without ambiguity",
        within="[0, inf)",
    )
    clutter_doppler: float = parameter(
        50.0,
        "m s-1",
        "clutter has any Doppler up to that, or up to doppler_max, as likely",
        within="(0, inf)",
    )


@dataclass(frozen=True, slots=True, eq=False)
class Rates:
    """Doppler z (n,) [m/s] of the detections of a look, with noise variance R (n,).

    The sensor is at ``position`` (2,) and moves with ``velocity`` (3,); detections are ``above``
    (n,) [m] it. z is known modulo ``period``, 0 for none; ``clutter`` is the density of that of
    clutter. Without ``updates`` it only tells which pairs are none.
    """

    z: Array
    R: Array
    position: Array
    velocity: Array
    above: Array
    period: float
    clutter: float
    updates: bool

    def take(self, index: Array) -> Rates:
        """Those of the detections ``index``."""
        some = {name: getattr(self, name)[index] for name in ("z", "R", "above")}
        return replace(self, **some)


def known(params: DopplerParams, rows: Mapping[str, Array]) -> bool:
    """Whether rows have Doppler, and a noise."""
    return "doppler" in rows and ("std_doppler" in rows or params.std_doppler > 0)


def warn_unused(stream: str, rows: Mapping[str, Array], params: DopplerParams) -> None:
    """Say that the Doppler of a stream is not used, where it could be."""
    if "doppler" in rows and params.doppler != "ignore" and not known(params, rows):
        _log.warning("%s: Doppler is not used: its noise is not known, give std_doppler", stream)


def rates(
    params: DopplerParams, rows: Mapping[str, Array], position: Array, velocity: Array, above: Array
) -> Rates | None:
    """The Doppler of a scan's ``rows``, None where it is not there or not to be used.

    Raises
    ------
    InputError : a deviation is not positive
    """
    if params.doppler == "ignore" or not known(params, rows):
        return None
    z = rows["doppler"]
    std = rows.get("std_doppler", np.full(len(z), params.std_doppler))
    if (std <= 0).any():
        raise InputError("the noise of Doppler is not known: give std_doppler")
    period = 2 * params.doppler_max
    width = period or 2 * params.clutter_doppler
    updates = params.doppler == "use"
    return Rates(z, std**2, position, velocity, above, period, 1 / width, updates)


def expansion(seen: Rates, above: Array, m: Array, P: Array) -> tuple[Array, Array, Array]:
    """Mean (k,) of the rate of Gaussians m (k, dx), P, its slope H (k, dx), and what H leaves out.

    That is the variance (k,) by the second order; the mean has the second order in it.
    """
    d = m[:, :2] - seen.position
    vr = m[:, 2:4] - seen.velocity[:2]
    r = np.sqrt((d**2).sum(1) + above**2)
    r = np.maximum(r, 1e-6)
    along = ((d * vr).sum(1) - above * seen.velocity[2]) / r
    u = d / r[:, None]
    H = np.zeros_like(m)
    H[:, :2], H[:, 2:4] = (vr - along[:, None] * u) / r[:, None], u
    across = np.eye(2) - u[:, :, None] * u[:, None, :]
    mixed = vr[:, :, None] * u[:, None, :]
    G = np.zeros_like(P)
    bent = across - 2 * u[:, :, None] * u[:, None, :]
    G[:, :2, :2] = -(mixed + mixed.swapaxes(1, 2) + along[:, None, None] * bent)
    G[:, :2, :2] /= r[:, None, None] ** 2
    G[:, :2, 2:4] = G[:, 2:4, :2] = across / r[:, None, None]
    GP = G @ P
    mean = along + np.trace(GP, axis1=1, axis2=2) / 2
    return mean, H, np.einsum("kab,kba->k", GP, GP) / 2


def beside(
    seen: Rates, detection: Array, v: Array, m: Array, P: Array, z_hat: Array, C: Array, S: Array
) -> tuple[Array, Array, Array]:
    """What pairs expect, z_hat (k, 2), C (k, 4, 2), S (k, 2, 2), with Doppler as a third entry.

    Pairs are of Gaussians m (k, dx), P and detections (k,), whose places have innovations v (k, 2).
    """
    K = np.linalg.solve(S, C.swapaxes(1, 2)).swapaxes(1, 2)
    shift = (K @ v[..., None])[..., 0]
    there = m + shift, P - K @ C.swapaxes(1, 2)
    mean, H, more = expansion(seen, seen.above[detection], *there)
    column = (P @ H[..., None])[..., 0]
    k, d = m.shape
    z_all, C_all, S_all = np.zeros((k, 3)), np.zeros((k, d, 3)), np.zeros((k, 3, 3))
    z_all[:, :2], z_all[:, 2] = z_hat, mean - (H * shift).sum(1)
    C_all[:, :, :2], C_all[:, :, 2] = C, column
    S_all[:, :2, :2] = S
    S_all[:, 2, :2] = S_all[:, :2, 2] = (H[:, None] @ C)[:, 0]
    S_all[:, 2, 2] = (H * column).sum(1) + more + seen.R[detection]
    return z_all, C_all, S_all


def left(seen: Rates, detection: Array, v: Array, z_hat: Array, S: Array) -> tuple[Array, Array]:
    """Innovation (k,) of Doppler, once the place has updated, and its variance; of :func:`beside`.

    Of ambiguous Doppler the smallest.
    """
    g = np.linalg.solve(S[..., :2, :2], S[..., :2, 2:])[..., 0]
    e = seen.z[detection] - z_hat[..., 2] - (g * v).sum(-1)
    if seen.period:
        e -= seen.period * np.round(e / seen.period)
    return e, S[..., 2, 2] - (g * S[..., :2, 2]).sum(-1)


def folds(seen: Rates, e: Array, variance: Array) -> tuple[Array, Array, Array]:
    """Log density (k,) of innovations over all turns, and mean and variance (k,) over the turns.

    Where the deviation exceeds the period the density is flat, and the last are those of no update:
    the innovation 0 with the variance itself.
    """
    if not seen.period:
        zero = np.zeros(len(e))
        return -(e**2 / variance + np.log(2 * pi * variance)) / 2, e, zero
    turns = seen.period * np.arange(-FOLDS, FOLDS + 1)
    each = e[:, None] + turns
    log_l = -(each**2 / variance[:, None] + np.log(2 * pi * variance)[:, None]) / 2
    top = log_l.max(1)
    w = np.exp(log_l - top[:, None])
    total = w.sum(1)
    w /= total[:, None]
    mean = (w * each).sum(1)
    spread = (w * (each - mean[:, None]) ** 2).sum(1)
    flat = variance > seen.period**2
    density = np.where(flat, -np.log(seen.period), top + np.log(total))
    return density, np.where(flat, 0.0, mean), np.where(flat, variance, spread)


def log_density(
    seen: Rates, detection: Array, v: Array, z_hat: Array, S: Array, gate: float
) -> Array:
    """What Doppler adds (k,) to the log densities of pairs, -inf outside the gate."""
    e, variance = left(seen, detection, v, z_hat, S)
    density = folds(seen, e, variance)[0] if seen.updates else np.zeros(len(e))
    return np.asarray(np.where(e**2 > gate * variance, -np.inf, density))


def corrected(
    seen: Rates, detection: Array, v: Array,
    m: Array, P: Array, z_hat: Array, C: Array, S: Array,
) -> tuple[Array, Array]:  # fmt: skip
    """Means (k, dx) and covariances of pairs, m and P given the place, once Doppler has updated."""
    if not seen.updates:
        return m, P
    e, variance = left(seen, detection, v, z_hat, S)
    _, mean, spread = folds(seen, e, variance)
    g = np.linalg.solve(S[:, :2, :2], S[:, :2, 2:])
    K = (C[:, :, 2] - (C[:, :, :2] @ g)[..., 0]) / variance[:, None]
    change = (variance - spread)[:, None, None] * K[:, :, None] * K[:, None, :]
    return m + K * mean[:, None], P - change


def first(seen: Rates, m: Array, P: Array) -> tuple[Array, Array, Array]:
    """Density (n,) of the Doppler of targets m (n, 4), P that detections tell the place of.

    One each, and what Doppler makes of m and P.
    """
    if not seen.updates or not len(m):
        return np.ones(len(m)), m, P
    mean, H, more = expansion(seen, seen.above, m, P)
    column = (P @ H[..., None])[..., 0]
    variance = (H * column).sum(1) + more + seen.R
    e = seen.z - mean
    if seen.period:
        e -= seen.period * np.round(e / seen.period)
    log_l, shift, spread = folds(seen, e, variance)
    K = column / variance[:, None]
    change = (variance - spread)[:, None, None] * K[:, :, None] * K[:, None, :]
    return np.exp(log_l), m + K * shift[:, None], P - change

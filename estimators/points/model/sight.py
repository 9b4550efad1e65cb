"""What a look says of targets: of the one Gaussian of each, or of several modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....models.records import Array
from ..kernels.modes import Modes
from .edge import Border, detection_probability
from .measurement import innovations, log_likelihood, updated
from .sensing import Look, SensorParams

Moments = tuple[Array, Array, Modes | None]
"""Means m (k, dx), covariances P (k, dx, dx) and modes, if there are several."""


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """A look at T targets in ``modes``, each as M Gaussians, one after the other.

    Each has the share w (T M,) of its target and moments m, P, of which one expects z_hat, C, S.
    Detections (n,) have the log density ``log_l`` (T M, n), -inf outside the gate, and are
    ``found`` (T M, 1 or n) with a probability, if the target is visible; ``border`` says how
    probably it is detected at all, and where it is if not.
    """

    look: Look
    modes: Modes | None
    w: Array
    m: Array
    P: Array
    z_hat: Array
    C: Array
    S: Array
    log_l: Array
    found: Array
    border: Border

    @staticmethod
    def of(
        m: Array, P: Array, modes: Modes | None, look: Look, gate: float, own: SensorParams
    ) -> Sight:
        """The look at targets m (T, dx), P, with the parameters ``own`` of its sensor."""
        w, m, P = (np.ones(len(m)), m, P) if modes is None else modes.flat()
        z_hat, C, S = innovations(look, m, P, own.unscented)
        log_l = log_likelihood(look, z_hat, S, gate)
        border = Border.of(look, m, P, own.fov_mass)
        found = _found(look, own, m, P, border.p, log_l, z_hat, C, S)
        return Sight(look, modes, w, m, P, z_hat, C, S, log_l, found, border)

    def each(self, values: Array) -> Array:
        """``values`` (T,) of the targets for each of their modes (T M,)."""
        return values if self.modes is None else np.repeat(values, self.modes.w.shape[1])

    def mean(self, values: Array) -> Array:
        """Means (T,) over the modes of ``values`` (T M,)."""
        if self.modes is None:
            return values
        return np.asarray((self.w * values).reshape(self.modes.w.shape).sum(1))

    def hit(self, weight: Array) -> Array:
        """Density (T, n) of detections by targets with a ``weight`` (T,)."""
        density = np.asarray(self.each(weight)[:, None] * np.exp(self.log_l))
        density *= self.found
        if self.modes is None:
            return density
        density *= self.w[:, None]
        return np.asarray(density.reshape(*self.modes.w.shape, density.shape[1]).sum(1))

    def log_hit(self, visible: Array) -> Array:
        """Log density (T, n) of detections by targets that are ``visible`` (T,) so probably."""
        with np.errstate(divide="ignore"):
            log_hit = self.log_l + np.log(self.found * self.each(visible)[:, None])
            if self.modes is None:
                return np.asarray(log_hit)
            log_hit += np.log(self.w)[:, None]
        log_hit = log_hit.reshape(*self.modes.w.shape, log_hit.shape[1])
        return np.asarray(np.logaddexp.reduce(log_hit, axis=1))

    def missed(self, visible: Array, elsewhere: Array) -> Moments:
        """The targets if they are not detected; see :meth:`.edge.Border.missed`."""
        visible = self.each(visible)
        m, P = self.border.missed(visible, self.each(elsewhere))
        if self.modes is None:
            return m, P, None
        w = (self.w * (1 - self.border.p * visible)).reshape(self.modes.w.shape)
        total = w.sum(1, keepdims=True)
        w = np.where(total > 0, w / np.where(total > 0, total, 1.0), self.modes.w)
        modes = self.modes.like(w, m, P)
        return *modes.together(), modes

    def detected(self, t: Array, i: Array) -> Moments:
        """The targets ``t`` (k,) if they are detected as ``i`` (k,)."""
        moments = self.look, self.m, self.P, self.z_hat, self.C, self.S
        if self.modes is None:
            return *updated(*moments, t, i), None
        M = self.modes.w.shape[1]
        part, i = (t[:, None] * M + np.arange(M)).ravel(), np.repeat(i, M)
        m, P = updated(*moments, part, i)
        log_l = self.log_l[part, i].reshape(-1, M)
        found = np.broadcast_to(self.found, self.log_l.shape)[part, i].reshape(-1, M)
        w = self.w[part].reshape(-1, M) * found * np.exp(log_l - log_l.max(1, keepdims=True))
        modes = self.modes.take(t).like(w / w.sum(1, keepdims=True), m, P)
        return *modes.together(), modes


def _found(
    look: Look, own: SensorParams, m: Array, P: Array, p: Array, log_l: Array, z_hat: Array,
    C: Array, S: Array,
) -> Array:  # fmt: skip
    """Probability of detection (J, 1 or n) by each detection: the mass in view once updated."""
    partial = (p > 0) & (p < look.p_detect)
    if not partial.any():
        return p[:, None]
    found = np.repeat(p[:, None], log_l.shape[1], axis=1)
    l, i = np.nonzero((log_l > -np.inf) & partial[:, None])
    m, P = updated(look, m, P, z_hat, C, S, l, i)
    found[l, i] = detection_probability(look, m, P, own.fov_mass)
    return found

"""What a look says of Bernoullis: of the one Gaussian of each, or of several modes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ....models.records import Array
from ..kernels.bernoulli import Bernoullis
from .edge import detection_probability, unseen
from .sensing import Look, SensorParams, innovations, log_likelihood, updated


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """A look at L Bernoullis, whose Gaussians are M modes each, one after the other.

    Each has the share w (L M,) of its Bernoulli, moments m, P, and expects z_hat, C, S. ``log_hit``
    (L M, n) is the log of the probability that a target is visible and detected times the density
    of the detection, -inf outside the gate; p (L M,) is how probably it is detected at all, if it
    is visible, and ``m_missed``, ``P_missed`` its moments if it is not.
    """

    bernoullis: Bernoullis
    look: Look
    w: Array
    m: Array
    P: Array
    z_hat: Array
    C: Array
    S: Array
    log_hit: Array
    p: Array
    m_missed: Array
    P_missed: Array

    @staticmethod
    def of(a: Bernoullis, look: Look, gate: float, own: SensorParams) -> Sight:
        """The look at ``a``, with the parameters ``own`` of its sensor."""
        w, m, P = (np.ones(len(a)), a.m, a.P) if a.modes is None else a.modes.flat()
        visible = a.visible if a.modes is None else np.repeat(a.visible, a.modes.w.shape[1])
        z_hat, C, S = innovations(look, m, P, own.unscented)
        log_hit = log_likelihood(look, z_hat, S, gate)
        p, m_missed, P_missed = unseen(look, m, P, visible, own.fov_mass)
        found = _found(look, own, m, P, p, log_hit, z_hat, C, S)
        with np.errstate(divide="ignore"):
            log_hit += np.log(found * visible[:, None])
        return Sight(a, look, w, m, P, z_hat, C, S, log_hit, p, m_missed, P_missed)

    def together(self) -> tuple[Array, Array]:
        """``log_hit`` (L, n) and ``p`` (L,) of the Bernoullis."""
        modes = self.bernoullis.modes
        if modes is None:
            return self.log_hit, self.p
        with np.errstate(divide="ignore"):
            log_hit = np.log(self.w)[:, None] + self.log_hit
        log_hit = np.logaddexp.reduce(log_hit.reshape(*modes.w.shape, log_hit.shape[1]), axis=1)
        return log_hit, (self.w * self.p).reshape(modes.w.shape).sum(1)

    def missed(self) -> Bernoullis:
        """The Bernoullis with the densities that they have if they are not detected."""
        a = self.bernoullis
        if a.modes is None:
            return replace(a, m=self.m_missed, P=self.P_missed)
        w = a.modes.w * (1 - self.p.reshape(a.modes.w.shape) * a.visible[:, None])
        total = w.sum(1, keepdims=True)
        w = np.where(total > 0, w / np.where(total > 0, total, 1.0), a.modes.w)
        modes = a.modes.like(w, self.m_missed, self.P_missed)
        m, P = modes.together()
        return replace(a, m=m, P=P, modes=modes)

    def detect(self, local: Bernoullis, at: Array, l: Array, i: Array) -> None:
        """Give those ``at`` (k,) in ``local`` the densities of ``l`` (k,), detected as ``i``."""
        moments = self.look, self.m, self.P, self.z_hat, self.C, self.S
        if local.modes is None:
            local.m[at], local.P[at] = updated(*moments, l, i)
            return
        M = local.modes.w.shape[1]
        part, i = (l[:, None] * M + np.arange(M)).ravel(), np.repeat(i, M)
        m, P = updated(*moments, part, i)
        log_l = self.log_hit[part, i].reshape(-1, M)
        w = self.w[part].reshape(-1, M) * np.exp(log_l - log_l.max(1, keepdims=True))
        own = local.modes.take(at).like(w / w.sum(1, keepdims=True), m, P)
        local.modes.w[at], local.modes.m[at], local.modes.P[at] = own.w, own.m, own.P
        local.m[at], local.P[at] = own.together()


def _found(
    look: Look, own: SensorParams, m: Array, P: Array, p: Array, log_l: Array, z_hat: Array,
    C: Array, S: Array,
) -> Array:  # fmt: skip
    """Probability of detection (L, 1 or n) by each detection: the mass in view once updated."""
    partial = (p > 0) & (p < look.p_detect)
    if not partial.any():
        return p[:, None]
    found = np.repeat(p[:, None], log_l.shape[1], axis=1)
    l, i = np.nonzero((log_l > -np.inf) & partial[:, None])
    m, P = updated(look, m, P, z_hat, C, S, l, i)
    found[l, i] = detection_probability(look, m, P, own.fov_mass)
    return found

"""The border of the view: how likely who is astride it is detected, and where who is missed is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from ....models.geometry.regions import mass
from ....models.radar.detection import View, polar
from ....models.records import Array
from ..kernels import pieces
from ..kernels.bernoulli import TINY
from .sensing import Look

REACH = 5.0
"""Standard deviations from the border of the view, beyond which no mass crosses it."""
PART = 0.01
"""Mass on either side of the border, from which on a Gaussian is astride it."""
FLAT = 1e-3
"""Change of the mass in view over a deviation, below which it has no direction."""


def inside(look: Look, m: Array, P: Array, fov_mass: bool) -> Array:
    """Mass (J,) of Gaussians inside the view, or all or nothing by their means."""
    if look.view == View():
        return np.ones(len(m))
    local = (m[:, :2] - look.position) @ look.rotation
    found = look.view.contains(*polar(local)).astype(float)
    if fov_mass:
        reach = REACH * np.sqrt(np.trace(P[:, :2, :2], axis1=1, axis2=2))
        near = look.view.distance(local) < reach
        if near.any() and look.view.width > 0:
            end = float((np.hypot(*local[near].T) + 2 * reach[near]).max())
            spread = look.rotation.T @ P[near, :2, :2] @ look.rotation
            found[near] = mass(local[near], spread, look.view.corners(end=end))
    return found


def detection_probability(look: Look, m: Array, P: Array, fov_mass: bool) -> Array:
    """Probability (J,) that a target with this mean and covariance is in view and detected.

    One minus it is that of a miss. What multiplies the likelihood of a detection z is that of the
    Gaussian *updated* by z: the integral of 1_V(x) l(z|x) N(x) is the likelihood of z times the
    mass of the updated Gaussian in the view V.
    """
    return np.asarray(look.p_detect * inside(look, m, P, fov_mass))


@dataclass(frozen=True, slots=True, eq=False)
class Border:
    """Gaussians m (J, dx), P (J, dx, dx) at a look: ``p`` (J,) is how probably they are detected.

    That of a target that is visible. Of ``edge`` (k,), which are astride the border of the view,
    ``parts`` (k, n, dx) are the means of pieces, ``narrow`` (k, dx, dx) their covariances, and
    ``each`` (k, n) the mass of a piece that is in view.
    """

    look: Look
    m: Array
    P: Array
    p: Array
    edge: Array
    parts: Array
    narrow: Array
    each: Array

    @staticmethod
    def of(look: Look, m: Array, P: Array, fov_mass: bool) -> Border:
        """Where Gaussians are at a look; by their masses, or all or nothing by their means."""
        p = detection_probability(look, m, P, fov_mass)
        share = p / (look.p_detect or 1.0)
        astride = (share > PART) & (share < 1 - PART)
        edge = np.flatnonzero(astride) if fov_mass else np.zeros(0, int)
        if not len(edge):
            none = np.zeros((0, len(pieces.WEIGHT), m.shape[1]))
            return Border(look, m, P, p, edge, none, P[:0], none[..., 0])
        parts, narrow = pieces.split(m[edge], P[edge], _inwards(look, m[edge], P[edge]))
        k, n, dx = parts.shape
        flat = parts.reshape(-1, dx), np.repeat(narrow, n, axis=0)
        each = inside(look, *flat, True).reshape(k, n)
        p[edge] = look.p_detect * (each @ pieces.WEIGHT)
        return Border(look, m, P, p, edge, parts, narrow, each)

    @property
    def share(self) -> Array:
        """The mass (J,) in view."""
        return np.asarray(self.p / (self.look.p_detect or 1.0))

    def missed(self, visible: Array, elsewhere: Array) -> tuple[Array, Array]:
        """Means and covariances of what is missed, if it is ``visible`` (J,).

        The part outside weighs more then: the moments are those of the pieces, and what is in view
        of the Gaussian is as likely as it has become, so that who is never looked at is not
        forgotten bit by bit. ``elsewhere`` (J,) says how probably a target is not detected beside
        it, and so may be outside at all.
        """
        edge, each = self.edge, self.each
        if not len(edge):
            return self.m, self.P
        hit, out = self.look.p_detect * visible[edge, None], elsewhere[edge, None]
        w = pieces.WEIGHT * (each * (1 - hit) + (1 - each) * out)
        mean, spread = pieces.united(w + 1e-12, self.parts, self.narrow)
        before = each @ pieces.WEIGHT
        left = before * (1 - hit[:, 0])
        after = left / np.maximum(left + (1 - before) * out[:, 0], 1e-12)
        across = _inwards(self.look, self.m[edge], self.P[edge])
        m, P = self.m.copy(), self.P.copy()
        m[edge], P[edge] = _pushed_out(m[edge], P[edge], mean, spread, across, before, after)
        return m, P


def unseen(
    look: Look, m: Array, P: Array, visible: Array, fov_mass: bool
) -> tuple[Array, Array, Array]:
    """Probability (J,) that ``visible`` targets are detected, and their m, P if they are missed.

    Of Bernoullis and of who is not known to be detected: all of it may be outside.
    """
    border = Border.of(look, m, P, fov_mass)
    return border.p, *border.missed(visible, np.ones(len(m)))


def _inwards(look: Look, m: Array, P: Array) -> Array:
    """Direction (J, 2) in which the mass in view grows, zero where there is none."""
    step = 0.5 * np.sqrt(np.diagonal(P[:, :2, :2], axis1=1, axis2=2))
    change = np.zeros((len(m), 2))
    for axis in (0, 1):
        ahead, behind = m.copy(), m.copy()
        ahead[:, axis] += step[:, axis]
        behind[:, axis] -= step[:, axis]
        change[:, axis] = inside(look, ahead, P, True) - inside(look, behind, P, True)
    return np.where(np.abs(change) < FLAT, 0.0, change / step)


def _pushed_out(
    m: Array, P: Array, mean: Array, spread: Array, across: Array, before: Array, after: Array
) -> tuple[Array, Array]:
    """The moments ``mean``, ``spread`` of m, P once missed, with the mass ``after`` in view.

    With a border that is straight over a deviation, distance and deviation share what is needed.
    """
    u = across / np.maximum(np.hypot(*across.T), TINY)[:, None]
    std, now = (np.sqrt(np.einsum("ja,jab,jb->j", u, A[:, :2, :2], u)) for A in (P, spread))
    border = np.einsum("ja,ja->j", u, m[:, :2]) - ndtri(before) * std
    gap = border - np.einsum("ja,ja->j", u, mean[:, :2])
    wanted = -ndtri(np.maximum(after, PART / 2))
    short = (gap > 0.1 * now) & (gap < wanted * now)
    f = np.ones(len(m))
    f[short] = np.sqrt(wanted[short] * now[short] / gap[short])
    # Along the regression of the state on the distance from the border.
    d = (spread[:, :, :2] @ u[..., None])[..., 0] / np.maximum(now, TINY)[:, None]
    shift = np.where(short, (1 - f) * gap, 0.0) / np.maximum(now, TINY)
    return mean + shift[:, None] * d, spread - (1 - f[:, None, None] ** -2) * d[:, :, None] * d[
        :, None, :
    ]

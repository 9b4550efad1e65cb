"""Algebra of Gaussians in several modes at once, of an interacting multiple model.

H. A. P. Blom and Y. Bar-Shalom, "The interacting multiple model algorithm for systems with
Markovian switching coefficients", IEEE Trans. Autom. Control 33 (1988) 780-783. All modes of a
target share its state; each has a Gaussian of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....models.records import Array
from .compiled.pairs import matched


@dataclass(frozen=True, slots=True, eq=False)
class Modes:
    """M modes of T targets: w (T, M), which add up to 1, m (T, M, dx), P (T, M, dx, dx)."""

    w: Array
    m: Array
    P: Array

    @staticmethod
    def of(w: Array, m: Array, P: Array) -> Modes:
        """Targets m (T, dx), P (T, dx, dx) of which only the probabilities w (M,) are known."""
        return Modes.each(np.tile(w, (len(m), 1)), m, P)

    @staticmethod
    def each(w: Array, m: Array, P: Array) -> Modes:
        """The same, with probabilities w (T, M)."""
        M = w.shape[1]
        return Modes(w, np.repeat(m[:, None], M, axis=1), np.repeat(P[:, None], M, axis=1))

    def take(self, index: Array) -> Modes:
        """Those of the targets ``index``."""
        return Modes(self.w[index], self.m[index], self.P[index])

    def join(self, other: Modes) -> Modes:
        """Those of both."""
        pairs = ((self.w, other.w), (self.m, other.m), (self.P, other.P))
        return Modes(*(np.concatenate(pair) for pair in pairs))

    def merged(self, into: Array, weight: Array) -> Modes:
        """Those of each target ``into`` (T,) which others go, with the ``weight`` (T,) they have.

        The modes of targets that are alone, or gone into others, are as they were.
        """
        T, M = self.w.shape
        many = np.bincount(into, minlength=T) > 1
        w, m, P = self.flat()
        at = (into[:, None] * M + np.arange(M)).ravel()
        total, mean, spread = matched(at, np.repeat(weight, M) * w, m, P, T * M)
        some = np.repeat(many, M) & (total > 0)
        mean[~some], spread[~some] = m[~some], P[~some]
        total = total.reshape(T, M)
        many &= total.sum(1) > 0
        total[~many] = self.w[~many]
        return self.like(total / total.sum(1, keepdims=True), mean, spread)

    def flat(self) -> tuple[Array, Array, Array]:
        """The same as w (T M,), m (T M, dx), P (T M, dx, dx), target by target."""
        dx = self.m.shape[2]
        return self.w.ravel(), self.m.reshape(-1, dx), self.P.reshape(-1, dx, dx)

    def like(self, w: Array, m: Array, P: Array) -> Modes:
        """Others of the same shape from what is :meth:`flat`."""
        return Modes(w.reshape(self.w.shape), m.reshape(self.m.shape), P.reshape(self.P.shape))

    def together(self) -> tuple[Array, Array]:
        """Moments m (T, dx), P (T, dx, dx) of the targets."""
        T, M = self.w.shape
        _, m, P = matched(np.repeat(np.arange(T), M), *self.flat(), T)
        return m, P

    def predict(self, F: Array, Q: Array, Pi: Array) -> tuple[Modes, Array]:
        """The modes after a step, and the covariance (T, dx, dx) of states before and after.

        F, Q (M, dx, dx) move what has become each mode, as Pi (M, M) says.
        """
        joint = self.w[:, :, None] * Pi
        w = joint.sum(1)
        share = joint / np.where(w > 0, w, 1.0)[:, None]
        mean = np.einsum("tij,tia->tja", share, self.m)
        v = self.m[:, :, None] - mean[:, None]
        spread = np.einsum("tij,tiab->tjab", share, self.P)
        spread += np.einsum("tij,tija,tijb->tjab", share, v, v)
        moved = Modes(w, np.einsum("jab,tjb->tja", F, mean), F @ spread @ F.swapaxes(1, 2) + Q)
        before, after = self.together()[0], moved.together()[0]
        u, e = mean - before[:, None], moved.m - after[:, None]
        cross = np.einsum("tj,tjab,jcb->tac", w, spread, F)
        return moved, cross + np.einsum("tj,tja,tjb->tab", w, u, e)


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """How T targets came: predicted m (T, dx), P (T, dx, dx), and back.

    The ``gain`` (T, dx, dx) is the covariance of a target's states before and after, times the
    inverse of P: what is learnt of the state after tells so much of the one before.
    """

    m: Array
    P: Array
    gain: Array

    def back(
        self, at: Array, m: Array, P: Array, m_later: Array, P_later: Array
    ) -> tuple[Array, Array]:
        """Moments m, P of the targets ``at`` (k,) before, given those that are smoothed after."""
        gain = self.gain[at]
        m = m + (gain @ (m_later - self.m[at])[..., None])[..., 0]
        change = gain @ (P_later - self.P[at]) @ gain.swapaxes(1, 2)
        return m, P + (change + change.swapaxes(1, 2)) / 2

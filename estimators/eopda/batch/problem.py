"""What the batch minimises, and Gauss-Newton steps towards it.

The unknowns of a time are position, velocity, where odometry tells the heading, and what is wrong
with ranges: height of the device, a share by which all are too long, and what each anchor adds.
They walk from time to time (:mod:`.motion`). A range is the distance with these errors and
Student's noise, or false. Hence the cost, in nats,

    sum over ranges of -log(floor + t((z - h(x)) / sigma) / sigma) + 1/2 sum |x' - F x|^2_W.

Its Hessian is a chain (:mod:`.chain`). Student's noise: Lange, Little and Taylor, "Robust
statistical modeling using the t distribution", JASA 84 (1989); trajectories as a chain: Barfoot,
"State Estimation for Robotics" (2017), section 3.4.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np
from scipy.linalg import LinAlgError
from scipy.special import gammaln

from ....models.records import Array
from ..params import LEAST_CLUTTER
from .chain import Chain, diagonal_of_inverse, factor, log_determinant, solve
from .gather import Data
from .motion import Layout, Motion
from .params import Params

STEPS = 60
"""Gauss-Newton steps at most."""
DONE = 1e-4
"""A step that gains less [nats], per square root of the number of times, is the last."""
MOST_DAMPING = 1e6
"""Damping with which no step is taken, in units of what ranges tell on average."""
BLOCK = 2000
"""Times whose ranges are taken together."""
SMALL = 1e-4
"""Step of a residual by which the loss is differentiated."""


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """The cost for ``data``; a height that is not estimated is ``height`` [m]."""

    data: Data
    params: Params
    motion: Motion
    height: float

    @property
    def layout(self) -> Layout:
        """Where the unknowns stand."""
        return self.motion.layout

    def lengths(self, x: Array) -> tuple[Array, Array]:
        """Predicted ranges (M,) of a trajectory (n, d), and their gradients (M, d)."""
        D, L = self.data, self.layout
        own, m = x[D.step], np.arange(len(D.step))
        h = own[:, L.height] if L.height >= 0 else np.full(len(m), self.height)
        p, turned = own[:, :2], np.zeros((len(m), 2))
        if L.heading >= 0:
            c, s = np.cos(own[:, L.heading]), np.sin(own[:, L.heading])
            x_, y_ = D.offset.T
            arm = np.stack((c * x_ - s * y_, s * x_ + c * y_), 1)
            p, turned = p + arm, np.stack((-arm[:, 1], arm[:, 0]), 1)
        d, u = _distances(p, h, D.place)
        k = np.flatnonzero(D.reference >= 0)
        off, v = _distances(p[k], h[k], D.other[k])
        d[k], u[k] = d[k] - off, u[k] - v
        longer = 1.0 + own[:, L.scale] if L.scale >= 0 else np.ones(len(d))
        H = np.zeros((len(d), L.size))
        H[:, :2] = longer[:, None] * u[:, :2]
        z = longer * d
        if L.heading >= 0:
            H[:, L.heading] = (H[:, :2] * turned).sum(1)
        if L.height >= 0:
            H[:, L.height] = longer * u[:, 2]
        if L.scale >= 0:
            H[:, L.scale] = d
        if L.bias >= 0:
            z = z + own[m, L.bias + D.anchor]
            H[m, L.bias + D.anchor] = 1.0
            z[k] -= own[k, L.bias + D.reference[k]]
            H[k, L.bias + D.reference[k]] = -1.0
        if L.shared >= 0:
            k = np.flatnonzero(D.shared > 0)
            z[k] -= own[k, L.shared]
            H[k, L.shared] = -1.0
        return z, H

    @property
    def floor(self) -> float:
        """Density of false ranges [1/m] over the mean number of direct ones."""
        p = self.params
        assert p.max_range is not None
        return max(p.mean_clutter, LEAST_CLUTTER) / p.max_range / p.mean_los

    def loss(self, r: Array, std: Array) -> tuple[Array, Array]:
        """Cost (M,) [nats] of residuals ``r`` in units of ``std``, and weights (M,) psi(r) / r."""
        v = self.params.tail
        peak = gammaln((v + 1) / 2) - gammaln(v / 2) - 0.5 * np.log(v * pi)
        log_t = peak - np.log(std) - (v + 1) / 2 * np.log1p(r**2 / v)
        total = np.logaddexp(np.log(self.floor), log_t)
        return -total, np.exp(log_t - total) * (v + 1) / (v + r**2)

    def cost(self, x: Array, widen: float = 1.0) -> float:
        """The cost [nats] of a trajectory, with standard deviations times ``widen``."""
        z, _ = self.lengths(x)
        std = widen * self.data.std
        rho, _ = self.loss((self.data.z - z) / std, std)
        return float(rho.sum()) + self.motion.cost(x)

    def normal(self, x: Array, widen: float = 1.0) -> tuple[Chain, Array]:
        """Gauss-Newton Hessian and downhill slope (n, d)."""
        z, H = self.lengths(x)
        std = widen * self.data.std
        r = (self.data.z - z) / std
        weight = self.loss(r, std)[1]
        chain, slope = self.motion.normal(x)
        self._add(chain, H, weight / std**2)
        first, at = self._groups()
        if len(first):
            slope[at] += np.add.reduceat(H * (weight * r / std)[:, None], first)
        return chain, slope

    def _groups(self) -> tuple[Array, Array]:
        """The first range of each time that has some, and these times."""
        first = np.flatnonzero(np.diff(self.data.step, prepend=-1))
        return first, self.data.step[first]

    def _add(self, chain: Chain, H: Array, information: Array) -> None:
        """Add the information (M,) of ranges to the diagonal of a chain."""
        first, at = self._groups()
        ends = np.append(first, len(H))
        for start in range(0, len(first), BLOCK):
            own = slice(ends[start], ends[min(start + BLOCK, len(first))])
            both = (H[own] * information[own, None])[:, :, None] * H[own, None, :]
            here = first[start : start + BLOCK]
            chain.D[at[start : start + BLOCK]] += np.add.reduceat(both, here - own.start)

    def minimise(self, x: Array, widen: float = 1.0, most: int = STEPS) -> tuple[Array, float]:
        """A local minimum by damped Gauss-Newton steps from ``x`` (n, d), and its cost."""
        cost, damping = self.cost(x, widen), 0.0
        k = np.arange(x.shape[1])
        for _ in range(most):
            chain, slope = self.normal(x, widen)
            # in units of what ranges tell: what the chain ties must stay free to move together
            told = 1.0 + (chain.D - self.motion.normal(x)[0].D)[:, k, k].mean(0)
            new = np.inf
            while damping < MOST_DAMPING:
                D = chain.D.copy()
                D[:, k, k] += damping * told
                try:
                    moved = x + solve(factor(Chain(D, chain.U)), slope)
                    new = self.cost(moved, widen)
                except LinAlgError:
                    new = np.inf
                if new <= cost:
                    break
                damping = max(10 * damping, 1e-3)
            if not new <= cost:
                break
            gain, cost, x = cost - new, new, moved
            damping = damping / 10 if damping > 1e-3 else 0.0
            if gain < DONE * np.sqrt(len(x)):
                break
        return x, cost

    def evidence(self, x: Array, cost: float) -> float:
        """Laplace's approximation of the log marginal likelihood [nats] at a minimum."""
        chain, _ = self.normal(x)
        posterior = log_determinant(factor(chain))
        return -cost + (self.motion.log_determinant(x) - posterior) / 2

    def covariance(self, x: Array) -> Array:
        """Covariances (n, d, d) at a minimum, as honest as the residuals can tell.

        The loss is not the log-likelihood of the noise that there is. For whatever noise, an
        estimate from residuals r with psi = rho' has the variance of one from Gaussian ranges
        with the information ``mean(psi')^2 / mean(psi^2)`` each: Huber, "Robust Statistics"
        (1981), section 3.2. Both means are taken over the recording; psi^2 is too small by the
        share of freedom that the fit has taken.
        """
        z, H = self.lengths(x)
        std = self.data.std
        r = (self.data.z - z) / std
        psi, above, below = (self.loss(s, std)[1] * s for s in (r, r + SMALL, r - SMALL))
        slope = max(float(np.mean((above - below) / (2 * SMALL))), 1e-3)
        taken, own = 0.0, slope
        for _ in range(2):
            chain, _ = self.motion.normal(x)
            own = slope**2 / (float(np.mean(psi**2)) / (1 - taken))
            self._add(chain, H, own / std**2)
            P = diagonal_of_inverse(chain)
            lever = np.einsum("mi,mij,mj->m", H, P[self.data.step], H, optimize=True)
            taken = min(float(np.mean(lever * own / std**2)), 0.9)
        return P


def _distances(p: Array, height: Array, place: Array) -> tuple[Array, Array]:
    """Distances (M,) of points (M, 2) at a ``height`` (M,) to places (M, 3); gradients (M, 3)."""
    away = np.column_stack((p, height)) - place
    d = np.maximum(np.linalg.norm(away, axis=1), 1e-6)
    return d, away / d[:, None]

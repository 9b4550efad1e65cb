"""Numbers with their standard errors, as solutions of equations that data make zero on average.

For scores s_b(theta) of B independent blocks the solution of sum s_b = 0 has the covariance
H^-1 (sum s_b s_b^T) H^-T with H the derivative of the sum: the *sandwich*, which holds where the
model of the noise does not. P. J. Huber, "The behavior of maximum likelihood estimates under
nonstandard conditions", 5th Berkeley Symposium (1967).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...models.records import Array

BLOCKS = 50
"""Blocks of consecutive times, within which errors may hang together."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number of a sensor: value and standard error, and the same from either half of the data."""

    name: str
    unit: str
    value: float
    stderr: float
    halves: tuple[tuple[float, float], tuple[float, float]] | None = None

    @property
    def split(self) -> float:
        """Difference of the halves in standard errors; NaN where it is not known."""
        if self.halves is None:
            return np.nan
        (a, s), (b, t) = self.halves
        spread = np.hypot(s, t)
        return float((a - b) / spread) if spread > 0 else np.nan


@dataclass(frozen=True, slots=True, eq=False)
class Residuals:
    """What is left of the detections of targets once the model is taken off.

    ``along`` and ``across`` (n,) [m] the way of the target, NaN where it stands or nobody knows;
    ``range`` (n,) [m], ``azimuth`` (n,) [rad] from the sensor, ``node`` (n,) which anchor where
    there are several; ``weight`` (n,) is how surely it is the target's. ``before`` and ``over``
    are along the way and along the range without latency and offsets, and with them. ``share``
    (k, 3): range [m], probability of detection there, standard error.
    """

    along: Array
    across: Array
    before: Array
    over: Array
    range: Array
    azimuth: Array
    node: Array
    weight: Array
    share: Array


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """A stream: its quantities, a held-out check, and what is left for a picture.

    ``settings`` are the parameters of estimators that follow. ``nis`` is the mean square of the
    residuals of either half by the model of the other, in units of what that expects: 1.
    """

    stream: str
    kind: str
    quantities: tuple[Quantity, ...]
    settings: dict[str, object]
    nis: tuple[float, float]
    residuals: Residuals
    nodes: tuple[str, ...] = ()


def blocks(count: int) -> Array:
    """Which block (count,) each of the times is in, consecutive ones together."""
    most = min(count, BLOCKS)
    return np.arange(count) * most // max(count, 1)


def summed(score: Array, block: Array) -> Array:
    """Scores (B, q) of blocks from those of times (n, q)."""
    out = np.zeros((int(block.max(initial=-1)) + 1, score.shape[1]))
    np.add.at(out, block, score)
    return out


def sandwich(score: Callable[[Array], Array], theta: Array, step: Array, block: Array) -> Array:
    """Covariance (q, q) of the solution ``theta`` (q,) of the equations ``score`` (n, q) = 0.

    Derivatives are differences over ``step`` (q,).
    """
    S = summed(score(theta), block)
    H = np.empty((len(theta), len(theta)))
    for k, h in enumerate(step):
        e = h * np.eye(len(theta))[k]
        H[:, k] = (score(theta + e).sum(0) - score(theta - e).sum(0)) / (2 * h)
    B = len(S)
    # A quantity that the data do not tell has no finite error.
    inverse = np.linalg.pinv(H)
    return np.asarray(inverse @ (S.T @ S) @ inverse.T * (B / max(B - 1, 1)))

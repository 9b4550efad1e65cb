"""Particles are drawn anew where their cloud is Gaussian, so that no offset dies out.

What ranges have too much is fixed for good, and so is the path by which it was found: of both,
resampling leaves what few ancestors happened to be, and hundreds of ranges later these are all on
one side of the truth. So after resampling a cloud is drawn toward its mean and spread again by
differences of its members, which keeps mean and covariance of motion, height and offsets together:
the kernel with shrinkage of Liu and West, "Combined parameter and state estimation in
simulation-based filtering", in Sequential Monte Carlo Methods in Practice (2001). This holds where
ranges are linear over the cloud and leave it Gaussian; rings and images of a position stay as they
are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..state import Event, State

SPREAD = 0.5
"""Share of the cloud's standard deviation that a member is spread by; the best width of a kernel
for 5,000 draws of a Gaussian of nine variables (Silverman, "Density Estimation", 1986, table 4.1).
"""
BENT = 0.5
"""What a range may be bent by over a standard deviation of the cloud, in units of its noise."""
CLEAR = 3.0
"""Standard deviations that the height is at least from where it ends."""


MOVED = np.array([0, 1, 2, 3, -1])
"""Rows of position, velocity and height."""


def renewed(state: State, event: Event, low: float, rng: np.random.Generator) -> State:
    """The particles, all of one weight, drawn anew where the cloud is a Gaussian.

    ``event`` is what they were weighed by, ``low`` [m] where heights end.
    """
    if not _is_linear(state, event, low):
        return state
    y, mean = state.y.copy(), state.mean.copy()
    # an offset and a scale that exclude each other are two clouds
    scaled = state.covariance[:, 0, 0] > 0 if mean.shape[1] else np.zeros(len(state.w), bool)
    for own in (np.flatnonzero(scaled), np.flatnonzero(~scaled)):
        if not len(own):
            continue
        rows = np.ix_(MOVED, own)
        x = np.vstack((y[rows], mean[own].T))
        middle = x.mean(1, keepdims=True)
        a, b = rng.integers(0, len(own), (2, len(own)))
        apart = SPREAD * np.sqrt(0.5) * (x[:, a] - x[:, b])
        x = middle + np.sqrt(1 - SPREAD**2) * (x - middle) + apart
        y[rows], mean[own] = x[: len(MOVED)], x[len(MOVED) :].T
    return replace(state, y=y, mean=mean)


def _is_linear(state: State, event: Event, low: float) -> bool:
    """Whether the ranges of the event are linear over the cloud, in place and height."""
    active, differences = event.active, event.differences
    heard = np.concatenate((active.rx, differences.rx, differences.tx))
    variance = np.concatenate((active.variance, differences.variance))
    if len(state.heading) or not len(variance):
        return False
    p = state.y[[0, 1, -1]]
    middle, P = p.mean(1), np.cov(p)
    if P[2, 2] > 0 and middle[2] - low < CLEAR * np.sqrt(P[2, 2]):
        return False
    nearest = np.linalg.norm(event.anchors[heard] - middle, axis=1).min()
    bent = np.linalg.eigvalsh(P)[-1] / 2
    return bool(bent < BENT * np.sqrt(variance.min()) * nearest)

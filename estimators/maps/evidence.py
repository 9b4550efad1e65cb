"""What several looks say of a target's class.

The readings of one target depend on each other: the network sees the same body again, often the
same side of it. A product of them, or of powers of them that sum to more than one, is far too sure.
So log p is the mean of the log-probabilities that were read, with weights that fade by ``memory``
from one to the one before and sum to one: R. T. Clemen and R. L. Winkler, "Combining probability
distributions from experts in risk analysis", Risk Analysis 19 (1999) 187-203, the logarithmic
opinion pool. Evidence (k, C + 1) is the faded sum of the log-probabilities of C classes and, last,
that of the weights.
"""

from __future__ import annotations

import numpy as np

from ...models.records import Array

LEAST = 1e-9
"""Least probability of a class, so that no single scan is the last word."""


def read(p: Array, before: Array | None = None, memory: float = 0.0) -> Array:
    """The evidence after probabilities p (k, C) were read, and evidence (k, C + 1) ``before``."""
    now = np.log(np.maximum(p, LEAST))
    now = np.hstack((now, np.ones((len(now), 1))))
    return now if before is None else now + memory * before


def likeliest(evidence: Array) -> Array:
    """The class (k,) that is most probable."""
    return np.asarray(evidence[:, :-1].argmax(1))


def probabilities(evidence: Array) -> Array:
    """Probabilities (k, C) of the classes; without evidence any is as likely."""
    p = np.exp(evidence[:, :-1] / np.maximum(evidence[:, -1:], LEAST))
    return np.asarray(p / p.sum(1, keepdims=True))


def for_shares(p: Array, trained: tuple[float, ...], shares: tuple[float, ...]) -> Array:
    """Probabilities p (k, C) of who was taught by ``trained`` shares of classes, for others."""
    weighed = p * (np.array(shares) / np.array(trained))
    return np.asarray(weighed / weighed.sum(1, keepdims=True))

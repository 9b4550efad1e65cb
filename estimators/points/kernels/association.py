"""Which target made which detection, each by itself, by loopy belief propagation.

J. L. Williams and R. Lau, "Approximate evaluation of marginal association probabilities with
belief propagation", IEEE Trans. Aerosp. Electron. Syst. 50 (2014) 2942-2959: exact where the
pairs that are possible make no circle, and always convergent.
"""

from __future__ import annotations

import numpy as np

from ....models.records import Array

_ROUNDS = 500
_STEADY = 1e-10
_SURE = 1e15
"""Odds that stand for certainty, so that sums do not lose what is beside them."""


def marginals(target: Array, detection: Array, odds: Array, T: int, n: int) -> tuple[Array, Array]:
    """Probability of each of k pairs, and (T,) that a target takes no detection.

    Of the pairs ``target`` (k,), ``detection`` (k,) each stands once, with the ``odds`` (k,) of the
    pair against the target being missed and the detection not being one of these targets'.
    """
    psi = np.minimum(odds, _SURE)
    nu = np.ones(len(psi))
    for _ in range(_ROUNDS):
        part = psi * nu
        mu = psi / (1 + np.bincount(target, part, T)[target] - part)
        before, nu = nu, 1 / (1 + np.maximum(np.bincount(detection, mu, n)[detection] - mu, 0.0))
        if np.abs(nu - before).max(initial=0.0) < _STEADY:
            break
    total = 1 + np.bincount(target, psi * nu, T)
    return psi * nu / total[target], 1 / total

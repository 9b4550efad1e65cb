"""The exponential of a Gaussian in a form that compilers vectorise."""

from __future__ import annotations

from numba import njit

FAST = {"reassoc", "contract", "nsz", "arcp"}
"""Floating-point freedoms of the twins: sums in any order; infinities keep their meaning."""


@njit(cache=True, fastmath=FAST, inline="always")
def exp_negative(t: float) -> float:
    """exp(-t) for t >= 0, zero from 32 on: the 64th power of a polynomial at t/64.

    The relative error grows from 0 to 4e-7 at t = 32 and is below 1e-12 for t < 8.
    """
    x = min(t, 32.0) * -0.015625
    y = 1 + x * (1 + x * (1 / 2 + x * (1 / 6 + x * (1 / 24 + x * (1 / 120 + x * (1 / 720))))))
    y += x**7 * (1 / 5040 + x * (1 / 40320))
    y *= y
    y *= y
    y *= y
    y *= y
    y *= y
    y *= y
    return y if t < 32.0 else 0.0

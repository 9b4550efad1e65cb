"""What compiled kernels are made of: less to compile than NumPy's own."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit

from .....models.records import Array

F = TypeVar("F", bound=Callable[..., Any])


def inner(function: F) -> F:
    """Compile what other kernels alone call: nothing is made that Python could call it by."""
    options: Any = {"cache": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    return cast(F, njit(**options)(function))


@inner
def falling(values: Array) -> Array:
    """Indices (n,) of ``values`` (n,) by falling value, equals as they stand: merge sort."""
    n = len(values)
    order, other = np.empty(n, np.int64), np.empty(n, np.int64)
    for i in range(n):
        order[i] = i
    width = 1
    while width < n:
        for left in range(0, n, 2 * width):
            a, b = left, min(left + width, n)
            middle, end = b, min(b + width, n)
            for i in range(left, end):
                if b == end or (a < middle and values[order[a]] >= values[order[b]]):
                    other[i] = order[a]
                    a += 1
                else:
                    other[i] = order[b]
                    b += 1
        order, other = other, order
        width *= 2
    return order

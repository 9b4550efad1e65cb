"""Arithmetic with numbers that may be too large or too small for it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
from numpy.linalg import LinAlgError

from .errors import EchosetError

_OUT_OF_RANGE = re.compile(
    "too large|cannot convert (float|complex)|infs or NaNs|negative dimensions|scale < 0|Singular"
    "|not positive definite|did not converge|low >= high|range exceeds valid bounds"
)


@contextmanager
def in_range(kind: type[EchosetError], place: str) -> Iterator[None]:
    """Raise a ``kind`` that names the ``place`` for errors of arithmetic, NumPy's among them.

    Such errors are what Python and its libraries make of numbers that are too large or too small.
    """
    try:
        with np.errstate(over="raise", invalid="raise", divide="raise"):
            yield
    except (ArithmeticError, ValueError) as error:
        known = ArithmeticError | LinAlgError
        if not (isinstance(error, known) or _OUT_OF_RANGE.search(str(error))):
            raise
        raise kind(f"{place}: {error}") from error

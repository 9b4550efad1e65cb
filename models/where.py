"""Places in a record, of which checks speak."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy as np

from .errors import FormatError
from .records import Array

_HIDDEN = re.compile(
    "[\\x00-\\x1f\\x7f-\\x9f\\u2028\\u2029\\u202a-\\u202e\\u2066-\\u2069\\ud800-\\udfff]"
)
"""Control characters, those that turn the direction of a text, and halves of characters."""


@dataclass(frozen=True, slots=True)
class Where:
    """A dataset or group ``name`` in the record ``path``: its checks fail with that name."""

    path: object
    name: str

    def __truediv__(self, name: str) -> Where:
        return Where(self.path, f"{self.name}/{name}")

    def fail(self, reason: str, *index: object) -> NoReturn:
        where = f"{self.name}[{', '.join(map(str, index))}]" if index else self.name
        raise FormatError(self.path, where, reason)

    def choice(self, value: object, known: Iterable[str]) -> None:
        """Fail unless ``value`` is one of the words ``known``."""
        if not isinstance(value, str) or value not in known:
            self.fail(f"{value!r} is not one of {' '.join(known)}")

    def words(self, value: object, unique: bool = True) -> None:
        """Fail unless ``value`` is a tuple of (different) strings."""
        if not isinstance(value, tuple) or not all(isinstance(word, str) for word in value):
            self.fail("must be a tuple of strings")
        for word in value:
            self.text(word)
        if unique and len(set(value)) < len(value):
            self.fail("names something twice")

    def text(self, value: object) -> None:
        """Fail unless ``value`` is a text that can be shown as it is."""
        if not isinstance(value, str):
            self.fail(f"must be a text, not {type(value).__name__}")
        found = _HIDDEN.search(value)
        if found:
            self.fail(f"holds the character {found[0]!a}, which cannot be shown")

    def group(self, value: object) -> None:
        """Fail unless ``value`` is a mapping."""
        if not isinstance(value, Mapping):
            self.fail(f"must be a group, not {type(value).__name__}")

    def none(self, bad: Any, values: Array, reason: str) -> None:
        """Fail at the first true element of ``bad``, quoting it from ``values``."""
        if bad.any():
            index = np.unravel_index(int(bad.argmax()), bad.shape)
            self.fail(f"{values[index].item()!r} {reason}", *(int(i) for i in index))

    def finite(self, values: Array) -> None:
        """Fail at the first NaN or infinity."""
        if values.dtype.kind == "f":
            self.none(~np.isfinite(values), values, "is not finite")

    def array(
        self, values: object, dtype: str, shape: tuple[int, ...], missing: bool = False
    ) -> Array:
        """``values`` if it is an array of this type and shape, finite unless ``missing``."""
        if not isinstance(values, np.ndarray):
            self.fail(f"must be an array, not {type(values).__name__}")
        if values.dtype != np.dtype(dtype):
            self.fail(f"has type {values.dtype}, needs {np.dtype(dtype)}")
        if values.shape != shape:
            self.fail(f"has shape {values.shape}, needs {shape}")
        if missing:
            self.none(np.isinf(values), values, "is not finite")
        else:
            self.finite(values)
        return values

    def increasing(self, values: Array, strictly: bool) -> None:
        """Fail at the first value that is not above (or, not strictly, below) the one before."""
        bad = np.zeros(len(values), bool)
        bad[1:] = values[1:] <= values[:-1] if strictly else values[1:] < values[:-1]
        self.none(bad, values, "is out of order")

    def probability(self, p: Array) -> None:
        """Fail at the first value outside [0, 1]."""
        self.none((p < 0) | (p > 1), p, "is not a probability")

    def unit(self, values: Array) -> None:
        """Fail at the first quaternion (..., 4) that does not have norm 1."""
        norm = np.linalg.norm(values, axis=-1)
        self.none(np.abs(norm - 1) > 1e-6, norm, "is not the norm of a unit quaternion")


ROUNDING = 1e-9
"""How far below zero, of correlations, an eigenvalue of a covariance may be."""


def indefinite(P: Array) -> Array:
    """Which (...,) of the symmetric matrices P (..., dx, dx) are not positive semidefinite.

    Where a variance is zero, its correlations count as if it were the least positive number.
    """
    std = np.sqrt(np.diagonal(P, axis1=-2, axis2=-1).clip(np.finfo(float).tiny))
    with np.errstate(over="ignore"):
        correlation = (P / std[..., :, None] / std[..., None, :]).clip(-1e9, 1e9)
    return np.asarray(np.linalg.eigvalsh(correlation)[..., 0] < -ROUNDING)

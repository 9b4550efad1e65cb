"""Errors of the parts of an object: its device, its centre, its extent."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...models.errors import InputError
from ...models.parameters import require
from ...models.records import Array, Objects
from .alignment import Pairs
from .extent import gaussian_wasserstein, has_extent, shape_matrix

PARTS = ("device", "centre", "extent")
_PREFIX = {"device": "device_", "centre": ""}


def axes(part: str, *objects: Objects) -> tuple[str, ...]:
    """The state columns of the position ``part`` (``device`` or ``centre``) that all have."""
    names = (_PREFIX[part] + axis for axis in "xyz")
    return tuple(n for n in names if all(n in o.state_names for o in objects))


def has(part: str, aligned: Pairs) -> bool:
    """Whether truth and estimate both have ``part``."""
    both = (aligned.estimate, aligned.truth)
    if part == "extent":
        return all(map(has_extent, both))
    return len(axes(part, *both)) >= 2


def check_parts(asked: Sequence[str], known: Sequence[str]) -> None:
    """Raise :class:`ParameterError` for a part that the metric does not know."""
    for part in asked:
        require(part in known, "parts", f"among {', '.join(known)}", part)


def chosen(asked: Sequence[str], known: Sequence[str], aligned: Pairs) -> list[str]:
    """The parts to score: those asked for, or else those of ``known`` that both sides have.

    Raises
    ------
    InputError : a part was asked for that truth or estimate lacks, or there is none at all
    """
    present = [part for part in known if has(part, aligned)]
    for part in asked:
        if part not in present:
            raise InputError(f"truth or estimate has no {part}")
    if not present:
        raise InputError(f"truth and estimate have none of {', '.join(known)} in common")
    return list(asked) or present


def deviation(part: str, aligned: Pairs) -> Array:
    """Estimated minus true position of ``part`` at each step, (k, 2 or 3) [m]."""
    names = axes(part, aligned.estimate, aligned.truth)
    return np.asarray(aligned.estimate.columns(*names) - aligned.truth.columns(*names))


def error(part: str, aligned: Pairs) -> Array:
    """Position error, or Gaussian-Wasserstein distance of the extents, at each step (k,) [m]."""
    if part == "extent":
        both = (aligned.estimate, aligned.truth)
        return gaussian_wasserstein(*map(shape_matrix, both))
    return np.asarray(np.linalg.norm(deviation(part, aligned), axis=1))


def errors(asked: Sequence[str], known: Sequence[str], aligned: Pairs) -> dict[str, Array]:
    """The :func:`error` (k,) of each of the :func:`chosen` parts.

    Raises
    ------
    InputError : a part was asked for that truth or estimate lacks, or there is none at all
    """
    return {part: error(part, aligned) for part in chosen(asked, known, aligned)}

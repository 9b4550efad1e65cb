"""Errors of the parts of an object: its device, its centre, its extent, its heading."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...models.errors import InputError
from ...models.geometry.extent import from_axes, squared_wasserstein
from ...models.records import Array, Objects
from .alignment import AlignedTrack

PARTS = ("device", "centre", "extent", "heading")
PLANAR = ("circle", "ellipse")
_PREFIX = {"device": "device_", "centre": ""}


def axes(part: str, *objects: Objects) -> tuple[str, ...]:
    """The state columns of the position ``part`` (``device`` or ``centre``) that all have."""
    names = (_PREFIX[part] + axis for axis in "xyz")
    return tuple(n for n in names if all(n in o.state_names for o in objects))


def has(part: str, aligned: AlignedTrack) -> bool:
    """Whether truth and estimate both have ``part``."""
    both = (aligned.estimate, aligned.truth)
    if part == "extent":
        return all(o.extent_kind in PLANAR and o.semi_axes is not None for o in both)
    if part == "heading":
        return all("heading" in o.state_names for o in both)
    return len(axes(part, *both)) >= 2


def chosen(asked: Sequence[str], known: Sequence[str], aligned: AlignedTrack) -> list[str]:
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


def _covariances(objects: Objects) -> Array:
    """The covariances (m, 2, 2) [m2] with the semi-axes of the ellipses as standard deviations."""
    assert objects.semi_axes is not None
    axes = np.broadcast_to(objects.semi_axes[:, :2], (len(objects.semi_axes), 2))
    rotation = np.zeros(len(axes)) if objects.rotation is None else objects.rotation
    return from_axes(axes, rotation)


def deviation(part: str, aligned: AlignedTrack) -> Array:
    """Estimated minus true position of ``part`` at each step, (k, 2 or 3) [m]."""
    names = axes(part, aligned.estimate, aligned.truth)
    return np.asarray(aligned.estimate.columns(*names) - aligned.truth.columns(*names))


def error(part: str, aligned: AlignedTrack) -> Array:
    """Error at each step (k,): of a position [m], of a heading [rad], or the Gaussian-Wasserstein
    distance of the extents [m]."""
    if part == "heading":
        a, b = (o.columns("heading")[:, 0] for o in (aligned.estimate, aligned.truth))
        return np.asarray(np.abs((a - b + np.pi) % (2 * np.pi) - np.pi))
    if part == "extent":
        both = (aligned.estimate, aligned.truth)
        return np.sqrt(squared_wasserstein(*map(_covariances, both)))
    return np.asarray(np.linalg.norm(deviation(part, aligned), axis=1))


def errors(asked: Sequence[str], known: Sequence[str], aligned: AlignedTrack) -> dict[str, Array]:
    """The :func:`error` (k,) of each of the :func:`chosen` parts.

    Raises
    ------
    InputError : a part was asked for that truth or estimate lacks, or there is none at all
    """
    return {part: error(part, aligned) for part in chosen(asked, known, aligned)}

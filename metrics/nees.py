"""Normalised estimation error squared: is the error as large as the covariance says?

``e^T P^-1 e`` is chi-square with dx degrees of freedom if the estimate is Gaussian and its
covariance right: mean dx = 2 for a position in the plane, and a single value inside
:func:`bounds` = [0.0506, 7.378] with probability 0.95. Over N independent recordings the mean lies
inside ``bounds(N)``; steps of one recording depend on each other. Bar-Shalom, Li, Kirubarajan,
Estimation with Applications to Tracking and Navigation, 2001, section 5.4.2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaincinv

from ..models.errors import InputError
from ..models.parameters import parameter
from ..models.records import Array, Estimates, Recording, Scores
from .kit.alignment import AlignedTrack, ScoredObject
from .kit.errors import axes, chosen, deviation
from .kit.measured import Measured, Names, of_track
from .kit.table import rows
from .protocol import Metric

PARTS = ("device", "centre")


@dataclass(frozen=True, slots=True)
class Params(ScoredObject):
    """The parts that are scored, and the probability of the bounds."""

    parts: tuple[str, ...] = parameter(
        (), "1", "device, centre; empty: all there are", within=PARTS
    )
    probability: float = parameter(
        0.95, "1", "probability of the two-sided bounds", within="(0, 1)"
    )


def bounds(n: int = 1, dx: int = 2, probability: float = 0.95) -> tuple[float, float]:
    """Two-sided bounds of the mean of ``n`` independent chi-square values of ``dx`` degrees."""
    tail = (1 - probability) / 2
    low, high = 2 / n * gammaincinv(n * dx / 2, [tail, 1 - tail])
    return float(low), float(high)


def nees(part: str, aligned: AlignedTrack) -> Array:
    """The normalised error squared of the position ``part`` at each step, (k,)."""
    objects = aligned.estimate
    if objects.covariance is None:
        raise InputError("the estimates have no covariance")
    columns = [objects.state_names.index(n) for n in axes(part, objects, aligned.truth)]
    P = objects.covariance[:, columns][:, :, columns]
    e = deviation(part, aligned)[..., None]
    try:
        return np.asarray((e * np.linalg.solve(P, e)).sum((1, 2)))
    except np.linalg.LinAlgError:
        raise InputError(f"a covariance of the {part} is singular") from None


def _values(aligned: AlignedTrack, params: Params) -> dict[str, Array]:
    return {part: nees(part, aligned) for part in chosen(params.parts, PARTS, aligned)}


def measure(estimates: Estimates, recording: Recording, params: Params) -> Measured:
    """``nees`` per step; lists the numbers of dimensions.

    Raises
    ------
    InputError : no truth, no or a singular covariance, or several objects
    """
    found = of_track(_values)(estimates, recording, params)
    truth = [] if recording.truth is None else [recording.truth.objects]
    count = {p: np.array([len(axes(p, estimates.objects, *truth))]) for p in found.values}
    return replace(found, lists={**found.lists, **count})


def summarise(names: Names, measured: Measured, params: Params) -> Scores:
    """``nees`` per step and its mean, and ``nees-inside``, the fraction inside the bounds."""
    tables = []
    for part, value in measured.values.items():
        low, high = bounds(1, int(measured.lists[part][0]), params.probability)
        inside = np.mean((low <= value) & (value <= high))
        tables += [
            rows((*names, "nees", part), measured.time, value),
            rows((*names, "nees", part), np.nan, value.mean(), len(value)),
            rows((*names, "nees-inside", part), np.nan, inside, len(value)),
        ]
    return Scores.join(tables)


METRIC = Metric(
    "normalised estimation error squared of the position, and how often it is in its bounds",
    Params,
    measure,
    summarise,
    PARTS=PARTS,
)

"""Smoothing of the components of a Gaussian-mixture PHD filter, each back along its descent.

A component descends from the strongest of those that merged into it, and so from one of the time
before. Its line is a trajectory: moments by Rauch, Tung and Striebel, existence as that of a Markov
chain (:mod:`.kernels.smoothing`). Of the forward-backward recursion of the intensity (R. P. S.
Mahler, B.-T. Vo and B.-N. Vo, "Forward-backward probability hypothesis density smoothing", IEEE
Trans. Aerosp. Electron. Syst. 48 (2012) 707-728) it is the part that goes along one line: that
recursion pairs every component with all later ones, and gives no trajectories.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...models.records import Array
from .kernels.modes import Way
from .kernels.smoothing import existed, rts
from .source import Classes

ANEW = 1 << 40
"""Labels from here on are those of lines that the filter gave the label of another one."""


@dataclass(frozen=True, slots=True, eq=False)
class Strands:
    """J lines at ``time_ns`` by ``label`` (J,): r (J,), m (J, dx), P (J, dx, dx).

    ``origin`` (J,) is the component that each was a time before, -1 for none, in which it may have
    been one of several targets; F and Q (dx, dx) are the motion from then, which targets
    ``survive`` with that probability. Of what the filter knew r is the weight, of any size.
    ``anew`` counts labels that had to be made; ``way`` is how those that manoeuvre came.
    """

    time_ns: int
    label: Array
    origin: Array
    r: Array
    m: Array
    P: Array
    F: Array
    Q: Array
    survive: float
    classes: Classes = field(default_factory=dict)
    anew: int = 0
    way: Way | None = None


def back(later: Strands | None, now: Strands) -> Strands:
    """The lines at the time of ``now``, of its components, given those ``later``, the next time.

    A component stands for as many targets as it weighs, rounded, at least one: so many of the lines
    that come from it are different ones, those most likely to exist; the others are the same.
    """
    number = np.maximum(np.rint(now.r).astype(np.int64), 1)
    r = np.minimum(now.r / number, 1.0)
    if later is None:
        label, anew = _different(now.label, r, 0)
        return replace(now, label=label, r=r, anew=anew)
    most = _strongest(later, number)
    here = later.origin[most]
    # The rest end here: later they are nowhere.
    rest = np.setdiff1d(np.arange(len(r)), here)
    j = np.concatenate((here, rest))
    ahead = np.concatenate((_summed(later, most, number), np.zeros(len(rest))))
    r = existed(r[j], ahead, later.survive)
    m, P, n = now.m[j], now.P[j], len(most)
    ahead_of = later.m[most], later.P[most]
    if later.way is None:
        m[:n], P[:n] = rts(m[:n], P[:n], *ahead_of, later.F, later.Q)
    else:
        m[:n], P[:n] = later.way.back(here, m[:n], P[:n], *ahead_of)
    label = np.concatenate((later.label[most], now.label[rest]))
    label, anew = _different(label, r, later.anew)
    alive = set(label.tolist())
    kept = {l: p for l, p in later.classes.items() if l in alive}
    return replace(
        now, label=label, origin=now.origin[j], r=r, m=m, P=P, classes={**now.classes, **kept},
        anew=anew,
    )  # fmt: skip


def _strongest(later: Strands, number: Array) -> Array:
    """Of the lines ``later`` those (n,) that are different targets, by the component before."""
    order = np.lexsort((-later.r, later.origin))
    order = order[later.origin[order] >= 0]
    origin = later.origin[order]
    rank = np.arange(len(origin)) - np.searchsorted(origin, origin)
    return order[rank < number[origin]]


def _summed(later: Strands, most: Array, number: Array) -> Array:
    """Existence (n,) later of the lines ``most``, with what those that are the same add."""
    r = np.zeros(len(later.r))
    r[most] = later.r[most]
    some = later.origin >= 0
    all_ = np.bincount(later.origin[some], later.r[some], len(number))
    kept = np.bincount(later.origin[most], later.r[most], len(number))
    share = np.where(kept > 0, all_ / np.maximum(kept, 1e-300), 1.0)
    return np.minimum(r[most] * share[later.origin[most]], 1.0)


def _different(label: Array, r: Array, anew: int) -> tuple[Array, int]:
    """The labels, of equal ones the likeliest keeping it, and the count of those made anew."""
    order = np.lexsort((-r, label))
    again = order[1:][label[order][1:] == label[order][:-1]]
    # Who hardly exists needs no label of its own.
    again, label = again[r[again] > 0.01], label.copy()
    label[again] = ANEW + anew + np.arange(len(again))
    return label, anew + len(again)

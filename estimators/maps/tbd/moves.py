"""New targets in what the maps hold beyond the others, and second thoughts about those held.

A scene's score is the tempered log-likelihood of all cells less a price for each target. A move
proposes another explanation of a few targets and is taken where the score rises.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ....models.records import Array
from .params import Params
from .scene import View, windows
from .targets import PEDESTRIAN, REACH, VEHICLE, Targets, correct, jumped, modes, prior, vector

HEADINGS, TRIED = 12, 2
"""Headings of a vehicle in half a turn, and how many of the best of a class are refined."""
PARTS = np.array([[0, 0], [1, 1], [1, -1], [-1, 1], [-1, -1], [1, 0], [-1, 0], [0, 1], [0, -1]])
"""Where on a vehicle its brightest part may be, in halves of length and width."""
APART, BESIDE = 0.5, 0.3
"""Least distance [m] of two pedestrians, and of a pedestrian's middle from a vehicle's outline."""
TENTATIVE = 0.3
"""Share of its price that a new target must be worth to be followed; it is shown when it exists."""
LEAST, FAILED = 5.0, -2.0
"""Evidence of a place from which on it is looked at, and after it has been in vain."""
AT_FIRST = 1.5
"""Most log-odds of existence of what one scan has shown."""
FEWER = 1.0
"""What it is worth to do with one target less."""
CROWD = 6.0
"""Distance [m] up to which targets are explained together."""


def score(view: View, mean: Array, more: int, params: Params) -> float:
    """Tempered log-likelihood of a scene with ``more`` targets than before, less their price.

    One scan says little against a target that many have seen: fewer are hardly worth more.
    """
    price = params.birth_price if more > 0 else FEWER
    return params.weight * view.log_likelihood(mean, params.shape) - price * more


def proposals(place: Array, params: Params) -> Iterator[tuple[int, Array, float]]:
    """Class, place and heading of what may reflect most at ``place`` (2,)."""
    yield PEDESTRIAN, place, 0.0
    half = np.array([params.vehicle_length, params.vehicle_width]) / 2
    for heading in np.arange(HEADINGS) * np.pi / HEADINGS:
        c, s = np.cos(heading), np.sin(heading)
        for part in PARTS * half:
            yield VEHICLE, place - part @ np.array([[c, s], [-s, c]]), heading


def best(
    view: View, mean: Array, place: Array, others: Targets, params: Params
) -> tuple[float, int, Array, Array, float] | None:
    """Gain, class, state, covariance of what explains ``place`` best, and its lead as a vehicle."""
    at = windows(view.layout, place[0], place[1], REACH[VEHICLE])
    tried: list[list[tuple[float, Array, float]]] = [[], []]
    for kind, where, heading in proposals(place, params):
        x = np.array([*where, heading, 0.0, 0.0, 0.0, 0.0])
        gain, _, _ = view.fit(mean, kind, x, at, params.shape, False)
        tried[kind].append((gain, where, heading))
    found = []
    for kind, some in enumerate(tried):
        for _, where, heading in sorted(some, key=lambda t: -t[0])[:TRIED]:
            x, P = prior(params, where, heading)
            m, S = x, P
            for _ in range(1 + kind):
                start, _ = jumped(view, mean, kind, m, P, modes(kind, m, params), at, params)
                m, S, gain = correct(view, mean, kind, start, P, start, at, params)
            if clear(kind, m, others, params):
                found.append((gain, kind, m, S))
    if not found:
        return None
    lead = [max((f[0] for f in found if f[1] == kind), default=-np.inf) for kind in (0, 1)]
    return *max(found, key=lambda f: f[0]), float(np.clip(lead[1] - lead[0], -5.0, 5.0))


def clear(kind: int, m: Array, others: Targets, params: Params) -> bool:
    """Whether a body does not overlap the ``others``."""
    half = np.array([params.vehicle_length, params.vehicle_width]) / 2
    for k, o in zip(others.kind.tolist(), others.m, strict=True):
        d = o[:2] - m[:2]
        if np.hypot(*d) > 3 * half[0] + 1:
            continue
        if kind == k == PEDESTRIAN:
            if np.hypot(*d) < APART:
                return False
            continue
        pairs = [(m, kind, d, k, o), (o, k, -d, kind, m)]
        for a, of, way, other, b in pairs:
            if of != VEHICLE:
                continue
            R = np.array([[np.cos(a[4]), np.sin(a[4])], [-np.sin(a[4]), np.cos(a[4])]])
            if other == PEDESTRIAN:
                points = np.zeros((1, 2))
            else:
                c, s = np.cos(b[4]), np.sin(b[4])
                points = 0.8 * np.exp(b[6]) * PARTS * half @ np.array([[c, s], [-s, c]])
            size = half * np.exp(a[6])
            size = size * 0.8 if other == VEHICLE else size + BESIDE
            inside = np.abs((way + points) @ R.T) < size
            if inside.all(1).any():
                return False
    return True


def overlapping(targets: Targets, params: Params) -> Array:
    """Which (n,) overlap with one that exists more surely; of equals, not the vehicle."""
    found = np.zeros(len(targets), bool)
    order = np.lexsort((targets.label, -targets.kind, -np.round(targets.exists)))
    for k, i in enumerate(order):
        before = targets.take(order[:k][~found[order[:k]]])
        found[i] = not clear(int(targets.kind[i]), targets.m[i], before, params)
    return found


def born(
    targets: Targets,
    view: View,
    mean: Array,
    evidence: Array,
    free: int,
    most: int,
    params: Params,
) -> tuple[Targets, int]:
    """The targets with new ones where ``evidence`` (J,) of the places is; ``mean`` follows.

    Labels begin at ``free``; at most ``most`` places are looked at.
    """
    places = view.layout.places
    for _ in range(most):
        j = int(evidence.argmax()) if len(evidence) else 0
        if not len(evidence) or evidence[j] < LEAST:
            break
        found = best(view, mean, places[j], targets, params)
        evidence[np.hypot(*(places - places[j]).T) < 1.0] = FAILED
        if found is None or found[0] < params.birth_price * TENTATIVE:
            continue
        gain, kind, m, P, lead = found
        targets = targets.join(one(kind, m, P, gain - params.birth_price, lead, free))
        free += 1
        view.add(mean, 1.0, kind, vector(m), view.whole)
        np.minimum(evidence, view.gains(mean, params.shape), out=evidence)
    return targets, free


def one(kind: int, m: Array, P: Array, exists: float, lead: float, label: int) -> Targets:
    """A single target."""
    odds = max(lead, 0.1) if kind == VEHICLE else min(lead, -0.1)
    return Targets(
        m[None], P[None], np.array([kind]), np.array([min(exists, AT_FIRST)]), np.array([odds]),
        np.array([label]), np.zeros(1, np.int64),
    )  # fmt: skip


def without(targets: Targets, view: View, mean: Array, index: Array) -> tuple[Targets, Array]:
    """The targets but for those at ``index``, and the mean without them."""
    mean = mean.copy()
    for i in index:
        view.add(mean, -1.0, int(targets.kind[i]), vector(targets.m[i]), view.whole)
    np.maximum(mean, 1.0, out=mean)
    return targets.take(np.setdiff1d(np.arange(len(targets)), index)), mean


def refitted(
    targets: Targets, view: View, mean: Array, index: Array, params: Params
) -> tuple[Targets, Array]:
    """The targets with those at ``index`` fitted again, from wherever their modes may be."""
    m, P, mean = targets.m.copy(), targets.P.copy(), mean.copy()
    for i in index:
        kind = int(targets.kind[i])
        view.add(mean, -1.0, kind, vector(m[i]), view.whole)
        np.maximum(mean, 1.0, out=mean)
        at = windows(view.layout, m[i, 0], m[i, 1], REACH[kind])
        start, S = jumped(view, mean, kind, m[i], P[i], modes(kind, m[i], params), at, params)
        m[i], P[i], _ = correct(view, mean, kind, m[i], S, start, at, params)
        view.add(mean, 1.0, kind, vector(m[i]), view.whole)
    return replace(targets, m=m, P=P), mean


def rethought(
    targets: Targets, view: View, mean: Array, about: int, free: int, params: Params
) -> tuple[Targets, Array, int]:
    """The targets with those near the one at ``about`` explained anew, if that is better."""
    d = np.hypot(*(targets.m[:, :2] - targets.m[about, :2]).T)
    near = np.flatnonzero(d < CROWD)
    top, chosen = score(view, mean, 0, params) + params.birth_price / 2, None
    places = view.layout.places
    far = np.hypot(*(places - targets.m[about, :2]).T) > CROWD + 3
    for index, seed in _groups(targets, about, near, params):
        kept, rest = without(targets, view, mean, index)
        next_free = free
        if seed is not None:
            one_ = best(view, rest, seed, kept, params)
            if one_ is None or one_[1] != VEHICLE:
                continue
            gain, kind, m, P, lead = one_
            kept = kept.join(one(kind, m, P, gain - params.birth_price, lead, next_free))
            next_free += 1
            view.add(rest, 1.0, kind, vector(m), view.whole)
        evidence = view.gains(rest, params.shape)
        evidence[far] = -np.inf
        found, next_free = born(kept, view, rest, evidence, next_free, 2 * len(index) + 2, params)
        after = score(view, rest, len(found) - len(targets), params)
        if after > top:
            top, chosen = after, (found, rest, next_free)
    return (targets, mean, free) if chosen is None else _relabelled(targets, *chosen, free)


def _groups(
    targets: Targets, about: int, near: Array, params: Params
) -> Iterator[tuple[Array, Array | None]]:
    """Which targets are explained together, and a place where a vehicle is tried first."""
    yield np.array([about]), None
    if len(near) == 1:
        return
    yield near, None
    if targets.kind[about] == PEDESTRIAN:
        p = targets.m[:, :2]
        d = np.hypot(*(p - p[about]).T)
        parts = np.flatnonzero((targets.kind == PEDESTRIAN) & (d < params.vehicle_length + 1))
        for size in range(len(parts), 1, -1):
            some = parts[np.argsort(d[parts], kind="stable")[:size]]
            yield some, p[some].mean(0)


def needed(targets: Targets, view: View, mean: Array, about: int, params: Params) -> float:
    """What a target adds to the score if those near it do as well as they can without it."""
    d = np.hypot(*(targets.m[:, :2] - targets.m[about, :2]).T)
    near = np.flatnonzero((d < CROWD) & (d > 0))
    kept, rest = without(targets, view, mean, np.array([about]))
    kept, rest = refitted(kept, view, rest, near - (near > about), params)
    gain = view.log_likelihood(mean, params.shape) - view.log_likelihood(rest, params.shape)
    return params.weight * gain


def _relabelled(
    before: Targets, after: Targets, mean: Array, free: int, first: int
) -> tuple[Targets, Array, int]:
    """New targets with the labels of those that they replace, the nearest of their class."""
    label, exists = after.label.copy(), after.exists.copy()
    gone = [i for i in range(len(before)) if before.label[i] not in label]
    for j in np.flatnonzero(label >= first):
        d = [
            np.hypot(*(before.m[i, :2] - after.m[j, :2])) + 2.0 * (before.kind[i] != after.kind[j])
            for i in gone
        ]
        if d and min(d) < 3.0:
            i = gone.pop(int(np.argmin(d)))
            label[j] = before.label[i]
            exists[j] = max(exists[j], before.exists[i])
    return replace(after, label=label, exists=exists), mean, free

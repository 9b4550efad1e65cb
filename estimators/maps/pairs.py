"""Two pedestrians who are followed as one: told apart by their brightest pixels and the network.

Who walks beside another from the first scan on is never alone in a cluster, and the one target
between both would be followed for good. Not in the paper, whose clusters stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.cluster.vq import kmeans2

from ...models.classifier import CLASSES
from ...models.records import Array
from .kernels.compiled import pixels as compiled_pixels
from .kernels.fusion import Pixels
from .params import MapParams

PEDESTRIAN = CLASSES.index("pedestrian")
SHARE = 0.3
"""Share of a target's brightest pixel that its pixels must have: sidelobes have less."""
SURE = 0.97
"""Probability above which the network is believed that a pedestrian is there."""
_ROUNDS = 8


def split(
    params: MapParams,
    pixels: Pixels,
    noise: float,
    identify: Callable[[int, Array, Array], Array] | None,
    time_ns: int,
    soft: Array,
    where: Array,
    kind: Array,
) -> tuple[Array, Array]:
    """Positions (n, 2) and classes (n,) of targets, with two in place of one that is a pair.

    Of a pedestrian among the targets at ``where`` (k, 2) of classes ``kind`` (k,), the brightest
    pixels are parted in two. It is a pair if the distance of the halves lies between the two of
    ``params.pair``, other targets leave both room, and ``identify`` gives a pedestrian at both.
    The second halves come last.
    """
    shortest, longest = params.pair
    if identify is None or longest <= shortest:
        return where, kind
    row, column, point = pixels.above(soft, params.excision * noise)
    gate, room = (np.array(sizes)[kind] for sizes in (params.gates, params.rooms))
    known = compiled_pixels.nearest(point, np.ascontiguousarray(where, float), gate, room)
    found: dict[int, Array] = {}
    for i in np.flatnonzero(kind == PEDESTRIAN).tolist():
        mine = known == i
        if mine.sum() < params.min_pixels:
            continue
        power = soft[row[mine], column[mine]]
        two = halves(point[mine][power > SHARE * power.max()])
        others = np.delete(where, i, axis=0)[:, None], np.delete(room, i)[:, None]
        free = np.hypot(*(others[0] - two).T) >= (others[1] + params.room_pedestrian).T
        if shortest < np.hypot(*(two[1] - two[0])) < longest and free.all():
            found[i] = two
    if not found:
        return where, kind
    p = identify(time_ns, soft, np.concatenate([*found.values()]))[:, PEDESTRIAN].reshape(-1, 2)
    pairs = {i: two for (i, two), sure in zip(found.items(), p.min(1) > SURE, strict=True) if sure}
    first = where.copy()
    for i, two in pairs.items():
        first[i] = two[0]
    second = np.array([two[1] for two in pairs.values()]).reshape(-1, 2)
    more = np.full(len(second), PEDESTRIAN)
    return np.concatenate((first, second)), np.concatenate((kind, more))


def halves(point: Array) -> Array:
    """Centres (2, 2) of ``point`` (n, 2) parted by 2-means, from its principal axis on."""
    if len(point) < 2:
        return np.repeat(point.mean(0, keepdims=True), 2, axis=0)
    variance, axis = np.linalg.eigh(np.cov(point.T))
    reach = np.sqrt(variance[1]) * axis[:, 1]
    start = point.mean(0) + np.stack((-reach, reach))
    return np.asarray(kmeans2(point, start, iter=_ROUNDS, minit="matrix", missing="raise")[0])

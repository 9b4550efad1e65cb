"""Extended targets where every detection's target and point of reflection are told.

The position is the mean of the detections, weighted by the inverse of the sensor's covariance at
the true reflection point plus that of the true extent; the extent is their scatter about the true
centre less the sensor's covariance, in the box of the prior. The covariance is the true one where
the recording has it (``origin_cov_xx`` ...), else that of the tables. A target without detections
has no estimate. A reference, no bound: who uses how many detections a volume sends, and the prior,
can be better in the extents, of which few detections tell little.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ...models.errors import InputError
from ...models.geometry import extent
from ...models.parameters import parameter
from ...models.records import Array, Estimates, Recording, Scan
from ..presets import Presets
from .output import objects
from .params import SceneParams
from .plane import columns
from .scene import epochs, grid
from .sensors import STREAMS, UPPER, noise, resolved

SUMMARY = "extended targets by means and scatters under the true association (uses the truth)"
USES_TRUTH = True
"""``setup`` is the whole recording, with truth and origins."""
PRESETS = Presets(__package__, "oracle")
__all__ = ["PRESETS", "STREAMS", "SUMMARY", "USES_TRUTH", "Params", "estimate", "resolved"]


@dataclass(frozen=True, slots=True)
class Params(SceneParams):
    """The prior box of the extents, the region, and how many epochs are processed together."""

    TITLE = "what is processed"

    epochs: int = parameter(
        0, "1", "epochs processed together, 0 for all so far", within="[0, inf)"
    )


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """Yield the estimates after each epoch.

    Raises
    ------
    InputError : the recording lacks truth, extents or the origins of its detections
    """
    if setup.truth is None:
        raise InputError(f"{setup.meta.name}: the oracle needs the truth")
    nodes, d = grid(params, setup), params.dimension
    truth = setup.truth.objects
    try:
        state = truth.columns(*"xyz"[:d], *extent.names(d))
    except KeyError as error:
        raise InputError(f"{setup.meta.name}: {error.args[0]} in the truth") from error
    label, first = np.unique(truth.label, return_index=True)
    targets = np.tile(np.array([0.0, 0, 0, 1, 0, 1, 0, 0, 1]), (len(label), 1))
    targets[:, columns(d)] = state[first]
    parts: list[tuple[Array, Array, Array]] = []
    number = dict.fromkeys(setup.streams, 0)
    for time_ns, states in epochs(params, setup, scans, nodes):
        found = []
        for name in number:
            stream = setup.streams[name]
            while (k := number[name]) < len(stream) and stream.time_ns[k] <= time_ns:
                rows = slice(*stream.row_offset[k : k + 2])
                found.append(_origins(stream.rows, rows, d, name))
                number[name] += 1
        z = [s.z for s in states]
        origin = [label_[s.order] for s, (label_, *_) in zip(states, found, strict=True)]
        points = [p[s.order] for s, (_, p, _) in zip(states, found, strict=True)]
        points = [np.where(np.isnan(p), a, p) for p, a in zip(points, z, strict=True)]
        noises = noise((s.table for s in states), nodes, points)
        true = np.concatenate([S[s.order] for s, (*_, S) in zip(states, found, strict=True)])
        noises = np.where(np.isnan(true), noises, true)
        parts.append((np.concatenate(z), np.concatenate(origin), noises))
        parts = parts[-params.epochs :]
        told = [np.concatenate(column) for column in zip(*parts, strict=True)]
        yield _estimates(setup, time_ns, told, label, targets, params)


def _origins(
    rows: Mapping[str, Array], part: slice, d: int, name: str
) -> tuple[Array, Array, Array]:
    """Labels (m,), points of origin (m, 3) and covariances (m, 3, 3) there, NaN if not known."""
    names = ["origin_id", *(f"origin_{a}" for a in "xyz"[:d])]
    absent = [n for n in names if n not in rows]
    if absent:
        raise InputError(f"streams/{name}: the oracle needs the column {absent[0]!r}")
    label, *point = (rows[n][part] for n in names)
    S = np.full((len(label), 3, 3), np.nan)
    keys = [f"origin_cov_{'xyz'[i]}{'xyz'[j]}" for i, j in np.transpose(UPPER)]
    if d == 3 and all(k in rows for k in keys):
        S[:, *UPPER] = S[:, *UPPER[::-1]] = np.stack([rows[k][part] for k in keys], -1)
    return label, np.stack([*point, *[np.zeros(len(label))] * (3 - d)], -1), S


def _estimates(
    setup: Recording,
    time_ns: int,
    told: list[Array],
    label: Array,
    targets: Array,
    params: Params,
) -> Estimates:
    z, origin, S = told
    d = params.dimension
    seen, x = [], []
    for i, C in zip(label.tolist(), targets, strict=True):
        mine = origin == i
        if mine.any():
            E = extent.covariance(C[3:])
            seen.append(i)
            x.append(fit(z[mine], S[mine], C[:3], E, params.extent_box, d))
    count = np.array([len(seen)], float)
    steps = {"cardinality_mean": count, "cardinality_variance": np.zeros(1)}
    found = np.array(x).reshape(-1, 9)
    return Estimates(setup.meta, objects(time_ns, found, np.array(seen, np.int64), d), steps)


def fit(z: Array, S: Array, c: Array | None, E: Array, box: tuple[Array, Array], d: int) -> Array:
    """Centre and extent (9,) of a target from its detections z (m, 3) with noise S (m, 3, 3).

    ``E`` (3, 3) is the covariance of its reflection points that the weights assume, ``c`` the
    centre about which they scatter, None for the estimate itself.
    """
    W = np.linalg.inv((S + E)[:, :d, :d])
    mean = np.zeros(3)
    mean[:d] = np.linalg.solve(W.sum(0), np.einsum("mij,mj->i", W, z[:, :d]))
    y = z - (mean if c is None else c)
    scatter = np.einsum("mi,mj->ij", y, y) / len(z) - S.mean(0)
    e = np.array([1.0, 0, 1, 0, 0, 1])
    at = np.array(columns(d)[d:]) - 3
    lower, upper = box
    e[at] = extent.fit(scatter[:d, :d], lower[at], upper[at])
    return np.concatenate([mean, e])

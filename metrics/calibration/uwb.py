"""Ranges of a UWB network: noise, offset by anchor, scale, height of the device and rates.

A link event at distance d has the intensity mu N(z; (1 + scale) d + offset, sigma^2) + rho of
ranges near it, as :mod:`.radar` says of detections.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.columns import ACTIVE
from ...models.errors import InputError
from ...models.geometry.poses import poses_at
from ...models.parameters import parameter
from ...models.records import Array, Recording
from .quantities import Calibration, Quantity, Residuals, blocks, sandwich
from .tracks import Track, places, tracks

CLOSE, ROUNDS, FEW = 1e-8, 300, 30
STARTS = (-1.5, 1.5)
"""Heights [m] over the anchors from which the device's is sought."""


@dataclass(frozen=True)
class UwbParams:
    """What is looked at."""

    TITLE = "UWB"

    reach_uwb: float = parameter(
        3.0, "m", "how far from the true distance ranges are looked at", within="(0, inf)"
    )


@dataclass(frozen=True, slots=True, eq=False)
class Data:
    """Link events (K,) with the anchor ``node`` (K,) of each, and ranges z (N,) [m] of them.

    ``device``, ``anchor`` (K, 3) are where they were; ``flat`` says that the truth has no height.
    """

    node: Array
    device: Array
    anchor: Array
    z: Array
    event: Array
    nodes: tuple[str, ...]
    flat: bool

    def half(self, which: int) -> Data:
        """Every other block of the events."""
        kept = blocks(len(self.node)) % 2 == which
        rows, new = kept[self.event], np.cumsum(kept) - 1
        return replace(
            self,
            node=self.node[kept],
            device=self.device[kept],
            anchor=self.anchor[kept],
            z=self.z[rows],
            event=new[self.event[rows]],
        )


@dataclass(frozen=True, slots=True, eq=False)
class Model:
    """Scale [1], height [m], offsets (J,), log deviation, ranges mu of an event, density rho."""

    scale: float
    height: float
    offset: Array
    log_std: float
    mu: float
    rho: float

    @property
    def vector(self) -> Array:
        """All numbers."""
        return np.array([self.scale, self.height, *self.offset, self.log_std, self.mu, self.rho])

    @staticmethod
    def of(v: Array) -> Model:
        """From :attr:`vector`."""
        scale, height, *offset, log_std, mu, rho = v.tolist()
        return Model(scale, height, np.array(offset), log_std, mu, rho)


def calibrate(recordings: Sequence[Recording], name: str, params: UwbParams) -> Calibration:
    """What the active links of the UWB stream ``name`` are like.

    Raises
    ------
    InputError : a recording has no truth of its device, or there are too few ranges
    """
    data = gathered(recordings, name)
    if len(data.z) < FEW:
        raise InputError(f"{name}: {len(data.z)} ranges while the truth is known: too few")
    level = float(data.anchor[:, 2].mean())
    heights = [level + s for s in STARTS] if data.flat else [0.0]
    tried = [fit(data, started(data, h, params), params.reach_uwb) for h in heights]
    # Above and below anchors of one height are alike: of equals the lower.
    model = min(tried, key=lambda one: (round(one.log_std, 6), one.height))
    found = quantities(data, model, params.reach_uwb)
    halves = [data.half(0), data.half(1)]
    own = [fit(half, model, params.reach_uwb) for half in halves]
    parts = [quantities(half, one, params.reach_uwb) for half, one in zip(halves, own, strict=True)]
    both = tuple(
        replace(q, halves=((a.value, a.stderr), (b.value, b.stderr)))
        for q, a, b in zip(found, *parts, strict=True)
    )
    nis = tuple(_nis(halves[k], own[1 - k], params.reach_uwb) for k in (0, 1))
    left = residuals(data, model, params.reach_uwb)
    return Calibration(name, "uwb", both, settings(both, data), (nis[0], nis[1]), left, data.nodes)


def settings(found: Sequence[Quantity], data: Data) -> dict[str, object]:
    """What estimators take, from the quantities."""
    q = {one.name: one for one in found}
    offset = np.array([one.value for one in found if one.name.startswith("offset ")])
    out: dict[str, object] = {
        "sigma": q["sigma"].value,
        "range_bias": float(offset.mean()),
        "mean_clutter": max(q["mean_clutter"].value, 0.0),
    }
    if data.flat and q["device_height"].value >= 0:
        out["device_height"] = q["device_height"].value
    return out


def gathered(recordings: Sequence[Recording], name: str) -> Data:
    """The active links while the truth of their device is known.

    Raises
    ------
    InputError : a recording has no truth of its device
    """
    known = tracks(recordings, 0.0)
    flat = not any("z" in r.truth.objects.state_names for r in recordings if r.truth)
    nodes: dict[str, int] = {}
    parts, count = [], 0
    for number, recording in enumerate(recordings):
        stream = recording.streams[name]
        kinds = [recording.sensors[n].kind for n in stream.nodes]
        tx, rx = stream.scan["tx"], stream.scan["rx"]
        is_device = np.array([kind == "device" for kind in kinds])
        active = (stream.scan["mode"] == ACTIVE) & (is_device[tx] != is_device[rx])
        device, anchor = np.where(is_device[tx], tx, rx), np.where(is_device[tx], rx, tx)
        time = stream.time_ns / 1e9
        which = np.full(len(stream), -1)
        for d in np.unique(device[active]).tolist():
            track = _carried(recording, stream.nodes[d], known, number)
            which[active & (device == d) & known[track].knows(time)] = track
        used = np.flatnonzero(which >= 0)
        for a in np.unique(anchor[used]).tolist():
            nodes.setdefault(stream.nodes[a], len(nodes))
        at = np.zeros((len(used), 3))
        for a in np.unique(anchor[used]).tolist():
            of = anchor[used] == a
            at[of] = poses_at(recording.sensors[stream.nodes[a]], time[used][of])[0]
        node = np.array([nodes[stream.nodes[a]] for a in anchor[used].tolist()], int)
        new = np.full(len(stream), -1)
        new[used] = np.arange(len(used)) + count
        event = new[np.repeat(np.arange(len(stream)), np.diff(stream.row_offset))]
        rows = event >= 0
        where = places(known, which[used], time[used])
        parts.append((node, where, at, stream.rows["distance"][rows], event[rows]))
        count += len(used)
    columns = (np.concatenate(column) for column in zip(*parts, strict=True))
    node, device_at, anchor_at, z, event = columns
    return Data(node, device_at, anchor_at, z, event, tuple(nodes), flat)


def _carried(recording: Recording, device: str, known: Sequence[Track], number: int) -> int:
    """The track of what carries a device.

    Raises
    ------
    InputError : it is not known which that is
    """
    mine = [k for k, track in enumerate(known) if track.recording == number]
    label = recording.sensors[device].object
    chosen = [k for k in mine if label < 0 or known[k].label == label]
    if len(chosen) != 1:
        raise InputError(f"{recording.meta.name}: which true object carries {device!r}?")
    return chosen[0]


def _distance(data: Data, height: float) -> tuple[Array, Array]:
    """Distances (K,) [m] of the events, and their slopes over the device's height."""
    d = data.device - data.anchor
    if data.flat:
        d = d.copy()
        d[:, 2] = height - data.anchor[:, 2]
    r = np.maximum(np.linalg.norm(d, axis=1), 1e-6)
    return r, d[:, 2] / r if data.flat else 0 * r


def started(data: Data, height: float, params: UwbParams) -> Model:
    """A model to begin with: wide, its offsets the medians."""
    r, _ = _distance(data, height)
    e = data.z - r[data.event]
    node = data.node[data.event]
    close = np.abs(e) < params.reach_uwb
    offset = np.array([
        np.median(e[close & (node == j)]) if (close & (node == j)).any() else 0.0
        for j in range(len(data.nodes))
    ])  # fmt: skip
    return Model(0.0, height, offset, np.log(params.reach_uwb / 6), 0.7, 0.1 / params.reach_uwb)


def weights(data: Data, model: Model, reach: float) -> tuple[Array, Array, Array]:
    """How surely (N,) ranges are direct, their errors [m], and which are in reach."""
    r, _ = _distance(data, model.height)
    at = (1 + model.scale) * r + model.offset[data.node]
    e = data.z - at[data.event]
    near = np.abs(e) < reach
    density = model.mu * np.exp(-((e / np.exp(model.log_std)) ** 2) / 2 - model.log_std)
    density /= np.sqrt(2 * np.pi)
    return np.where(near, density / (density + model.rho), 0.0), e, near


def _slopes(data: Data, model: Model) -> Array:
    """Change (K, 2 + J) of what ranges would be with scale, height and offsets."""
    r, slope = _distance(data, model.height)
    J = np.zeros((len(r), 2 + len(model.offset)))
    J[:, 0], J[:, 1] = r, (1 + model.scale) * slope
    J[np.arange(len(r)), 2 + data.node] = 1
    return J


def fit(data: Data, model: Model, reach: float) -> Model:
    """The model of greatest likelihood, from one that is near."""
    K, J = len(data.node), len(model.offset)
    for _ in range(ROUNDS):
        w, e, near = weights(data, model, reach)
        total = float(w.sum())
        if total < 1:
            break
        A = _slopes(data, model)[data.event]
        change = np.linalg.lstsq(np.sqrt(w)[:, None] * A, np.sqrt(w) * e, rcond=1e-8)[0]
        change[1] = np.clip(change[1], -0.3, 0.3)
        rest = e - A @ change
        new = Model(
            model.scale + float(change[0]),
            model.height + float(change[1]),
            model.offset + change[2:],
            float(np.log(max(w @ rest**2 / total, 1e-12)) / 2),
            total / K,
            max(float(near.sum() - total) / (2 * reach * K), 1e-9),
        )
        moved = np.abs(new.vector - model.vector) / (1 + np.abs(model.vector))
        model = new
        if moved.max() < CLOSE:
            break
    assert len(model.offset) == J
    return model


def scores(data: Data, model: Model, clutter: float, reach: float) -> Array:
    """Equations (K, q) that sum up to zero at the right numbers."""
    K = len(data.node)
    w, e, near = weights(data, model, reach)
    V = np.exp(-2 * model.log_std)
    along = np.bincount(data.event, w * e * V, K)
    own = np.bincount(data.event, w, K)
    return np.column_stack(
        (
            along[:, None] * _slopes(data, model),
            np.bincount(data.event, w * e**2 * V, K) - own,
            own - model.mu,
            np.bincount(data.event, near - w, K) - 2 * reach * model.rho,
            np.bincount(data.event, minlength=K) - own - clutter,
        )
    )


def quantities(data: Data, model: Model, reach: float) -> list[Quantity]:
    """The numbers that are told, with standard errors; infinite ones where data tell nothing."""
    w, _, _ = weights(data, model, reach)
    clutter = (len(data.z) - w.sum()) / len(data.node)
    theta = np.append(model.vector, clutter)
    std = np.exp(model.log_std)
    J = len(model.offset)
    step = np.concatenate(
        ([1e-3, 0.01], np.full(J, 0.02 * std), [0.02], [0.02], [0.02 * model.rho], [0.1])
    )

    def equations(x: Array) -> Array:
        return scores(data, Model.of(x[:-1]), float(x[-1]), reach)

    cov = sandwich(equations, theta, step, blocks(len(data.node)))
    se = np.sqrt(np.maximum(np.diag(cov), 0.0))
    se = np.where(se > 0, se, np.inf)
    found = [Quantity("sigma", "m", float(std), float(std * se[2 + J]))]
    found += [
        Quantity(f"offset {node}", "m", theta[2 + j], se[2 + j])
        for j, node in enumerate(data.nodes)
    ]
    found.append(Quantity("scale", "1", theta[0], se[0]))
    if data.flat:
        found.append(Quantity("device_height", "m", theta[1], se[1]))
    found.append(Quantity("p_detect", "1", theta[3 + J], se[3 + J]))
    found.append(Quantity("mean_clutter", "1", theta[5 + J], se[5 + J]))
    return found


def _nis(data: Data, model: Model, reach: float) -> float:
    w, e, _ = weights(data, model, reach)
    return float(w @ (e / np.exp(model.log_std)) ** 2 / w.sum()) if w.sum() > 0 else np.nan


def residuals(data: Data, model: Model, reach: float) -> Residuals:
    """What is left, for a picture; ``over`` are the errors, ``before`` those without the model."""
    w, e, _ = weights(data, model, reach)
    kept = w > 0.5
    r, _ = _distance(data, model.height)
    of = data.event[kept]
    flat = np.linalg.norm((data.device - data.anchor)[:, :2], axis=1)
    d = (data.device - data.anchor)[of]
    none = np.full(kept.sum(), np.nan)
    azimuth = np.arctan2(d[:, 1], d[:, 0])
    before = data.z[kept] - (flat if data.flat else r)[of]
    share = np.zeros((0, 3))
    return Residuals(none, none, before, e[kept], r[of], azimuth, data.node[of], w[kept], share)

"""Every condition of figures 3 and 4 over one recording, and what each part of the chain costs.

E. Favarelli et al., "Multi-base station cooperative sensing with AI-aided tracking", section IV:
PHD and MBM filter with the gates 4 m, 6 m and adaptive, for one to six stations. All conditions
with the same stations share their soft maps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np

from ..estimators import mbm, phd
from ..estimators.maps import evidence
from ..estimators.maps.detector import Chain
from ..estimators.maps.kernels.fusion import Pixels
from ..estimators.maps.tbd import filter as tbd
from ..models.classifier import CLASSES
from ..models.parameters import as_dict, resolve, sensor_model
from ..models.random import generator
from ..models.records import Array, Estimates, Meta, Objects, Recording, Scan

FILTERS = {"phd": phd, "mbm": mbm}
GATES: Mapping[str, Mapping[str, Any]] = {
    "4": {"gate_pedestrian": 4.0, "gate_vehicle": 4.0},
    "6": {"gate_pedestrian": 6.0, "gate_vehicle": 6.0},
    "adaptive": {},
}
REPLACED = ("nothing", "detection", "clustering", "identification", "tracking")
"""Parts of the chain that the truth can stand in for."""
BRIGHT = 1e6
"""Power of what is seen where detection is replaced by the truth."""
_SIZES = {"pedestrian": (0.5, 0.5), "vehicle": (2.25, 0.9)}
"""Half the length and width [m] of what is bright where detection is replaced by the truth."""


@dataclass(frozen=True, slots=True)
class Condition:
    """A filter with a preset and parameters, a gate, and a number of stations."""

    filter: str
    preset: str
    gate: str
    stations: int
    changes: tuple[tuple[str, Any], ...] = ()

    @property
    def name(self) -> str:
        """What the condition is called in scores."""
        return f"{self.filter} {self.preset} {self.gate} {self.stations}"

    def params(self, recording: Recording) -> Any:
        """The parameters of the filter."""
        module = FILTERS[self.filter]
        preset = module.PRESETS[self.preset] if self.preset != "default" else {}
        layers = GATES[self.gate], {"stations": self.stations}, dict(self.changes)
        named_ = (("preset", preset), *((self.name, layer) for layer in layers))
        stated = sensor_model(recording, module.Params)
        return module.resolved(module.Params, recording, stated, named_)


Soft = Mapping[int, Array]
"""Soft maps (ny, nx) by time [ns]."""
Steps = list[Estimates]


def soft_maps(recording: Recording, params: Any) -> dict[int, Array]:
    """The soft maps of all times with the stations of ``params``."""
    chain = Chain.of(
        recording.setup(), replace(params, identify="none", gate_vehicle=params.gate_pedestrian)
    )
    scans = (s for s in chain.used(recording.scans()) if s.stream in chain.streams)
    return {t: chain.fuse(t, list(some)) for t, some in groupby(scans, lambda s: s.time_ns)}


def estimate(
    recording: Recording,
    condition: Condition,
    soft: Soft,
    change: Callable[[Chain], Chain] = lambda chain: chain,
) -> Steps:
    """Estimates step by step under a condition, from shared soft maps, with parts changed."""
    module, params = FILTERS[condition.filter], condition.params(recording)
    context = module.context(recording.setup(), params)
    chain = change(replace(context.source, fuse=lambda t, scans: soft[t]))
    steps = list(module.run(replace(context, source=chain), recording.scans()))
    return _named(recording, condition, steps)


def before_detection(recording: Recording, stations: int, smooth: str = "none") -> Steps:
    """Estimates step by step by track-before-detect, with the first so many stations.

    Called ``tbd 3``, smoothed ``tbd smooth 3``.
    """
    setup, given = recording.setup(), {"stations": stations, "smooth": smooth}
    params = resolve(tbd.Params, *sensor_model(recording, tbd.Params), ("here", given))
    rng = generator(1, "estimate:tbd", recording.meta.name)
    name = f"tbd {stations}" if smooth == "none" else f"tbd smooth {stations}"
    provenance = {"estimator": name, "parameters": as_dict(params)}
    meta = Meta(recording.meta.name, provenance=provenance)
    return [replace(s, meta=meta) for s in tbd.estimate(setup, recording.scans(), params, rng)]


def alone(recording: Recording, condition: Condition) -> Steps:
    """Estimates step by step under a condition that shares its maps with no other."""
    module, params = FILTERS[condition.filter], condition.params(recording)
    context = module.context(recording.setup(), params)
    return _named(recording, condition, module.run(context, recording.scans()))


def without(recording: Recording, condition: Condition, soft: Soft, part: str) -> Steps:
    """Estimates step by step with one of the parts :data:`REPLACED` replaced by the truth.

    detection : what is clustered is bright in the outlines of the objects alone; the network sees
    the maps. clustering : the objects' true places and classes stand for the predictions, with
    the gates of their classes, and nothing else makes detections; the filter tracks them.
    identification : the class of the nearest object. tracking : the objects' true places stand for
    the predictions, with the gates and rooms of what the network calls them; the estimates are
    the detections.
    """
    if part == "tracking":
        return _untracked(recording, condition, soft)
    objects = {
        "nothing": lambda chain: chain,
        "detection": lambda chain: _outlined(recording, condition, chain),
        "clustering": lambda chain: replace(chain, cluster=_clustered(recording, chain)),
        "identification": lambda chain: replace(chain, identify=_identified(recording)),
    }
    return estimate(recording, condition, soft, objects[part])


def true_at(recording: Recording) -> Callable[[int], tuple[Array, Array, Array]]:
    """Positions (n, 2), classes (n,) and headings (n,) of the objects at a time [ns]."""
    assert recording.truth is not None
    o = recording.truth.objects
    assert o.class_index is not None and o.rotation is not None
    index, kind, turn = {t: k for k, t in enumerate(o.time_ns.tolist())}, o.class_index, o.rotation

    def at(time_ns: int) -> tuple[Array, Array, Array]:
        k = index[time_ns]
        rows = slice(o.row_offset[k], o.row_offset[k + 1])
        return o.columns("x", "y")[rows], kind[rows], turn[rows]

    return at


def _outlines(recording: Recording, condition: Condition) -> Callable[..., Array]:
    params, at = condition.params(recording), true_at(recording)
    pixels = Pixels.of(params.map_region, params.map_cell)
    x, y = pixels.centres().T.reshape(2, pixels.ny, pixels.nx)

    def fuse(time_ns: int, scans: Sequence[Scan]) -> Array:
        soft = np.zeros(x.shape, np.float32)
        for (px, py), kind, turn in zip(*at(time_ns), strict=True):
            c, s = np.cos(turn), np.sin(turn)
            along, across = c * (x - px) + s * (y - py), c * (y - py) - s * (x - px)
            a, b = _SIZES[CLASSES[kind]]
            soft[(np.abs(along) <= a) & (np.abs(across) <= b)] = BRIGHT
        return soft

    return fuse


def _outlined(recording: Recording, condition: Condition, chain: Chain) -> Chain:
    """The chain whose pairs and clusters are those of outlines."""
    bright, cluster, split = _outlines(recording, condition), chain.cluster, chain.split
    return replace(
        chain,
        split=lambda t, soft, *rest: split(t, bright(t, ()), *rest),
        cluster=lambda t, soft, *rest: cluster(t, bright(t, ()), *rest),
    )


def _clustered(recording: Recording, chain: Chain) -> Callable[..., tuple[Array, Array]]:
    at, gates = true_at(recording), np.array(chain.params.gates)
    never = replace(chain.params, dbscan_points=10**9)
    cluster = Chain.of(recording.setup(), never).cluster

    def true_clusters(
        time_ns: int, soft: Array, where: Array, gate: Array, room: Array
    ) -> tuple[Array, Array]:
        p, kind, _ = at(time_ns)
        return cluster(time_ns, soft, p, gates[kind], np.zeros(len(p)))

    return true_clusters


def _identified(recording: Recording) -> Callable[[int, Array, Array], Array]:
    at = true_at(recording)

    def identify(time_ns: int, soft: Array, where: Array) -> Array:
        p, kind, _ = at(time_ns)
        nearest = ((where[:, None] - p) ** 2).sum(2).argmin(1)
        told: Array = np.eye(len(CLASSES))[kind[nearest]]
        return told

    return identify


def _untracked(recording: Recording, condition: Condition, soft: Soft) -> Steps:
    params, at = condition.params(recording), true_at(recording)
    chain = Chain.of(recording.setup(), params)
    assert chain.identify is not None
    steps = []
    for k, (t, map_) in enumerate(soft.items()):
        p, _, _ = at(t)
        kind = chain.identify(t, map_, p).argmax(1)
        gate, room = np.array(params.gates)[kind], np.array(params.rooms)[kind]
        z, _ = chain.cluster(t, map_, p, gate, room)
        n = len(z)
        label = np.arange(n) + 1000 * k
        told = evidence.read(chain.identify(t, map_, z))
        state = np.hstack((z, np.zeros((n, 2))))
        names, units = ("x", "y", "vx", "vy"), ("m", "m", "m s-1", "m s-1")
        objects = Objects(np.array([t]), np.array([0, n]), label, names, units, state)
        classes = dict(zip(label.tolist(), told, strict=True))
        steps.append(Estimates(recording.meta, chain.named(objects, classes), {}))
    return _named(recording, condition, steps)


def _named(recording: Recording, condition: Condition, steps: Iterable[Estimates]) -> Steps:
    """The steps under the name of the recording and of the condition."""
    parameters = as_dict(condition.params(recording))
    provenance = {"estimator": condition.name, "parameters": parameters}
    meta = Meta(recording.meta.name, provenance=provenance)
    return [replace(step, meta=meta) for step in steps]


def conditions(preset: str, stations: Iterable[int] = range(1, 7)) -> Iterator[Condition]:
    """The 36 conditions of figure 3 with a preset, those of the same stations together."""
    for n in stations:
        for filter_ in FILTERS:
            for gate in GATES:
                yield Condition(filter_, preset, gate, n)

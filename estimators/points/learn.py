"""What sensors are like, learnt from a recording without its truth, by the evidence of a filter.

The evidence of a scan is the sum over its detections z of log(clutter(z) + first(z) + sum r p l(z))
less the number of detections that clutter and targets, known or not, are expected to give: the
predictive density of a Poisson process of that intensity, with targets as :mod:`.pmb` follows them.
It is climbed coordinate by coordinate. Latencies and offsets are those against the first stream by
name, which nothing but a truth tells from those of the whole.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import groupby
from math import exp, log
from typing import Any, TypeVar

from ...models.errors import EstimatorError
from ...models.records import Recording, Scan
from . import pmb_filter
from .context import Context, FilterParams
from .late import true_times
from .model.sensing import STREAMS
from .pmb import step
from .streams import per_stream

GAIN = 3.0
"""Nats that a parameter of a stream must gain to be another than what is told."""
ROUNDS = 2
"""Times that all coordinates are climbed."""
FINEST = 1 / 16
"""Last step along a coordinate, as a share of the first."""
OWN = (
    "latency",
    "registration",
    "p_detect",
    "clutter_rate",
    "std_position",
    "std_range",
    "std_azimuth",
)
"""What a sensor model has of that."""
TARGETS = ""
"""The stream of which is what holds for targets."""
_log = logging.getLogger(__name__)
P = TypeVar("P", bound=FilterParams)


@dataclass(frozen=True, slots=True)
class Coordinate:
    """A number of what is assumed of a stream or of targets, climbed in steps of ``up`` of it."""

    stream: str
    name: str
    index: int | None = None
    first: float = 1.0
    up: Callable[[float], float] = float
    down: Callable[[float], float] = float

    def of(self, own: Mapping[str, Any]) -> float:
        """Where the sensor model ``own`` stands along it."""
        value = own[self.name]
        return self.up(value if self.index is None else value[self.index])

    def at(self, own: Mapping[str, Any], place: float) -> dict[str, Any]:
        """The model elsewhere along it."""
        value: Any = self.down(place)
        if self.index is not None:
            value = tuple(value if i == self.index else v for i, v in enumerate(own[self.name]))
        return {**own, self.name: value}


def coordinates(setup: Recording, params: FilterParams) -> list[Coordinate]:
    """All that is to be learnt of the streams of a recording."""
    names = sorted(name for name, s in setup.streams.items() if s.kind in STREAMS)
    found = []
    if "birth_rate" in params.learn and params.birth != "components":
        found.append(Coordinate(TARGETS, "birth_rate", None, 0.8, _log_of, exp))
    for name in names:
        polar, rows = setup.streams[name].kind == "range_bearing", setup.streams[name].rows
        own = per_stream(params, setup)[name]
        std = ("std_range", "std_azimuth") if polar else ("std_position", "std_position")
        wide = [getattr(own, s) or 1.0 for s in std]
        if name != names[0]:
            if "latency" in params.learn:
                found.append(Coordinate(name, "latency"))
            if "registration" in params.learn:
                found += [Coordinate(name, "registration", i, wide[i]) for i in (0, 1)]
        if "p_detect" in params.learn:
            found.append(Coordinate(name, "p_detect", None, 0.8, _logit, _share))
        if "clutter_rate" in params.learn:
            found.append(Coordinate(name, "clutter_rate", None, 0.8, _log_of, exp))
        if "accuracy" in params.learn and not rows.keys() & {*std, "cov_xx"}:
            found += [Coordinate(name, s, None, 0.4, _log_of, exp) for s in dict.fromkeys(std)]
    if len(names) == 1 and {"latency", "registration"} & set(params.learn):
        _log.warning(
            "%s: latency and registration are not learnt: against which other sensor?",
            setup.meta.name,
        )
    return found


@dataclass(slots=True, eq=False)
class Climb:
    """A search: the best model of each stream, and its evidence."""

    setup: Recording
    scans: Sequence[Scan]
    params: FilterParams
    own: dict[str, dict[str, Any]]
    best: float
    tried: dict[str, float] = field(default_factory=dict)

    @staticmethod
    def of(setup: Recording, scans: Sequence[Scan], params: FilterParams) -> Climb:
        """From what is told."""
        streams = [name for name, s in setup.streams.items() if s.kind in STREAMS]
        each = per_stream(params, setup)
        own = {s: {name: getattr(each[s], name) for name in OWN} for s in streams}
        own[TARGETS] = {"birth_rate": params.birth_rate}
        found = Climb(setup, scans, params, own, 0.0)
        found.best = found.evidence(own)
        return found

    def told(self, own: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
        """``sensors`` as parameters have it; all are as late as it takes for none to be early."""
        own = {s: model for s, model in own.items() if s != TARGETS}
        early = min(0.0, *(model["latency"] for model in own.values()))
        late = {s: {**model, "latency": model["latency"] - early} for s, model in own.items()}
        before = self.params.sensors
        return {**before, **{s: {**before.get(s, {}), **m} for s, m in late.items()}}

    def evidence(self, own: Mapping[str, Mapping[str, Any]]) -> float:
        """Evidence [nats] of the scans; minus infinity where a filter fails."""
        key = repr(own)
        if key not in self.tried:
            shared = {f.name: getattr(self.params, f.name) for f in fields(FilterParams)}
            changed = {"sensors": self.told(own), **own[TARGETS], "learn": ()}
            params = pmb_filter.Params(**{**shared, **changed})
            try:
                self.tried[key] = evidence(self.setup, self.scans, params)
            except EstimatorError:
                self.tried[key] = -float("inf")
        return self.tried[key]

    def along(self, x: Coordinate) -> None:
        """Climb along a coordinate: steps that double while they gain, and are halved then."""
        told, before = self.own, self.best
        here, h = x.of(self.own[x.stream]), x.first
        while h >= FINEST * x.first:
            moved = any(self._step(x, here, way * h) for way in (1, -1))
            here = x.of(self.own[x.stream])
            h = h if moved else h / 2
        if self.best < before + GAIN:
            self.own, self.best = told, before

    def _step(self, x: Coordinate, here: float, h: float) -> bool:
        other = {**self.own, x.stream: x.at(self.own[x.stream], here + h)}
        value = self.evidence(other)
        if value <= self.best:
            return False
        self.own, self.best = other, value
        return True


def evidence(setup: Recording, scans: Iterable[Scan], params: pmb_filter.Params) -> float:
    """Evidence [nats] of ``scans``."""
    context = Context.of(setup, params, quiet=True)
    state, total = pmb_filter.init(context.params), 0.0
    ordered = true_times(scans, context.sensing)
    for _, together in groupby(ordered, key=lambda scan: scan.time_ns):
        state, _ = step(state, list(together), context)
        total += state.evidence
    return total


def learn(setup: Recording, scans: Sequence[Scan], params: P) -> tuple[P, dict[str, Any]]:
    """Parameters that fit the ``scans`` best, and what was learnt with its gain in nats.

    Raises
    ------
    InputError : the noise of detections or the place of clutter is not known
    """
    climb = Climb.of(setup, scans, params)
    told, start = climb.own, climb.best
    for _ in range(ROUNDS):
        for x in coordinates(setup, params):
            climb.along(x)
    sensors, targets = climb.told(climb.own), climb.own[TARGETS]
    found = {
        f"{stream}.{name}".lstrip("."): value
        for stream in told
        for name, value in (sensors | {TARGETS: targets})[stream].items()
        if name in told[stream] and value != told[stream][name]
    }
    gained = {"evidence_gained": climb.best - start}
    params = replace(params, sensors=sensors, **targets)
    return params, {**found, **gained} if found else {}


def head(scans: Iterator[Scan], span: float) -> list[Scan]:
    """The scans of the first ``span`` [s], and one more."""
    found: list[Scan] = []
    for scan in scans:
        found.append(scan)
        if scan.time_ns - found[0].time_ns > span * 1e9:
            break
    return found


def _log_of(value: float) -> float:
    return log(max(value, 1e-3))


def _logit(p: float) -> float:
    p = min(max(p, 1e-3), 1 - 1e-3)
    return log(p / (1 - p))


def _share(x: float) -> float:
    return 1 / (1 + exp(-x))

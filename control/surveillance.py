"""A radar that chooses its view by what the PHD filter says about the regions of interest.

M. Andrecki et al., "Sensor management with regional statistics for the PHD filter": before each
scan a policy chooses one of the views from the mean and variance of the number of targets in the
region of each, as the filter has them after the scan before (section III-C).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..estimators.points import phd, phd_filter
from ..estimators.points.context import Context
from ..estimators.points.modes import initial
from ..estimators.presets import preset
from ..models.parameters import as_dict, parameter, require, resolve
from ..models.records import Array, Meta, Recording, Stream, Truth
from ..models.registry import load
from ..simulate import surveillance as scene

SUMMARY = "a radar that looks at one of three regions at a time, chosen by a policy"
SENSOR_MODEL = ("p_detect", "clutter_rate", "std_range", "std_azimuth")
"""Parameters that the recording states about its radar."""


@dataclass(frozen=True, slots=True)
class Params(scene.Params):
    """The scene, and who looks where."""

    policy: str = parameter("variance", "1", "entry point of the group echoset.policies")
    regions: tuple[tuple[float, ...], ...] = parameter(
        (
            (100.0, 300.0, 100.0, 300.0),
            (400.0, 600.0, 100.0, 300.0),
            (700.0, 900.0, 100.0, 300.0),
        ),
        "m",
        "x_min, x_max, y_min, y_max of B1, B2, ...: the region of each view",
    )
    birth_rate: float = parameter(1.0, "1", "targets that the filter expects to enter per step")
    filter: Any = parameter({}, "1", "other parameters of the filter, over preset surveillance")

    def __post_init__(self) -> None:
        scene.Params.__post_init__(self)
        same = len(self.regions) == len(self.views)
        require(same, "regions", "as many as there are views", len(self.regions))
        require(isinstance(self.filter, Mapping), "filter", "a mapping", self.filter)

    def names(self) -> list[str]:
        """Names of the regions: B1, B2, ..."""
        return [f"B{i + 1}" for i in range(len(self.regions))]

    def filter_params(self) -> phd_filter.Params:
        """The filter in the loop."""
        said = {
            **{key: getattr(self, key) for key in SENSOR_MODEL},
            "birth_rate": self.birth_rate,
            "regions": {n: list(b) for n, b in zip(self.names(), self.regions, strict=True)},
        }
        layers = (
            ("preset", preset("phd", "surveillance")),
            ("scenario", said),
            ("filter", self.filter),
        )
        return resolve(phd_filter.Params, *layers)


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """What a step of the loop chose, saw and learnt: mean and variance (B,) of the regions."""

    view: int
    rows: dict[str, Array]
    mean: Array
    variance: Array


def simulate(params: Params, rng: np.random.Generator, name: str) -> Recording:
    """The recording of a closed loop, with the views that were chosen, called ``name``."""
    world = scene.world(params, rng)
    steps = list(loop(params, world))
    columns = {key: np.concatenate([s.rows[key] for s in steps]) for key in steps[0].rows}
    offset = np.cumsum([0, *(len(s.rows["range"]) for s in steps)])
    stream = _stream(params, world.objects.time_ns, offset, [s.view for s in steps], columns)
    sensors = {"radar": params.sensor()}
    return Recording(Meta(name), sensors, {"radar": stream}, Truth(world.objects))


def loop(params: Params, world: scene.World) -> Iterator[Step]:
    """The steps of the closed loop in a world whose random numbers are drawn."""
    empty = _stream(params, np.zeros(0, np.int64), np.zeros(1, np.int64), [], {})
    setup = Recording(Meta("loop"), {"radar": params.sensor()}, {"radar": empty})
    context = Context.of(setup, params.filter_params())
    state = phd_filter.init(context.params.width, initial(context.params))
    choose = load("echoset.policies", params.policy).choose
    mean = variance = np.zeros(len(params.regions))
    for k, time_ns in enumerate(world.objects.time_ns.tolist()):
        view = choose(k, mean, variance)
        rows = scene.detections(params, world, k, view)
        offset = np.array([0, len(rows["range"])])
        seen = _stream(params, np.array([time_ns]), offset, [view], rows)
        state, (estimates, _) = phd.step(state, seen.scans("radar"), context)
        mean, variance = (
            np.array([estimates.steps[f"region_{what}_{name}"][0] for name in params.names()])
            for what in ("mean", "variance")
        )
        yield Step(view, rows, mean, variance)


def _stream(
    params: Params, time_ns: Array, offset: Array, views: list[int], rows: dict[str, Array]
) -> Stream:
    """Scans with the bounds of their views."""
    chosen = [params.view(v) for v in views]
    bounds = ("azimuth_min", "azimuth_max", "range_min", "range_max")
    scan = {f"view_{b}": np.array([getattr(v, b) for v in chosen], float) for b in bounds}
    model = {key: value for key, value in as_dict(params).items() if key in SENSOR_MODEL}
    return Stream("range_bearing", ("radar",), model, time_ns, offset, scan, rows)

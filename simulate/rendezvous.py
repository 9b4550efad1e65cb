"""Objects that meet at once in the middle of the recording, seldom detected, among much clutter.

After K. Granstrom, L. Svensson, Y. Xia, J. Williams and A. F. Garcia-Fernandez, "Poisson
multi-Bernoulli mixture trackers: continuity through random finite sets of trajectories", FUSION
2018, and the work on batches of trajectories since: all are drawn around one point for the middle
step, with one velocity, and walk from there both ways.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..models.parameters import parameter, require
from ..models.records import Array, Recording
from . import points
from .targets import from_middle, objects

SUMMARY = "objects that meet at once half-way, seldom detected, in much clutter; positions"


@dataclass(frozen=True, slots=True)
class Params(points.Positions):
    """Scans and objects."""

    steps: int = parameter(81, "1", "number of scans", within="[1, inf)")
    p_detect: float = parameter(0.7, "1", "probability that an object is detected", within="[0, 1]")
    clutter_rate: float = parameter(30.0, "1", "expected false alarms per scan", within="[0, inf)")
    clutter_region: tuple[float, float, float, float] = parameter(
        (-200.0, 200.0, -200.0, 200.0), "m", "x_min, x_max, y_min, y_max of the false alarms"
    )
    std_position: float = parameter(1.0, "m", "standard deviation of x and of y", within="[0, inf)")
    first: tuple[int, ...] = parameter(
        (1, 1, 11, 11, 21, 21), "1", "first step of each object", within="[1, inf)"
    )
    last: tuple[int, ...] = parameter(
        (61, 61, 71, 71, 81, 81), "1", "last step of each object", within="[1, inf)"
    )
    spread: float = parameter(
        2.0, "m", "deviation of x and of y about the origin in the middle step", within="[0, inf)"
    )
    velocity: tuple[float, float] = parameter((2.0, 2.0), "m s-1", "of all in the middle step")
    noise_density: float = parameter(
        0.09, "m2 s-3", "power spectral density of the objects' acceleration", within="[0, inf)"
    )
    birth_weight: float = parameter(
        0.01,
        "1",
        "weight per scan of each place of birth that the recording states, at the rounded first "
        "states; 0: it states none",
        within="[0, inf)",
    )
    birth_std: float = parameter(
        2.0, "m, m s-1", "standard deviation of every entry of a birth there", within="(0, inf)"
    )

    def __post_init__(self) -> None:
        points.Positions.__post_init__(self)
        same = len(self.first) == len(self.last)
        require(same, "last", "one for each of first", self.last)
        for first, last in zip(self.first, self.last, strict=True):
            require(first <= last, "last", "first or later", self.last)


def simulate(params: Params, rng: np.random.Generator, name: str) -> Recording:
    """A recording of the scene with its truth, called ``name``."""
    n, count = params.steps, len(params.first)
    middle = np.tile((0.0, 0.0, *params.velocity), (count, 1))
    middle[:, :2] += params.spread * rng.normal(size=(count, 2))
    state = from_middle(middle, n, params.dt, params.noise_density, rng)
    step = np.arange(1, n + 1)[:, None]
    alive = (np.array(params.first, int) <= step) & (step <= np.array(params.last, int))
    found = points.positions(params, objects(params.time_ns, alive, state), rng, name)
    if not params.birth_weight or not count:
        return found
    radar = found.streams["radar"]
    births = {"birth": "components", "birth_components": _births(params, state).tolist()}
    return replace(found, streams={"radar": replace(radar, model={**radar.model, **births})})


def _births(params: Params, state: Array) -> Array:
    """Places of birth (N, 9): weight, the rounded first state of each object, deviations."""
    row = np.array(params.first) - 1
    start = np.rint(state[np.minimum(row, params.steps - 1), np.arange(len(row))])
    ends = np.full((len(row), 1), params.birth_weight), np.full((len(row), 4), params.birth_std)
    return np.hstack((ends[0], start, ends[1]))

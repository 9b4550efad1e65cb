"""Where a tag was, from all its ranges at once: the honest baseline, and for ranges alone the tool.

A filter knows the past, this knows the future too. The trajectory of least cost (:mod:`.problem`)
is found from robust fixes of a few ranges each; the covariances are blocks of the inverse of its
Hessian. Only direct ranges count: false ones are left to the tails of the noise.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from ....models.errors import EstimatorError, InputError
from ....models.records import Array, Estimates, Recording, Scan
from ..cloud.start import MARGIN
from ..links import Network, network
from ..odometry import odometry_of
from ..state import Height, first_height
from .body import offsets
from .choose import Explanation, choose, explanations
from .fixes import fixes
from .gather import Data, gather
from .params import Params
from .show import shown
from .solution import Solution, carried, problem_of, solution, starts

SUMMARY = "a device or tag from all its ranges at once: robust least squares over the recording"
STREAMS = ("uwb", "odometry")
PRESETS: Mapping[str, Mapping[str, Any]] = {}
__all__ = ["PRESETS", "STREAMS", "SUMMARY", "Params", "estimate"]
LEAST = 0.01
"""An explanation less probable than this does not count."""
LEARNT = 1000
"""Times from which is learnt at most."""
_log = logging.getLogger(__name__)


def estimate(
    setup: Recording, scans: Iterable[Scan], params: Params, rng: np.random.Generator
) -> Iterator[Estimates]:
    """Yield the estimate of each time at which the network has a link event.

    What is assumed or learnt before stands in the provenance of the first.

    Raises
    ------
    InputError : there is no direct range
    EstimatorError : no trajectory of least cost is found
    """
    body = offsets(params.tags)
    nets = [(_network(setup, tag, params), place) for tag, place in body.items()]
    nets = nets or [(_network(setup, params.device, params), np.zeros(2))]
    net = nets[0][0]
    data = gather(nets, scans, odometry_of(setup, params.device), params)
    if not len(data.time_ns):
        return
    if not len(data.z):
        raise InputError(f"{net.name}: no active link has a range: nothing to estimate from")
    found: dict[str, Any] = {}
    if params.max_range is None:
        found["max_range"] = _reach(data)
        params = replace(params, max_range=found["max_range"])
    models = [Explanation("", params, 0.0)]
    if params.learn:
        head = data.head(params.learn_span, LEARNT)
        may = params.device_height is None and not net.has_heights
        best, learnt = choose(params, _evidence(net, head), may)
        models = explanations(best, params, may)
        found |= learnt
    solutions: list[Solution] = []
    for model in models:
        solutions.append(solve(net, data, model.params, solutions[-1] if solutions else None))
    weights = np.ones(1)
    if len(models) > 1:
        weights = _weights(solutions)
        told = zip(models, weights.tolist(), strict=True)
        found["explained_by"] = {model.name: round(w, 3) for model, w in told if w >= LEAST}
    if found:
        _log.info("%s: %s", net.name, ", ".join(f"{key} {value}" for key, value in found.items()))
    kept = weights >= LEAST
    yield from shown(
        [one for one, is_kept in zip(solutions, kept, strict=True) if is_kept],
        weights[kept] / weights[kept].sum(),
        found,
    )


def _weights(solutions: list[Solution]) -> Array:
    """Probabilities (k,) of explanations by their evidence, which has its Occam factor already."""
    worth = np.array([one.problem.evidence(one.x, one.cost) for one in solutions])
    w = np.exp(worth - worth.max())
    return np.asarray(w / w.sum())


def _network(setup: Recording, device: str | None, params: Params) -> Network:
    return network(
        setup,
        device,
        params.rms_bandwidth,
        params.amplitude_threshold,
        params.sigma,
        params.sigma_factor,
        params.range_bias,
    )


def solve(net: Network, data: Data, params: Params, near: Solution | None = None) -> Solution:
    """The trajectory of least cost; ``near`` is one for other parameters.

    Raises
    ------
    EstimatorError : there is none, or it is not finite
    """
    data = replace(data, std=data.std * params.sigma_factor / net.sigma_factor)
    corners = np.unique(data.place[:, :2], axis=0)
    centre = (corners.min(0) + corners.max(0)) / 2
    reach = float(np.linalg.norm(corners.max(0) - corners.min(0)) / 2) + _reach(data)
    height = first_height(net, params)
    problem = problem_of(data, params, height, centre, reach)
    if near is not None:
        return Solution(problem, *problem.minimise(carried(near, problem)))
    loose = params.range_bias_std + params.range_scale_std * float(np.median(data.z))
    path = fixes(data, _middle(height), loose, params.speed_std, centre, reach)
    best = solution(problem, starts(problem, path))
    if not (np.isfinite(best.cost) and np.isfinite(best.x).all()):
        raise EstimatorError(f"{net.name}: the estimate is not finite")
    return best


def _reach(data: Data) -> float:
    """The largest range and a margin [m]; with differences alone, how far apart anchors are."""
    ranges = data.z[data.reference < 0]
    corners = np.unique(data.place, axis=0)
    apart = float(np.linalg.norm(corners.max(0) - corners.min(0)))
    return round(MARGIN * max(float(ranges.max()) if len(ranges) else apart, 1e-3), 2)


def _middle(height: Height) -> float:
    return height.mean if np.isfinite(height.std) else (height.low + height.high) / 2


def _evidence(net: Network, data: Data) -> Callable[[Params], float]:
    """The evidence [nats] of parameters; trajectories are found from those for others."""
    near: list[Solution] = []

    def evidence(params: Params) -> float:
        try:
            best = solve(net, data, params, near[0] if near else None)
            near[:] = [best]
            return best.problem.evidence(best.x, best.cost)
        except (EstimatorError, np.linalg.LinAlgError):
            return -np.inf

    return evidence

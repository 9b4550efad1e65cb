"""Parameters fitted to the recording by the filter's own evidence, without any truth.

The evidence of a recording is the sum of the log predictive densities of its steps (the log mean
weights of the particles, less the mean numbers of ranges, so that rates may differ). It is climbed
coordinate by coordinate in logarithmic steps, with the same random numbers each time and few
particles. What explains that ranges are too long, an offset, a scale or a height of the anchors, is
a choice between models: the one that is told stays unless another gains several nats, since
parameters that trade against each other fit a little better and are much worse.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...models.errors import EstimatorError
from .filter import track
from .links import Links, Network
from .params import LEARNABLE, Params
from .spacing import LONGEST, noise_time, residuals, spaced
from .state import Event, Step, Target, belief

PARTICLES = 1000
"""Particles while learning."""
MOST = 3000
"""Active links that are learnt from; of more, the events of so many are drawn."""
GAIN = 5.0
"""Nats that a change must gain; with these particles they are known to two or three."""
HOPELESS = 50.0
"""Nats behind the best so far at which a trial is given up."""
SURE = 20.0
"""Nats by which an offset or a scale must be better for the other to be left out."""
FINER = (1.4, 1.15)
"""Factors of the noise in the rounds of the search."""
SCALE_STD, HEIGHT_STD, BIAS_STD = 0.05, 1.5, 0.3
"""Priors [1, m, m] of a scale, a height and an offset."""
REST_STD = 0.03
"""Prior [m] of an offset beside a scale or a height, which explain the same."""
COARSE = (0.3, 3.0, 10.0)
"""Factors of all noise that are tried first."""
SLOWER = (0.5, 0.2, 0.08, 0.04)
"""Factors of the walks of offset and extent that are tried."""
FEWER = (0.1, 0.2, 0.5, 2.0)
"""Factors of the number of scattered ranges that are tried."""
LATE = ((0.2, 1.5, 1.0), (0.2, 1.5, 0.7), (0.5, 1.5, 0.7), (0.2, 4.0, 1.0))
"""Shares of late ranges that are tried, their detours in units of the noise, and its factors."""
NARROW = 0.6
"""Factor of an anchor's own part of the offset with which learning begins, at rest."""
SPREADS, WALKS = (1.0, 3.0), (0.01, 0.02, 0.05)
"""Factors of that part, and its walks [m s-1/2], that are tried."""
IMPERFECT = 3.0
"""Intervals of a link's ranges for which residuals are alike by an imperfect fit alone."""
FARTHEST = 3
"""Steps that a walk may be climbed away from what is told."""
_log = logging.getLogger(__name__)


@dataclass(slots=True, eq=False)
class _Search:
    """The best parameters so far, and evidences by what has been tried.

    Ranges of a link come every ``interval`` [s] in the recording, of which ``events`` are a part.
    The gain [nats] counts from ``at_first``.
    """

    net: Network
    events: Sequence[Event]
    target: Target
    told: Params
    seed: int
    best: Params
    interval: float
    at_first: float = 0.0
    tried: dict[Params, float] = field(default_factory=dict)
    curves: dict[Params, list[float]] = field(default_factory=dict)

    def evidence(self, params: Params) -> float:
        """Log-likelihood [nats] of all events.

        It is minus infinity where the filter diverges, or falls far behind the best so far on the
        way, so that what is hopeless costs little.
        """
        if params not in self.tried:
            self.tried[params], self.curves[params] = self._run(params)
        return self.tried[params]

    @property
    def gain(self) -> float:
        """What the best parameters have gained [nats]."""
        return self.evidence(self.best) - self.at_first

    def _run(self, params: Params) -> tuple[float, list[float]]:
        """The evidence, and its sums up to each event or up to where it was given up."""
        ahead, curve, total = self.curves.get(self.best, []), [], 0.0
        try:
            for k, step in enumerate(self.steps(params)):
                total += step.evidence
                curve.append(total)
                if k < len(ahead) and total < ahead[k] - HOPELESS:
                    return -np.inf, curve
        except EstimatorError:
            return -np.inf, curve
        return total, curve

    def steps(self, params: Params) -> Iterator[Step]:
        """The filter's steps with few particles and always the same random numbers."""
        rng = np.random.default_rng(self.seed)
        few = replace(params, particles=min(PARTICLES, params.particles))
        factor = few.sigma_factor / self.net.sigma_factor
        events = spaced((with_noise(event, factor) for event in self.events), few.noise_time)
        return track(events, self.target, few, belief(self.net, few), rng, self.net.name)

    def offer(self, **changes: Any) -> bool:
        """Take ``changes`` if they gain enough."""
        other = _set(self.best, changes)
        gain = self.evidence(other) - self.evidence(self.best)
        _log.debug("%s: %s: %+.1f nats", self.net.name, changes, gain)
        if not gain > GAIN:
            return False
        self.best = other
        return True

    def settle(self, factors: Sequence[float], *names: str) -> None:
        """Multiply ``names`` by whichever factor gains most, if any does."""
        told = self.best
        for factor in factors:
            self.offer(**{name: getattr(told, name) * factor for name in names})

    def climb(self, factor: float, *names: str, most: int = 10) -> None:
        """Multiply ``names`` by ``factor``, or divide, as long as it gains; ``most`` times."""
        told, now = (getattr(params, names[0]) for params in (self.told, self.best))
        done = round(np.log(now / told) / np.log(factor))
        for way in (-1, 1):
            moved = False
            while abs(done + way) <= most and self.offer(
                **{name: getattr(self.best, name) * factor**way for name in names}
            ):
                moved, done = True, done + way
            if moved:
                break


def learn(
    net: Network,
    events: Sequence[Event],
    target: Target,
    params: Params,
    rng: np.random.Generator,
) -> tuple[Params, dict[str, Any]]:
    """Parameters that fit the events best, and what was learnt with its gain in nats."""
    wanted = LEARNABLE if "all" in params.learn else params.learn
    seed = int(rng.integers(2**63))
    links = sum(len(event.active.tx) + len(event.differences.tx) for event in events)
    span = (events[-1].time_ns - events[0].time_ns) * 1e-9
    interval = span * len(net.sensors) / max(links, 1)
    if links > MOST:
        drawn = np.arange(max(len(events) * MOST // links, 1))
        if all(event.moved is None for event in events):
            # odometry tells how the body moved since the event before, which must not be left out
            drawn = np.sort(rng.choice(len(events), len(drawn), replace=False))
        events = [events[k] for k in drawn.tolist()]
    search = _Search(net, events, target, params, seed, params, interval)
    search.at_first = search.evidence(params)
    if "bias" in wanted:
        spread = NARROW * params.range_bias_spread
        search.best = replace(params, range_bias_spread=spread, range_bias_walk=0.0)
    if "sigma" in wanted:
        search.settle(COARSE, "sigma_factor")
        _explain(search, wanted)
    for finer in FINER:
        before, is_first = search.best, finer == FINER[0]
        if "sigma" in wanted and search.best.noise_time == params.noise_time:
            # ranges that count for less would seem the more exact
            search.climb(finer, "sigma_factor", most=20)
        if "rates" in wanted and (is_first or params.has_object):
            search.climb(2.0, "mean_clutter")
            if params.scatter > 0:
                # fewer scattered ranges pay only where they are much fewer
                search.settle(FEWER, "mean_scatter")
                search.climb(2.0, "mean_clutter")
        if "walks" in wanted:
            if params.has_object:
                search.settle(SLOWER, "bias_angle_std", "bias_distance_std")
                if target.extent:
                    search.settle(SLOWER, "axes_std", "width_std")
            search.climb(1.6, "acceleration_std", most=FARTHEST)
        if "sigma" in wanted and is_first:
            # what stays is to be no walk of the offsets, nor detours, which are new for each range
            _space(search)
        if "bias" in wanted and is_first and search.best.range_bias_std > 0:
            # beside a scale or a height only a rest is left, which stays narrow
            for spread in SPREADS if search.best.range_bias_std > REST_STD else ():
                search.offer(range_bias_spread=spread * params.range_bias_spread)
            for walk in WALKS:
                search.offer(range_bias_walk=walk)
        if "rates" in wanted and is_first and search.best.noise_time == 0.0:
            _late(search)
        _explain(search, wanted)
        if search.best == before:
            break
    search.best = best = max(search.best, search.told, key=search.evidence)
    found = {
        name: _short(getattr(best, name))
        for name in type(params).__dataclass_fields__
        if getattr(best, name) != getattr(params, name)
    }
    return best, {**found, "learning_gain": round(float(search.gain), 1)}


def _short(value: Any) -> Any:
    return round(value, 6) if isinstance(value, float) else value


def _late(search: _Search) -> None:
    """Try whether some of the direct ranges are late, and the noise of the others is less."""
    told = search.best
    variance = np.concatenate([event.active.variance for event in search.events])
    if "late" not in type(told).__dataclass_fields__ or told.late > 0 or not len(variance):
        return
    noise = float(np.sqrt(np.median(variance))) * told.sigma_factor / search.net.sigma_factor
    tried = [
        _set(told, {"late": share, "detour": k * noise, "sigma_factor": less * told.sigma_factor})
        for share, k, less in LATE
    ]
    search.best = max([told, *tried], key=search.evidence)


def _space(search: _Search) -> None:
    """Find how long errors stay, from what a filter that does not follow them leaves unexplained.

    From then on ranges count for less, and evidences compare with each other alone.
    """
    if "noise_time" not in type(search.told).__dataclass_fields__ or search.told.noise_time > 0:
        return
    try:
        steps = search.steps(_set(search.best, {"noise_time": LONGEST}))
        stays = noise_time(*residuals(search.events, steps))
    except EstimatorError:
        return
    # what a fit that is not perfect leaves is alike in neighbours, too
    if stays > IMPERFECT * search.interval:
        gained = search.gain
        search.best, search.told = (
            _set(params, {"noise_time": stays}) for params in (search.best, search.told)
        )
        search.at_first = search.evidence(search.best) - gained


def _explain(search: _Search, wanted: Sequence[str]) -> None:
    """Choose what makes ranges too long: nothing, an offset, a scale, or a difference in height.

    Beside a scale or height a small offset is left, if offsets are to be learnt. Where neither of
    offset and scale is several nats better, both stay possible, each with its probability.
    """
    told, best = search.told, search.best
    off: dict[str, Any] = {
        name: 0.0
        for name, asked in (
            ("range_bias_std", "bias" in wanted),
            ("range_scale_std", "scale" in wanted),
            ("device_height_std", _may_learn_height(search, wanted)),
        )
        if asked
    }
    offset = {"range_bias_std": told.range_bias_std or BIAS_STD}
    scale = {"range_scale_std": told.range_scale_std or SCALE_STD}
    height = {"device_height_std": told.device_height_std or HEIGHT_STD}
    if "range_bias_std" in off:
        scale["range_bias_std"] = height["range_bias_std"] = REST_STD
    if offset.keys() | scale.keys() <= off.keys():
        off["range_error"] = told.range_error

    def worth(model: Mapping[str, float]) -> float:
        free = not model or all(getattr(told, name) > 0 for name in model)
        return search.evidence(_set(best, {**off, **model})) - (0.0 if free else GAIN)

    models = [model for model in ({}, offset, scale, height) if model.keys() <= off.keys()]
    if off:
        worths = [worth(model) for model in models]
        if max(worths) == -np.inf:
            return
        chosen: Mapping[str, Any] = models[int(np.argmax(worths))]
        if "range_error" in off and chosen in (offset, scale):
            of_offset, of_scale = (worths[models.index(model)] for model in (offset, scale))
            if abs(of_offset - of_scale) < SURE:
                chosen = {**scale, **offset, "range_error": "either"}
        search.best = _set(best, {**off, **chosen})


def _may_learn_height(search: _Search, wanted: Sequence[str]) -> bool:
    """Whether the height is asked for, and neither told nor estimated from the anchors' own."""
    return "height" in wanted and search.told.device_height is None and not search.net.has_heights


def _set(params: Params, changes: Mapping[str, Any]) -> Params:
    return replace(params, **changes)


def with_noise(event: Event, factor: float) -> Event:
    """The event with the standard deviations of its ranges times ``factor``."""
    if factor == 1.0:
        return event

    def scaled(links: Links) -> Links:
        return links._replace(variance=links.variance * factor**2)

    return event._replace(
        active=scaled(event.active),
        passive=scaled(event.passive),
        differences=scaled(event.differences),
    )

"""What the recording itself tells of its noise and of what makes ranges too long.

As :mod:`echoset.estimators.eopda.learn` does for the filters, by Laplace's approximation of the
evidence: noise and acceleration are climbed in logarithmic steps; offset, scale or height are
models of which one is taken only for a gain of several nats.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

from ..learn import BIAS_STD, FINER, GAIN, HEIGHT_STD, REST_STD, SCALE_STD
from .params import LEARNABLE, Params

CLIMBS = 12
"""Steps of a climb at most."""
TAILS = (2.0, 1.0)
"""Degrees of freedom of noise with longer tails."""
LEAST_GAIN = 0.1
"""Nats that a step of a climb must gain."""
_log = logging.getLogger(__name__)


@dataclass(slots=True, eq=False)
class Search:
    """The best parameters so far by their ``evidence`` [nats]."""

    evidence: Callable[[Params], float]
    best: Params
    tried: dict[Params, float] = field(default_factory=dict)

    def worth(self, params: Params) -> float:
        """The evidence, found once."""
        if params not in self.tried:
            self.tried[params] = self.evidence(params)
            _log.debug("%s: %.1f nats", params, self.tried[params])
        return self.tried[params]

    def climb(self, name: str, factor: float, down: bool = True) -> None:
        """Multiply a parameter as long as it gains, or divide it if ``down``."""
        for way in (factor, 1 / factor) if down else (factor,):
            moved = False
            for _ in range(CLIMBS):
                other = replace(self.best, **{name: getattr(self.best, name) * way})
                if not self.worth(other) > self.worth(self.best) + LEAST_GAIN:
                    break
                self.best, moved = other, True
            if moved:
                break

    def try_tails(self) -> None:
        """Take longer tails of the noise where they gain."""
        for tail in TAILS:
            other = replace(self.best, tail=tail)
            if tail < self.best.tail and self.worth(other) > self.worth(self.best) + GAIN:
                self.best = other

    def explain(self, params: Params, may_learn_height: bool) -> None:
        """Take the model that is worth most."""
        models = explanations(self.best, params, may_learn_height)
        self.best = max(models, key=lambda model: self.worth(model.params) - model.price).params


class Explanation(NamedTuple):
    """What makes ranges too long, the parameters that say so, and its price [nats]."""

    name: str
    params: Params
    price: float


def explanations(now: Params, told: Params, may_learn_height: bool) -> list[Explanation]:
    """The models that may be learnt, with all else as it is ``now``; what is told costs nothing.

    Beside a scale or height a small offset is left, if offsets are to be learnt.
    """
    wanted = LEARNABLE if "all" in told.learn else told.learn
    off: dict[str, Any] = {
        name: 0.0
        for name, asked in (
            ("range_bias_std", "bias" in wanted),
            ("range_scale_std", "scale" in wanted),
            ("device_height_std", "height" in wanted and may_learn_height),
        )
        if asked
    }
    scale = {"range_scale_std": told.range_scale_std or SCALE_STD}
    height = {"device_height_std": told.device_height_std or HEIGHT_STD}
    if "range_bias_std" in off:
        scale["range_bias_std"] = height["range_bias_std"] = REST_STD
    models: dict[str, Mapping[str, float]] = {
        "nothing": {},
        "offset": {"range_bias_std": told.range_bias_std or BIAS_STD},
        "scale": scale,
        "height": height,
    }
    found = []
    for name, model in models.items():
        if set(model) <= set(off):
            free = not model or all(getattr(told, key) > 0 for key in model)
            params = replace(now, **{**off, **model})
            found.append(Explanation(name, params, 0.0 if free else GAIN))
    return found


def choose(
    params: Params, evidence: Callable[[Params], float], may_learn_height: bool
) -> tuple[Params, dict[str, Any]]:
    """Parameters of greatest evidence, and what was learnt with its gain in nats."""
    wanted = LEARNABLE if "all" in params.learn else params.learn
    search = Search(evidence, params)
    for factor in FINER:
        before = search.best
        search.explain(params, may_learn_height)
        # errors that stay for a while look like less noise to an evidence that takes them for
        # white, so that noise is never less than told, and never walks less
        if "sigma" in wanted:
            search.try_tails()
            search.climb("sigma_factor", factor, down=False)
        if "acceleration" in wanted:
            search.climb("acceleration_std", factor**2)
        if "bias" in wanted and search.best.range_bias_std > 0:
            search.climb("range_bias_walk", 2.0, down=False)
        if search.best == before:
            break
    best = search.best
    found = {
        name: round(getattr(best, name), 6)
        for name in type(params).__dataclass_fields__
        if getattr(best, name) != getattr(params, name)
    }
    gain = search.worth(best) - search.worth(params)
    return best, {**found, "learning_gain": round(float(gain), 1)}

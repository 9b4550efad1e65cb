"""An estimator at work on one recording: the one place where estimators are run."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from itertools import count
from pathlib import Path
from time import perf_counter
from typing import Any

from ..models.checks import check_objects, check_steps, in_range
from ..models.errors import EstimatorError, FormatError, InputError
from ..models.parameters import Layer, as_dict, layered, resolve, sensor_model
from ..models.random import generator
from ..models.records import Estimates, Recording, Scan
from ..models.registry import load

GROUP = "echoset.estimators"
SMOOTH, FILTERED = "smooth", "none"
"""The parameter of estimators that can smooth, and its value where they do not."""

TimedStep = tuple[Estimates, float]
"""The estimates of a step, and the seconds that it took."""


@dataclass(frozen=True, slots=True)
class Estimation:
    """A request: an estimator by name, its layers of parameters, its seed.

    The recording's own layers, which count if ``use_sensor_model``, come after presets and before
    what else there is.
    """

    estimator: str
    layers: tuple[Layer, ...] = ()
    seed: int = 1
    use_sensor_model: bool = True

    @property
    def module(self) -> Any:
        """The estimator's module."""
        return load(GROUP, self.estimator)

    @property
    def called(self) -> str:
        """What its estimates are called: smoothed ones can stand beside those of the filter."""
        said = [layer[SMOOTH] for _, layer in self.layers if SMOOTH in layer]
        return f"{self.estimator}-smooth" if said and said[-1] != FILTERED else self.estimator

    @property
    def uses_truth(self) -> bool:
        """Whether the estimator declares that it is to see the recording with its truth."""
        return bool(getattr(self.module, "USES_TRUTH", False))

    @property
    def files(self) -> tuple[str, ...]:
        """The files that the layers name: values of parameters whose unit is ``file``."""
        named = {f.name for f in fields(self.module.Params) if f.metadata.get("unit") == "file"}
        found = {k: v for _, layer in self.layers for k, v in layer.items() if k in named}
        return tuple(str(v) for v in found.values() if v)

    def on(self, setup: Recording, label: str) -> EstimatorRun:
        """The run over a recording, given without scans, which messages call ``label``.

        Raises
        ------
        InputError : the recording lacks what the estimator needs
        ParameterError : an unknown or impossible parameter
        """
        module = self.module
        visible = {name: s for name, s in setup.streams.items() if s.kind in module.STREAMS}
        if not visible:
            has = " ".join(sorted({s.kind for s in setup.streams.values()})) or "no streams"
            needs = " or ".join(module.STREAMS)
            raise InputError(f"{label}: has {has}, but {self.estimator} needs a stream of {needs}")
        setup = replace(setup, streams=visible)
        stated = sensor_model(setup, module.Params) if self.use_sensor_model else ()
        if hasattr(module, "resolved"):
            params = module.resolved(module.Params, setup, stated, self.layers)
        else:
            params = resolve(module.Params, *layered(stated, self.layers))
        return EstimatorRun(self, setup, params, label)


@dataclass(frozen=True, slots=True)
class EstimatorRun:
    """An estimator at work on one recording: ``setup`` has the streams that it can process."""

    asked: Estimation
    setup: Recording
    params: Any
    label: str
    found: dict[str, Any] = field(default_factory=dict)
    """What the estimator assumed or learnt, as its steps state it in ``found`` of their meta."""

    def steps(self, scans: Iterator[Scan]) -> Iterator[Estimates]:
        """The estimates, step by step, of all ``scans`` of the recording.

        Raises
        ------
        EstimatorError : a step diverges, is not finite or breaks the contract of estimates
        InputError : there are no scans
        """
        return (step for step, _ in self.timed(scans))

    def timed(
        self, scans: Iterator[Scan], now: Callable[[], float] = perf_counter
    ) -> Iterator[TimedStep]:
        """:meth:`steps`, each with the seconds by ``now`` that it took, reading included."""
        rng = generator(self.asked.seed, f"estimate:{self.asked.estimator}", self.setup.meta.name)
        seen = (scan for scan in scans if scan.stream in self.setup.streams)
        steps = self.asked.module.estimate(self.setup, seen, self.params, rng)
        for number in count(1):
            start = now()
            place = f"{self.label}: step {number}"
            with in_range(EstimatorError, place):
                step = next(steps, None)
            seconds = now() - start
            if step is None:
                break
            try:
                check_objects(step.objects, "objects")
                check_steps(step.steps, len(step.objects.time_ns))
            except FormatError as error:
                reason = f"{error.where} {error.reason}"
                raise EstimatorError(f"{place}: {reason}") from error
            self.found.update(step.meta.provenance.get("found", {}))
            yield step, seconds
        deque(scans, maxlen=0)
        if number == 1:
            raise InputError(f"{self.label}: has no scans to estimate from")

    def provenance(
        self, versions: Mapping[str, str], digest: str = "", content_digest: str = ""
    ) -> dict[str, Any]:
        """The provenance of the estimates.

        ``digest`` is that of what can be seen of the recording, ``content_digest`` that of all of
        it, which counts where the estimator uses the truth.
        """
        input = {"name": self.setup.meta.name, "digest": digest, "content_digest": content_digest}
        found = {
            "estimator": self.asked.called,
            "parameters": as_dict(self.params),
            "seed": self.asked.seed,
            "versions": dict(versions),
        }
        if digests := self._digests():
            found["files"] = digests
        if self.found:
            found["found"] = dict(self.found)
        return {**found, "input": {k: v for k, v in input.items() if v}} if digest else found

    def _digests(self) -> dict[str, str]:
        """SHA-256 of the files that the estimator reads beside the recording, by parameter."""
        named: Mapping[str, Path] = getattr(self.asked.module, "files", _none)(
            self.setup, self.params
        )
        sha256 = load("echoset.readers", "sha256")
        return {name: sha256(path) for name, path in named.items()}


def _none(setup: Recording, params: Any) -> Mapping[str, Path]:
    return {}

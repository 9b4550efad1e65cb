"""One recording through one estimator: what a task of ``echoset estimate`` does."""

from __future__ import annotations

from array import array
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from time import perf_counter
from typing import Any

from numpy.linalg import LinAlgError

from ..formats import Writer, header, open_source, read, writer
from ..formats.provenance import versions
from ..models.checks import check_objects, check_steps
from ..models.errors import EstimatorError, FormatError, InputError
from ..models.parameters import Layer, as_dict, resolve, sensor_model
from ..models.random import generator
from ..models.records import Estimates, Meta, Recording
from ..models.registry import load
from . import progress, resume
from .inputs import label, stdin
from .outputs import DASH, Target
from .resume import Decision

GROUP = "echoset.estimators"

TimedStep = tuple[Estimates, float]


@dataclass(frozen=True, slots=True)
class Task:
    """A recording to be estimated; ``show`` its steps as they pass."""

    source: str
    target: Target
    estimator: str
    layers: tuple[Layer, ...]
    use_sensor_model: bool
    seed: int
    show: bool = False

    @property
    def label(self) -> str:
        """The input as the user named it."""
        return label(self.source)


@dataclass(frozen=True, slots=True)
class Timing:
    """Seconds that each step of a recording took, reading its scans included."""

    recording: str
    estimator: str
    time_ns: array[int]
    seconds: array[float]


def estimate(task: Task) -> Timing:
    """Run the estimator over the recording and write its estimates.

    Raises
    ------
    InputError : the recording is damaged, of the wrong kind or lacks what the estimator needs
    ParameterError : an unknown or impossible parameter
    EstimatorError : an estimate that is not finite or breaks the contract of estimates
    OutputError : the output exists or cannot be written
    """
    module = load(GROUP, task.estimator)
    progress.announce_compilation()
    piped = task.source == DASH
    carried = piped and task.target.path is None
    source = open_source(stdin() if piped else Path(task.source), task.label, keep=carried)
    try:
        setup = _whole(task) if _uses_truth(module) else source.setup
        setup = _visible(setup, module.STREAMS, task)
        params = _parameters(setup, module, task)
        rng = generator(task.seed, f"estimate:{task.estimator}", setup.meta.name)
        scans = source.scans()
        seen = (scan for scan in scans if scan.stream in setup.streams)
        steps = _timed(module.estimate(setup, seen, params, rng), task)
        with task.target.open() as target:
            out = writer(target, task.target.format)
            try:
                meta = replace(setup.meta, provenance=_provenance(task, params))
                shown = progress.share(steps, source) if task.show else steps
                timing = _append(shown, out, meta)
                deque(scans, maxlen=0)
                if not timing.time_ns:
                    raise InputError(f"{task.label}: has no scans to estimate from")
                origin = _origin(task, module, meta.name, source.observed_digest)
                meta = replace(meta, provenance={**meta.provenance, "input": origin})
                out.close(meta, source.recording() if carried else None)
                return timing
            finally:
                out.abort()
    finally:
        source.close()


def expected(task: Task) -> dict[str, Any]:
    """The provenance of the estimates that :func:`estimate` would write.

    Of the recording only headers are read.

    Raises
    ------
    InputError, ParameterError : as :func:`estimate`
    """
    module = load(GROUP, task.estimator)
    path = Path(task.source)
    source = open_source(path, task.label)
    try:
        setup = _visible(source.setup, module.STREAMS, task)
    finally:
        source.close()
    origin = _origin(task, module, setup.meta.name, header(path)["observed_digest"])
    return {**_provenance(task, _parameters(setup, module, task)), "input": origin}


def decide(task: Task) -> Decision:
    """Whether the estimates have to be made."""
    if task.source == DASH:
        return resume.decide(replace(task.target, resume=False), dict)
    return resume.decide(task.target, lambda: expected(task))


def _origin(task: Task, module: Any, name: str, digest: str) -> dict[str, str]:
    """Which recording the estimates are of; the truth counts where the estimator uses it."""
    origin = {"name": name, "digest": digest}
    if _uses_truth(module):
        origin["content_digest"] = str(header(Path(task.source))["content_digest"])
    return origin


def _uses_truth(module: Any) -> bool:
    return bool(getattr(module, "USES_TRUTH", False))


def _parameters(setup: Recording, module: Any, task: Task) -> Any:
    stated = sensor_model(setup, module.Params) if task.use_sensor_model else ()
    return resolve(module.Params, *stated, *task.layers)


def _whole(task: Task) -> Recording:
    """The recording with its truth, for an estimator that declares that it uses it."""
    if task.source == DASH:
        raise InputError(f"{task.label}: {task.estimator} uses the truth: give it a file")
    record = read(Path(task.source))
    if not isinstance(record, Recording):
        raise InputError(f"{task.label}: holds estimates, not a recording")
    return record


def _visible(setup: Recording, kinds: Iterable[str], task: Task) -> Recording:
    """``setup`` with the streams that the estimator can process."""
    streams = {name: s for name, s in setup.streams.items() if s.kind in kinds}
    if not streams:
        has = " ".join(sorted({s.kind for s in setup.streams.values()})) or "no streams"
        raise InputError(
            f"{task.label}: has {has}, but {task.estimator} needs a stream of {' or '.join(kinds)}"
        )
    return replace(setup, streams=streams)


def _provenance(task: Task, params: Any) -> dict[str, Any]:
    return {
        "estimator": task.estimator,
        "parameters": as_dict(params),
        "seed": task.seed,
        "versions": versions(),
    }


def _append(steps: Iterable[TimedStep], out: Writer, meta: Meta) -> Timing:
    """Write the steps, and tell their times."""
    timing = Timing(meta.name, str(meta.provenance["estimator"]), array("q"), array("d"))
    for step, seconds in steps:
        out.append(replace(step, meta=meta))
        timing.time_ns.extend(step.objects.time_ns.tolist())
        timing.seconds.extend([seconds] * len(step.objects.time_ns))
    return timing


def _timed(steps: Iterator[Estimates], task: Task) -> Iterator[TimedStep]:
    """The steps, checked, with the seconds that each took."""
    for number in count(1):
        start = perf_counter()
        try:
            step = next(steps, None)
        except (LinAlgError, FloatingPointError) as error:
            raise EstimatorError(f"{task.label}: step {number}: {error}") from error
        seconds = perf_counter() - start
        if step is None:
            return
        try:
            check_objects(step.objects, "objects")
            check_steps(step.steps, len(step.objects.time_ns))
        except FormatError as error:
            reason = f"{error.where} {error.reason}"
            raise EstimatorError(f"{task.label}: step {number}: {reason}") from error
        yield step, seconds

"""The commands as functions on records in memory, for notebooks and scripts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from . import formats
from .estimators.run import Estimation
from .formats.atomic import atomic
from .formats.provenance import versions
from .formats.windows import concatenate
from .metrics import run
from .models.records import Estimates, Recording, Scores


def read(path: str | Path) -> Recording | Estimates:
    """The recording or the estimates in a file.

    Raises
    ------
    FormatError : it cannot be read, is damaged or of another kind
    """
    return formats.read(Path(path))


def write(record: Recording | Estimates, path: str | Path) -> None:
    """Write ``record`` in the format that the suffix of ``path`` stands for; replaces the file.

    Raises
    ------
    ParameterError : no format has this suffix
    FormatError : the record breaks its contract
    """
    path = Path(path)
    with atomic(path, overwrite=True) as temporary:
        formats.write(record, temporary, formats.suffix_format(path))


def estimate(recording: Recording, estimator: str, seed: int = 1, **parameters: Any) -> Estimates:
    """Run an estimator with ``parameters`` over a recording, as ``echoset estimate`` does.

    Raises
    ------
    ParameterError : an unknown estimator or parameter, or an impossible value
    InputError : the recording lacks what the estimator needs
    EstimatorError : the estimator diverged, or its estimates are not finite
    """
    asked = Estimation(estimator, (("parameters", parameters),), seed)
    seen = recording if asked.uses_truth else recording.setup()
    run = asked.on(seen, recording.meta.name)
    whole = concatenate(list(run.steps(recording.scans())))
    content = formats.content_digest(recording) if asked.uses_truth else ""
    provenance = run.provenance(versions(), formats.observed_digest(recording), content)
    return replace(whole, meta=replace(recording.meta, provenance=provenance))


def score(estimates: Estimates, recording: Recording, metric: str, **parameters: Any) -> Scores:
    """Score estimates by a metric with ``parameters``, as ``echoset score`` does.

    Raises
    ------
    ParameterError : an unknown metric or parameter, or an impossible value
    InputError : there is no truth, or it or the estimates lack what the metric needs
    """
    found = run.score(metric, [("parameters", parameters)], estimates, recording)
    return replace(found, provenance={**found.provenance, "versions": versions()})

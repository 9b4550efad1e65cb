"""Numbers of objects: how many there were, how many were estimated.

``cardinality`` has the parts ``true``, ``estimated`` (objects in the output) and ``error``, the
latter less the former; where the estimator states a mean of its posterior, also ``mean`` and
``mean-error``. Aggregates are means over the steps, so that of an error is the bias;
``cardinality-absolute`` holds the means of the absolute errors.
"""

from __future__ import annotations

import numpy as np

from ..models.records import Estimates, Recording, Scores
from .kit.measured import Measured, Names
from .kit.series import Steps, mean_stderr, parts
from .kit.sets import align
from .kit.table import rows
from .protocol import Metric


def measure(estimates: Estimates, recording: Recording, params: Steps) -> Measured:
    """Numbers and errors per step."""
    aligned = align(estimates, recording, params)
    true, estimated = aligned.counts
    values = {"true": true, "estimated": estimated, "error": estimated - true}
    if "cardinality_mean" in estimates.steps:
        mean = estimates.steps["cardinality_mean"][aligned.steps]
        values |= {"mean": mean, "mean-error": mean - true}
    return Measured(aligned.time, values, aligned.left_out)


def summarise(names: Names, measured: Measured, params: Steps) -> Scores:
    """Numbers per step and their means, errors, and the number of steps left out."""
    values = measured.values
    tables = [parts((*names, "cardinality"), measured, values, params.block)]
    for part in ("error", "mean-error"):
        if part in values:
            size = np.abs(values[part])
            key = (*names, "cardinality-absolute", part)
            spread = mean_stderr(size, params.block)
            tables.append(rows(key, np.nan, size.mean(), len(size), spread))
    return Scores.join(tables)


METRIC = Metric(
    "number of objects, true and estimated, and its error",
    Steps,
    measure,
    summarise,
    PARTS=("true", "estimated", "error", "mean", "mean-error"),
    FOR_SETS=True,
)

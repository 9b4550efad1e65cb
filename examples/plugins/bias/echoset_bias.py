"""The mean error along each axis: whether estimates are off to one side.

A root mean square error does not tell a systematic offset, as from uncalibrated ranges, from noise;
the mean of the signed error does. Over a campaign it pools as a mean of the recordings' means.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from echoset.metrics.kit.alignment import ScoredObject, pairs
from echoset.metrics.kit.errors import axes, chosen, deviation
from echoset.metrics.kit.series import mean_stderr
from echoset.metrics.kit.table import rows
from echoset.models.parameters import parameter
from echoset.models.records import Estimates, Recording, Scores

SUMMARY = "mean error of device and centre along each axis, over all steps"
PARTS = ("device", "centre")


@dataclass(frozen=True, slots=True)
class Params(ScoredObject):
    """Which steps and parts are scored."""

    parts: tuple[str, ...] = parameter(
        (), "1", "device, centre; empty: all there are", within=PARTS
    )
    block: int = parameter(
        20, "1", "steps in a block of the bootstrap; 0: no stderr", within="[0, inf)"
    )


def score(estimates: Estimates, recording: Recording, params: Params) -> Scores:
    """Estimated less true position [m] per step and its mean; parts are ``device-x`` and so on.

    Raises
    ------
    InputError : no truth, several objects, a part that is missing, or nothing to score
    """
    aligned = pairs(estimates, recording, params)
    tables = []
    for part in chosen(params.parts, PARTS, aligned):
        errors = deviation(part, aligned)
        for name, e in zip(axes(part, aligned.estimate, aligned.truth), errors.T, strict=True):
            axis = name.removeprefix("device_")
            key = (recording.meta.name, estimates.estimator, "bias", f"{part}-{axis}")
            tables.append(rows(key, aligned.time, e))
            spread = mean_stderr(e, params.block)
            tables.append(rows(key, np.nan, e.mean(), len(e), spread))
    return Scores.join(tables)

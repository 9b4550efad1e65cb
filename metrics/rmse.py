"""Root mean square error of the device's and the object's position, of extent and heading.

For one recording, ``rmse`` at a time is the error itself and the aggregate is the root of its mean
square over the steps, with a standard error by block bootstrap over consecutive steps. Pooling
(:mod:`.pooling`) makes the root mean square over recordings of both, and ``rmse-mean``, the mean
over time of the pooled error. ``rmse-left-out`` counts the steps without truth or estimate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..models.parameters import parameter
from ..models.records import Scores
from .kit.alignment import ScoredObject
from .kit.bootstrap import block_stderr
from .kit.errors import PARTS, errors
from .kit.measured import Measured, Names, of_track
from .kit.table import rows
from .protocol import Metric


@dataclass(frozen=True, slots=True)
class Params(ScoredObject):
    """The parts that are scored, and the bootstrap of their standard errors."""

    parts: tuple[str, ...] = parameter(
        (), "1", "device, centre, extent, heading; empty: all there are", within=PARTS
    )
    block: int = parameter(
        20,
        "1",
        "steps in a bootstrap block, longer than errors last; 0: no stderr",
        within="[0, inf)",
    )
    resamples: int = parameter(1000, "1", "resamples of the bootstrap", within="[2, inf)")


def summarise(names: Names, measured: Measured, params: Params) -> Scores:
    """Errors [m, rad] per step, their root mean square, and the number of steps left out."""
    tables = []
    for part, e in measured.values.items():
        whole = float(np.sqrt(np.mean(e**2)))
        spread = block_stderr(e**2, params.block, params.resamples)
        tables += [
            rows((*names, "rmse", part), measured.time, e),
            rows((*names, "rmse", part), np.nan, whole, len(e), spread),
        ]
    steps = len(measured) + measured.left_out
    tables.append(rows((*names, "rmse-left-out", ""), np.nan, measured.left_out, steps))
    return Scores.join(tables)


METRIC = Metric(
    "root mean square error of device, centre, extent and heading, per step and over all",
    Params,
    of_track(lambda aligned, params: errors(params.parts, PARTS, aligned)),
    summarise,
    PARTS=PARTS,
    QUADRATIC=("rmse",),
)

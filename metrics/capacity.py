"""Aggregate capacity of base stations of which some sense as well as communicate.

E. Favarelli et al., "Multi-base station cooperative sensing with AI-aided tracking", eq. 17: a
station that senses leaves its users the share 1 - rho_p of its power. The users' signal-to-noise
ratio is a calibration that gives the paper's 1.1 Gbit/s where no station senses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..models.errors import InputError
from ..models.multibeam import BaseStation, capacity
from ..models.parameters import parameter, resolve, sensor_model
from ..models.records import Estimates, Recording, Scores
from .table import rows

SUMMARY = "downlink capacity of base stations, some of which also sense"
PARTS = ()
NEEDS_SCANS = False
FOR_SETS = True
QUADRATIC = ()


@dataclass(frozen=True, slots=True)
class Params:
    """What the users experience."""

    snr: float = parameter(8.1, "dB", "signal-to-noise ratio of all users, choice")


def score(estimates: Estimates, recording: Recording, params: Params) -> Scores:
    """The capacity [bit s-1] with the stations that the estimator used; ``n`` is their number.

    Raises
    ------
    InputError : the recording has no range-angle maps
    """
    total = sum(s.kind == "range_angle_map" for s in recording.streams.values())
    if not total:
        raise InputError(f"{recording.meta.name}: capacity: no station with range-angle maps")
    station = resolve(BaseStation, *sensor_model(recording, BaseStation))
    used = estimates.meta.provenance.get("parameters", {}).get("stations") or total
    value = capacity(station, used, total, 10 ** (params.snr / 10))
    return rows((recording.meta.name, estimates.estimator, "capacity", ""), np.nan, value, used)

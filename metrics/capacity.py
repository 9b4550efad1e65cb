"""Aggregate capacity of base stations of which some sense as well as communicate.

E. Favarelli et al., "Multi-base station cooperative sensing with AI-aided tracking", eq. 17: a
station that senses leaves its users the share 1 - rho_p of its power. The users' signal-to-noise
ratio is a calibration that gives the paper's 1.1 Gbit/s where no station senses.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..models.errors import InputError
from ..models.parameters import parameter, resolve, sensor_model
from ..models.radar.multibeam import BaseStation, capacity
from ..models.records import Estimates, Recording, Scores
from .kit.measured import Measured, Names
from .kit.table import rows
from .protocol import Metric


@dataclass(frozen=True, slots=True)
class Params:
    """The links of the users."""

    snr: float = parameter(8.1, "dB", "signal-to-noise ratio of all users, choice")


def measure(estimates: Estimates, recording: Recording, params: Params) -> Measured:
    """The capacity [bit s-1] with the stations that the estimator used, and their number.

    Raises
    ------
    InputError : the recording has no range-angle maps
    """
    total = sum(s.kind == "range_angle_map" for s in recording.streams.values())
    if not total:
        raise InputError(f"{recording.meta.name}: capacity: no station with range-angle maps")
    station = resolve(BaseStation, *sensor_model(recording, BaseStation))
    used = estimates.making.parameters.get("stations") or total
    value = capacity(station, used, total, 10 ** (params.snr / 10))
    lists = {"capacity": np.array([value]), "stations": np.array([used])}
    return Measured(estimates.objects.time_ns, {}, 0, lists)


def summarise(names: Names, measured: Measured, params: Params) -> Scores:
    """The capacity [bit s-1]; ``n`` is the number of stations used."""
    value, used = measured.lists["capacity"][0], measured.lists["stations"][0]
    return rows((*names, "capacity", ""), np.nan, value, used)


METRIC = Metric(
    "downlink capacity of base stations, some of which also sense",
    Params,
    measure,
    summarise,
    FOR_SETS=True,
)

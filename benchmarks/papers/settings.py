"""Targets in maps under other settings: power, layout, timing, bodies, and targets side by side.

Each setting changes the scene of the crossing; nothing of the estimator follows but what the
recording states.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import groupby
from typing import Any

import numpy as np

from echoset.control import stations as chain
from echoset.metrics import accuracy
from echoset.metrics.kit.sets import align
from echoset.metrics.kit.table import rows
from echoset.models.parameters import resolve
from echoset.models.random import generator
from echoset.models.records import Array, Estimates, Recording, Scores
from echoset.simulate import jsc

from . import page, stations

LAYOUTS: Mapping[str, Mapping[str, Any]] = {
    "as stated": {},
    "20 dBm": {"eirp": 20.0},
    "40 dBm": {"eirp": 40.0},
    "50 dBm": {"eirp": 50.0},
    "half the bandwidth": {"subcarriers": 1584},
    "circle of 35 m": {"station_radius": 35.0},
    "circle of 60 m": {"station_radius": 60.0},
    "stations 8 ms apart": {"stagger": 0.008},
    "lanes 3.5 m apart": {
        "lanes": {
            "east": (-19.0, -1.75, 19.0, -1.75),
            "west": (19.0, 1.75, -19.0, 1.75),
            "north": (1.75, -19.0, 1.75, 19.0),
            "south": (-1.75, 19.0, -1.75, -19.0),
        }
    },
}
BODIES: Mapping[str, Mapping[str, Any]] = {
    "as stated": {},
    "sizes drawn": {"vehicle_spread": (0.15, 0.07)},
    "30 % longer, 17 % wider": {"vehicle_length": 5.85, "vehicle_width": 2.1},
    "24 % shorter, 17 % narrower": {"vehicle_length": 3.4, "vehicle_width": 1.5},
    "wheelhouses of 5 m²": {"rcs_wheelhouse": 5.0},
}
"""Vehicles that are not those that ``tbd`` looks for."""
BESIDE = {
    "two vehicles side by side, 3 m": ((1, 1), (0.0, 3.0), 1.5),
    "a pedestrian 3 m in front of a vehicle": ((0, 1), (3.0, 0.0), 0.7),
    "a pedestrian 3 m beside a vehicle": ((0, 1), (0.0, 3.0), 0.7),
    "two pedestrians, 1.2 m": ((0, 0), (0.0, 1.2), 1.0),
}
"""Classes, offset of the first from the second along and across their heading [m], speed [m/s]."""
ASTRAY, FOUND = 1.5, 0.6
"""Distance [m] from which on an estimate is of no target, for those followed and those beside."""
LONG = 1.0
"""Time [s] for which a target that is wrong has gone astray."""
SCANS = 40
"""Scans of two targets beside each other."""


def recorded(changes: Mapping[str, Any], seed: int) -> Recording:
    """A recording of the crossing with changes to its scene."""
    scene = stations.scene()
    stated = {name: getattr(scene, name) for name in jsc.Params.__match_args__}
    params = resolve(jsc.Params, ("scene", stated), ("here", dict(changes)))
    name = f"{stations.SCENARIO}-s{seed}-0000"
    return jsc.simulate(params, generator(seed, "simulate", name), name)


def layout_scores(name: str, seed: int) -> Scores:
    """Scores of tbd with six stations under one of :data:`LAYOUTS`."""
    return _scores(recorded(LAYOUTS[name], seed), name, (6,))


def body_scores(name: str, seed: int) -> Scores:
    """Scores of tbd with six and three stations where bodies are one of :data:`BODIES`."""
    return _scores(recorded(BODIES[name], seed), name, (6, 3))


def _scores(recording: Recording, name: str, numbers: Iterable[int]) -> Scores:
    found = []
    for n in numbers:
        steps = chain.before_detection(recording, n)
        meta = replace(steps[0].meta, provenance={"estimator": f"{name} {n}", "parameters": {}})
        steps = [replace(step, meta=meta) for step in steps]
        found += [stations.scores(recording, steps, False), followed(recording, steps)]
    return Scores.join(found)


def followed(recording: Recording, steps: Sequence[Estimates]) -> Scores:
    """Whether a target is wrong for more than a second, and squared errors by the covariances.

    Wrong are a target that is missed or false (:data:`ASTRAY`) or of another class. Of the squared
    errors in units of their covariance there are the median and the mean.
    """
    estimates = stations.joined(steps)
    wrong, error = _pairs(recording, estimates, ASTRAY)
    longest = max((len(list(some)) for bad, some in groupby(wrong.any(0)) if bad), default=0)
    dt = np.diff(estimates.objects.time_ns[:2]).sum() / 1e9
    values = {
        "astray": float(longest * dt > LONG),
        "error-squared-median": np.median(error) if len(error) else np.nan,
        "error-squared-mean": error.mean() if len(error) else np.nan,
    }
    key = recording.meta.name, str(estimates.meta.provenance["estimator"])
    return Scores.join(rows((*key, m, ""), np.nan, v) for m, v in values.items())


def _pairs(recording: Recording, estimates: Estimates, cutoff: float) -> tuple[Array, Array]:
    """Numbers (3, n) of missed, false and misnamed at each time, and errors squared (k,)."""
    params = accuracy.Params(start=stations.START, cutoff=cutoff)
    aligned = align(estimates, recording, params)
    step, first, second = accuracy.assigned_pairs(aligned, params)
    true, said = aligned.truth, aligned.estimate
    assert true.class_index is not None and said.class_index is not None
    assert said.covariance is not None
    n = len(aligned)
    assigned = np.bincount(step, minlength=n)
    other = np.bincount(step[true.class_index[first] != said.class_index[second]], minlength=n)
    missed, false = (count - assigned for count in aligned.counts)
    e = (aligned.position_truth[first] - aligned.position_estimate[second])[..., None]
    error = (e * np.linalg.solve(said.covariance[second, :2, :2], e)).sum((1, 2))
    return np.stack((missed, false, other)), error


def beside(name: str, seed: int) -> tuple[float, float, float]:
    """Share of the scans in which both are found, false objects a scan, share with classes too."""
    kinds, offset, speed = BESIDE[name]
    params = replace(stations.scene(), scans=SCANS)
    rng = generator(seed, "beside", name)
    h, middle = rng.uniform(0, np.pi), rng.uniform(-12, 12, 2)
    u = np.array([np.cos(h), np.sin(h)])
    there = middle + offset @ np.array([u, (-u[1], u[0])])
    t = params.time_ns / 1e9
    place = np.stack((there, middle))[:, None] + speed * u * (t - t.mean())[:, None]
    state = np.concatenate((place, np.broadcast_to(speed * u, place.shape)), 2)
    heading = np.full(state.shape[:2], h)
    targets = jsc.Targets(np.array(kinds), state, heading, np.ones((2, 2)))
    recording = jsc.recorded(params, targets, rng, name)
    estimates = stations.joined(chain.before_detection(recording, 6))
    (missed, false, other), _ = _pairs(recording, estimates, FOUND)
    found = missed == 0
    return float(found.mean()), float(false.mean()), float((found & (other == 0)).mean())


def beside_table(results: Mapping[str, Sequence[tuple[float, float, float]]]) -> str:
    """Means over runs by case."""
    head = ["", "both found", "false a scan", "found, with their classes"]
    columns = {name: np.array(r).T for name, r in results.items()}
    return page.table(head, [[n, *(page.mean(c) for c in r)] for n, r in columns.items()])

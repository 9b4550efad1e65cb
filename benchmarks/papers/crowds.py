"""Filters and smoothers of many targets on simulated scenes: ``python -m papers --only crowds``.

Every run is a recording of its own, the same for all estimators. Parameters are those of the
scenes where they say something about targets (acceleration, survival), and were else chosen on
other seeds.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
from scene import simulated

from echoset.estimators.run import Estimation
from echoset.formats.windows import concatenate
from echoset.metrics.distances.gospa import METRIC
from echoset.metrics.kit.assignment import assign
from echoset.metrics.kit.sets import sets
from echoset.metrics.run import score
from echoset.models.records import Array, Estimates, Recording

from . import page
from .pieces import Piece, chunks, share_of

NAME, SEED, CHUNK = "crowds", 2026, 5
TARGETS, CLUTTER = (5, 10, 20, 40), (5, 20, 60)
Settings = Mapping[str, Any]
POISSON = {"poisson": True}
CROWD = {"acceleration_density": 0.25, "birth_std_velocity": [6.0, 6.0]}
MEETING = {"acceleration_density": 0.01, "birth_std_velocity": [0.5, 0.5], "birth_rate": 0.02}
SIX = {"acceleration_density": 0.09, "p_survive": 0.98}
WHOLE = {"smooth": "whole"}
ESTIMATORS: Mapping[str, tuple[str, Settings]] = {
    "`phd`": ("phd", {}),
    "`mbm`": ("mbm", POISSON),
    "`mbm --smooth`": ("mbm", POISSON | WHOLE),
    "`pmb`": ("pmb", {}),
    "`pmb --smooth`": ("pmb", WHOLE),
}
CLOSE = {
    **{name: one for name, one in ESTIMATORS.items() if name != "`phd`"},
    "`mbm --smooth=search`": ("mbm", POISSON | {"smooth": "search"}),
}
MANOEUVRE = {"birth_std_velocity": [12.0, 12.0], "birth_rate": 0.05}
TURN = {"motion": "imm", "manoeuvres": [[0.15, 0.1], [-0.15, 0.1], [0.0, 10.0]]}
MODELS: Mapping[str, Settings] = {
    **{f"cv, {q:g}": {"acceleration_density": q} for q in (0.01, 0.1, 0.5, 1.0, 2.0, 4.0, 8.0)},
    "imm": {"acceleration_density": 0.01, **TURN},
}
HIGHWAY = {
    "acceleration_density": 0.1,
    "birth_std_velocity": [20.0, 1.0],
    "scene": [15.0, 245.0, -20.0, 20.0],
}
SPANS = {
    "turns": [*range(23, 36), *range(63, 76)],
    "straight runs": [*range(8, 21), *range(40, 46), *range(80, 101)],
}
COSTS = (
    (40, 60, 1000.0),
    (100, 100, 1414.0),
    (1000, 1000, 4472.0),
    (100, 100, 316.2),
    (1000, 1000, 1000.0),
)
"""Targets, clutter, and half the side [m] of the area: sparse as 40 and 60 are, and dense."""


def estimated(recording: Recording, name: str, settings: Settings) -> tuple[Estimates, Array]:
    """Estimates, and the seconds of the processor that each time took."""
    asked = Estimation(name, (("settings", settings),))
    seen = replace(recording.setup(), truth=None)
    steps, seconds = zip(
        *asked.on(seen, recording.meta.name).timed(recording.scans(), process_time), strict=True
    )
    meta = replace(recording.meta, provenance={"estimator": name})
    return replace(concatenate(list(steps)), meta=meta), np.array(seconds)


def scores(
    found: Estimates, recording: Recording, metric: str, **settings: Any
) -> dict[Any, float]:
    """Aggregates by metric and part, and values by metric, part and time."""
    table = score(metric, [("settings", settings)], found, recording)
    rows = zip(table.metric, table.part, table.time, table.value, strict=True)
    return {(m, p) if np.isnan(t) else (m, p, round(t)): v for m, p, t, v in rows}


def recordings(scenario: str, runs: range, **settings: Any) -> Iterator[Recording]:
    """The recordings that ``echoset simulate --seed 2026`` makes."""
    for run in runs:
        yield simulated(scenario, f"{scenario}-s{SEED}-{run:04d}", SEED, **settings)


def twelve(targets: int, clutter: int, runs: range) -> dict[str, list[float]]:
    """OSPA (c 100 m, p 2) of every estimator in every run of a scene."""
    found: dict[str, list[float]] = {name: [] for name in ESTIMATORS}
    for recording in recordings("crowd", runs, targets=targets, clutter_rate=float(clutter)):
        for name, (estimator, settings) in ESTIMATORS.items():
            out, _ = estimated(recording, estimator, CROWD | settings)
            found[name].append(scores(out, recording, "ospa", cutoff=100.0)["ospa", ""])
    return found


def close(scenario: str, runs: range) -> dict[str, list[list[float]]]:
    """Distance and parts of every estimator but ``phd`` in every run of targets that meet."""
    found: dict[str, list[list[float]]] = {name: [] for name in CLOSE}
    metric, row = ("gospa", "gospa-rms") if scenario == "meeting" else ("t-gospa", "t-gospa")
    parts = ("", "localisation", "missed", "false", *(("switch",) if row == "t-gospa" else ()))
    for recording in recordings(scenario, runs):
        for name in found:
            estimator, settings = CLOSE[name]
            own = MEETING if scenario == "meeting" else SIX
            out, _ = estimated(recording, estimator, own | settings)
            mine = scores(out, recording, metric)
            found[name].append([mine[row, part] for part in parts])
    return found


def manoeuvres(runs: range) -> dict[str, list[list[float]]]:
    """Localisation error [m] of every model in every run, in turns and in straight runs."""
    found: dict[str, list[list[float]]] = {name: [] for name in MODELS}
    for recording in recordings("manoeuvre", runs):
        n = np.diff(recording.truth.objects.row_offset)[0]  # type: ignore[union-attr]
        for name, settings in MODELS.items():
            out, _ = estimated(recording, "pmb", MANOEUVRE | settings)
            mine = scores(out, recording, "gospa", cutoff=50.0)
            found[name].append(
                [
                    float(np.sqrt(np.mean([mine["gospa", part, k] ** 2 for k in span]) / n))
                    for part in ("localisation", "")
                    for span in SPANS.values()
                ]
            )
    return found


def doppler(runs: range) -> dict[str, list[list[float]]]:
    """GOSPA [m], and the error of velocity [m/s], of every filter and use of Doppler in every run.

    The error is the root mean square of the estimates that GOSPA pairs with a car.
    """
    found: dict[str, list[list[float]]] = {}
    metric = METRIC.Params(order=2.0, cutoff=10.0)
    for recording in recordings("highway", runs):
        for name in ("`phd`", "`mbm`", "`pmb`"):
            estimator, settings = ESTIMATORS[name]
            for use in ("ignore", "gate", "use"):
                out, _ = estimated(recording, estimator, HIGHWAY | settings | {"doppler": use})
                both = sets(out, recording, metric)
                pairs = both.near(metric.cutoff)
                own = pairs.take(assign(pairs, metric.cutoff**2 - pairs.distance**2))
                true, ours = (x.columns("vx", "vy") for x in (both.truth, both.estimate))
                error = np.hypot(*(ours[own.second] - true[own.first]).T)
                mean = scores(out, recording, "gospa", cutoff=metric.cutoff)["gospa", ""]
                row = [mean, float(np.sqrt((error**2).mean()))]
                found.setdefault(f"{name}, {use}", []).append(row)
    return found


def cost(targets: int, clutter: int, side: float) -> float:
    """Median time [ms] of a scan by ``pmb``, of 20 behind the first ten."""
    area = [-side, side, -side, side]
    settings = {"targets": targets, "clutter_rate": float(clutter), "clutter_region": area}
    warm = next(recordings("crowd", range(1), steps=5))
    estimated(warm, "pmb", CROWD)
    recording = next(recordings("crowd", range(1), steps=30, **settings))
    _, seconds = estimated(recording, "pmb", CROWD | {"birth_rate": targets / 50})
    return float(1e3 * np.median(seconds[10:]))


def pieces(share: float) -> list[Piece]:
    """Scenes by parts of the runs."""
    return [
        *(
            Piece(twelve, (n, c, runs))
            for n in TARGETS
            for c in CLUTTER
            for runs in chunks(share_of(10, share), CHUNK)
        ),
        *(Piece(close, ("meeting", runs)) for runs in chunks(share_of(100, share), 20)),
        *(Piece(close, ("rendezvous", runs)) for runs in chunks(share_of(20, share), CHUNK)),
        *(Piece(manoeuvres, (runs,)) for runs in chunks(share_of(20, share), CHUNK)),
        *(Piece(doppler, (runs,)) for runs in chunks(share_of(20, share), CHUNK)),
        *(Piece(cost, one) for one in COSTS),
    ]


def joined(results: Sequence[tuple[Piece, Any]], make: Any, *first: Any) -> dict[str, list[Any]]:
    """What a function found in all runs, by row."""
    found: dict[str, list[Any]] = {}
    for piece, result in results:
        if piece.make is make and piece.arguments[: len(first)] == first:
            for name, values in result.items():
                found.setdefault(name, []).extend(values)
    return found


def write(results: Sequence[tuple[Piece, Any]], folder: Path) -> None:
    """Write the page."""
    scenes = {(n, c): joined(results, twelve, n, c) for n in TARGETS for c in CLUTTER}
    ospa = [
        [
            name,
            *(f"{np.mean(scene[name]):.1f}" for scene in scenes.values()),
            page.mean(np.mean([scene[name] for scene in scenes.values()], axis=0)),
        ]
        for name in ESTIMATORS
    ]
    count = len(next(iter(scenes.values()))["`pmb`"])
    page.write(
        folder,
        NAME,
        "Many targets",
        f"Seed {SEED}; parameters were chosen on others. All recordings are simulated.",
        f"## Twelve scenes: {count} runs each",
        "OSPA [m] (c 100 m, p 2), mean over scans and runs; targets + clutter a scan. Last: mean "
        "over the scenes ± standard error over runs.",
        page.table(["", *(f"{n} + {c}" for n, c in scenes), "mean"], ospa),
        *_close(results, "meeting", "RMS GOSPA [m] (c 10 m, p 2) and the roots of its parts", True),
        *_close(results, "rendezvous", "T-GOSPA [m] a step (p 1, c 10 m, gamma 2 m)", False),
        *_manoeuvres(joined(results, manoeuvres)),
        *_doppler(joined(results, doppler)),
        "## Cost of `pmb`",
        "Processor time of a scan, median of 20 scans; the first three areas are as dense as 40 "
        "targets among 60 false alarms on [-1000, 1000]², the last two 20 times as dense.",
        page.table(
            ["targets + clutter", "side of the area [m]", "a scan [ms]"],
            [
                [f"{n} + {c}", f"{2 * side:.0f}", f"{result:.2f}"]
                for piece, result in results
                if piece.make is cost
                for n, c, side in [piece.arguments]
            ],
        ),
    )


def _close(
    results: Sequence[tuple[Piece, Any]], scenario: str, what: str, rms: bool
) -> Iterator[str]:
    found = {name: np.array(v) for name, v in joined(results, close, scenario).items()}
    parts = ["localisation", "missed", "false", *([] if rms else ["switch"])]
    lines = []
    for name, v in found.items():
        if rms:
            total, error = np.sqrt((v**2).mean(0)), (v[:, 0] ** 2).std(ddof=1)
            shown = f"{total[0]:.2f} ± {error / np.sqrt(len(v)) / 2 / total[0]:.2f}"
        else:
            total, shown = v.mean(0), page.mean(v[:, 0])
        lines.append([name, shown, *(f"{x:.2f}" for x in total[1:])])
    yield f"## `{scenario}`: {len(next(iter(found.values())))} runs"
    yield f"{what}; births at detections where the recording does not say where."
    yield page.table(["", "distance", *parts], lines)


def _doppler(found: Mapping[str, list[list[float]]]) -> Iterator[str]:
    values = {name: np.array(v) for name, v in found.items()}
    yield f"## `highway`: {len(next(iter(values.values())))} runs"
    yield (
        "GOSPA [m] (c 10 m, p 2), and root of the mean squared error of velocity [m/s] of what it "
        "pairs, by what is made of Doppler. Last: GOSPA less that of the same recordings without "
        "it."
    )
    lines = []
    for name, v in values.items():
        less = v[:, 0] - values[name.rpartition(",")[0] + ", ignore"][:, 0]
        lines.append([name, *(page.mean(v[:, k]) for k in (0, 1)), page.mean(less)])
    yield page.table(["filter, Doppler", "GOSPA", "velocity", "difference"], lines)


def _manoeuvres(found: Mapping[str, list[list[float]]]) -> Iterator[str]:
    values = {name: np.array(v) for name, v in found.items()}
    single = [name for name in values if name != "imm"]
    best = min(single, key=lambda name: float((values[name][:, 2:] ** 2).mean()))
    yield f"## `manoeuvre`: {len(values['imm'])} runs"
    yield (
        "Root of the mean squared error of position [m] of `pmb`, filtered, by motion model: `cv` "
        "with a density of white acceleration [m² s⁻³], `imm` with turns of 0.15 rad/s and "
        f"braking. Against the best of `cv` by GOSPA over both, {best}: "
        + ", ".join(
            page.mean(100 * (values["imm"][:, k] / values[best][:, k] - 1), 1) + f" % in {name}"
            for k, name in enumerate(SPANS)
        )
        + "."
    )
    lines = [[name, *(page.mean(v[:, k]) for k in (0, 1))] for name, v in values.items()]
    yield page.table(["motion", *SPANS], lines)

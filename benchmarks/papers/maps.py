"""Base stations that sense, with targets seen in the maps themselves.

Beside :mod:`.stations`, which is the paper's chain: track-before-detect, filtered and smoothed, and
the paper's filters with detections by templates, over one to six stations; a street that the
defaults were not chosen on; and the runs that cost the chain the most, as pictures.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import echoset
from echoset.control import stations as chain
from echoset.control.stations import FILTERS, Condition, Steps
from echoset.metrics.pooling import pool
from echoset.models.parameters import resolve
from echoset.models.random import generator
from echoset.models.records import Array, Recording, Scores
from echoset.report.plots import style
from echoset.report.plots.panels import legend
from echoset.simulate import jsc

from . import page, settings, stations
from .pieces import Piece, share_of

NAME = "maps"
SEEDS = range(2001, 2041)
"""Of the recordings, run 0 of each; nothing was chosen on them."""
NUMBERS, BOTH = (1, 2, 3, 6), (3, 6)
"""Numbers of stations for tbd, and for filters of detections."""
PRESETS = "templates", "tuned"
RUNS = {"tbd": len(SEEDS), "templates": 20, "tuned": 20}
"""Runs of the crossing by part of what is compared."""
SHOWN, TRIED, STREETS, OTHERS, PAIRS = 3, 10, 10, 5, 20
"""Runs in pictures, those that they are chosen from, of the street, of other settings, of pairs."""
THINNED = 9
"""Of so many places one is drawn."""
STREET: Mapping[str, Any] = {
    "area": (-60.0, 60.0, -12.0, 12.0),
    "stations": (
        (-60.0, 14.0, -0.5),
        (60.0, -14.0, 2.64),
        (-20.0, -14.0, 0.9),
        (20.0, 14.0, -2.24),
    ),
    "station_height": 6.0,
    "pedestrians": 5,
    "vehicles": 5,
    "lanes": {"east": (-59.0, -1.75, 59.0, -1.75), "west": (59.0, 1.75, -59.0, 1.75)},
    "crosswalks": {
        "south": (-40.0, -8.0, 40.0, -8.0),
        "north": (40.0, 8.0, -40.0, 8.0),
        "over": (0.0, -8.0, 0.0, 8.0),
    },
}  # fmt: skip
"""The street of the documentation: 120 m, lanes 3.5 m apart, stations on masts."""


def street(seed: int) -> Recording:
    """A recording of the street."""
    params = resolve(jsc.Params, ("scene", vars_of(stations.scene())), ("street", dict(STREET)))
    name = f"street-s{seed}-0000"
    return jsc.simulate(params, generator(seed, "simulate", name), name)


def vars_of(params: jsc.Params) -> dict[str, Any]:
    """The parameters as a mapping."""
    return {name: getattr(params, name) for name in jsc.Params.__match_args__}


def estimated(recording: Recording, part: str, numbers: Sequence[int]) -> Iterator[Steps]:
    """Estimates of the recording by a part of what is compared, for numbers of stations."""
    for n in numbers:
        if part == "tbd":
            yield chain.before_detection(recording, n)
            yield chain.before_detection(recording, n, "whole")
            continue
        for name in FILTERS:
            yield chain.alone(recording, Condition(name, part, "adaptive", n))


def scored(recording: Recording, part: str, numbers: Sequence[int]) -> Scores:
    """Their scores."""
    found = []
    for steps in estimated(recording, part, numbers):
        found.append(stations.scores(recording, steps, False))
        found.append(settings.followed(recording, steps))
        whole = {"start": stations.START}
        found.append(echoset.score(stations.joined(steps), recording, "class-log-loss", **whole))
    return Scores.join([t.where(timed=False) for t in found])


def crossing_scores(part: str, seed: int) -> Scores:
    """Scores of a part over a recording of the crossing."""
    return scored(stations.simulated(seed, 0), part, NUMBERS if part == "tbd" else BOTH)


def street_scores(part: str, seed: int) -> Scores:
    """Scores of a part over a recording of the street."""
    return scored(street(seed), part, (4,))


def tracks(seed: int) -> tuple[float, float, list[Array]]:
    """Error before and after, and x, y, class (n, 3) of truth, before and after."""
    recording = stations.simulated(seed, 0)
    before = stations.joined(chain.alone(recording, Condition("mbm", "tuned", "adaptive", 6)))
    after = stations.joined(chain.before_detection(recording, 6))
    limits = {"order": 2.0, "cutoff": 5.0, "start": stations.START}
    errors = []
    for estimates in (before, after):
        t = echoset.score(estimates, recording, "ospa-normalised", **limits)
        errors.append(float(t.where(part="", timed=False).value[0]))
    assert recording.truth is not None
    objects = recording.truth.objects, before.objects, after.objects
    points = [np.column_stack((o.columns("x", "y"), o.class_index)) for o in objects]
    return errors[0], errors[1], points


def pieces(share: float) -> list[Piece]:
    """Recordings of the crossing, the street and other settings, and tracks for pictures.

    A ``share`` of the runs, and of the settings.
    """
    wanted: list[tuple[Callable[..., Any], int, Iterable[str]]] = [
        *((crossing_scores, runs, [part]) for part, runs in RUNS.items()),
        (street_scores, STREETS, RUNS),
        *(
            (make, runs, list(names)[: max(2, round(len(names) * share))])
            for make, runs, names in (
                (settings.layout_scores, OTHERS, settings.LAYOUTS),
                (settings.body_scores, OTHERS, settings.BODIES),
                (settings.beside, PAIRS, settings.BESIDE),
            )
        ),
    ]
    found = [
        Piece(make, (name, SEEDS[k]))
        for make, most, names in wanted
        for name in names
        for k in range(share_of(most, share))
    ]
    return found + [Piece(tracks, (SEEDS[k],)) for k in range(max(SHOWN, share_of(TRIED, share)))]


def write(results: Sequence[tuple[Piece, Any]], folder: Path) -> None:
    """Write the page and its pictures."""
    of: dict[Any, list[Any]] = {}
    for piece, result in results:
        of.setdefault(piece.make, []).append(result)
    runs = Counter((p.make, p.arguments[0]) for p, _ in results)
    crossing, there, layouts, bodies = (pool(Scores.join(of[make])) for make in SCORED)
    seeds = [p.arguments[0] for p, _ in results if p.make is tracks]
    tried = sorted(zip(of[tracks], seeds, strict=True), key=lambda t: -t[0][0])
    pairs: dict[str, list[Any]] = {}
    for piece, result in results:
        if piece.make is settings.beside:
            pairs.setdefault(piece.arguments[0], []).append(result)
    _draw_numbers(crossing, folder / f"{NAME}-3.svg")
    _draw_tracks(tried[:SHOWN], folder / f"{NAME}-tracks.svg")
    made = [f"{runs[crossing_scores, part]} by `{part}`" for part in RUNS]
    page.write(
        folder,
        NAME,
        "Base stations that sense: in the map",
        f"Recordings of `{stations.SCENARIO}`, seeds from {SEEDS[0]} on: {', '.join(made)}; "
        f"{runs[street_scores, 'tbd']} of the street.",
        INTRODUCTION,
        f"## The crossing\n\n{_table(crossing, _names(NUMBERS, BOTH))}",
        f"![Normalised OSPA and accuracy by number of stations]({NAME}-3.svg)",
        f"{STREET_WORDS}\n\n{_table(there, _names((4,), (4,)))}",
        PICTURES.format(shown=SHOWN, tried=len(tried)),
        f"![Three runs by mbm on clusters and by tbd]({NAME}-tracks.svg)",
        LAYOUT_WORDS.format(runs=runs[settings.layout_scores, "as stated"]),
        _table(layouts, (f"{name} 6" for name in settings.LAYOUTS)),
        BODY_WORDS.format(runs=runs[settings.body_scores, "as stated"]),
        _table(bodies, (f"{name} {n}" for name in settings.BODIES for n in (6, 3))),
        BESIDE_WORDS.format(runs=len(pairs[next(iter(pairs))]), found=settings.FOUND),
        settings.beside_table(pairs),
    )


SCORED = crossing_scores, street_scores, settings.layout_scores, settings.body_scores


def _names(numbers: Sequence[int], both: Sequence[int]) -> Iterator[str]:
    yield from (f"{name} {n}" for name in ("tbd", "tbd smooth") for n in numbers)
    for preset in PRESETS:
        yield from (Condition(f, preset, "adaptive", n).name for f in FILTERS for n in both)


COLUMNS = {
    "OSPA [m]": ("ospa-normalised", "", 3),
    "of it localisation": ("ospa-normalised", "localisation", 3),
    "missed": ("ospa-normalised", "missed", 3),
    "false": ("ospa-normalised", "false", 3),
    "GOSPA [m]": ("gospa", "", 3),
    "accuracy": ("accuracy", "", 4),
    "log loss": ("class-log-loss", "", 3),
    "gone astray": ("astray", "", 3),
    "NEES, median": ("error-squared-median", "", 2),
    "mean": ("error-squared-mean", "", 1),
}


def _table(p: Scores, names: Iterator[str]) -> str:
    columns = p.estimator, p.metric, p.part, p.value.tolist(), p.stderr.tolist()
    pooled = {(e, m, q): (v, s) for e, m, q, v, s in zip(*columns, strict=True)}
    value = partial(stations.cell, pooled)
    shown = {t: c for t, c in COLUMNS.items() if any(c[0] == m for _, m, _ in pooled)}
    made = set(p.estimator)
    rows = [[n, *(value((n, m, q), d) for m, q, d in shown.values())] for n in names if n in made]
    return page.table(["", *shown], rows)


def _draw_numbers(p: Scores, path: Path) -> None:
    """Normalised OSPA and accuracy by number of stations."""
    rows_ = enumerate(zip(p.estimator, p.metric, p.part, strict=True))
    at = {(e, m): i for i, (e, m, part) in rows_ if not part}
    lines = {"tbd": ("tbd {}", NUMBERS), "tbd, smoothed": ("tbd smooth {}", NUMBERS)}
    lines |= {f"{f}, {s}": (f"{f} {s} adaptive {{}}", BOTH) for s in PRESETS for f in FILTERS}
    with style.style():
        figure = Figure(figsize=(18 * style.CM, 8 * style.CM), layout="constrained")
        axes = figure.subplots(1, 2)
        for a, metric in zip(axes, ("ospa-normalised", "accuracy"), strict=True):
            for i, (label, (name, numbers)) in enumerate(lines.items()):
                rows = [at[name.format(n), metric] for n in numbers]
                a.errorbar(numbers, p.value[rows], p.stderr[rows], label=label, **style.line(i))
            a.set(xlabel="stations that sense", xticks=range(1, 7))
        axes[0].set(ylabel="normalised OSPA [m]", yscale="log")
        axes[1].set(ylabel="accuracy")
        legend(figure, axes[0])
    page.save(figure, path)


def _draw_tracks(runs: Sequence[tuple[tuple[float, float, list[Array]], int]], path: Path) -> None:
    """Truth in grey, estimates over it: above before, below after."""
    with style.style():
        figure = Figure(figsize=(18 * style.CM, 13 * style.CM), layout="constrained")
        axes = figure.subplots(2, len(runs), sharex=True, sharey=True)
        for column, ((*errors, points), seed) in zip(axes.T, runs, strict=True):
            points = [found[::THINNED] for found in points]
            truth = points[0]
            rows = zip(column, ("mbm, tuned", "tbd"), errors, points[1:], strict=True)
            for a, name, error, found in rows:
                a.plot(*truth[:, :2].T, ".", color="0.8", markersize=5, label="truth")
                for kind, label in enumerate(("pedestrian", "vehicle")):
                    mine = found[found[:, 2] == kind]
                    a.plot(*mine[:, :2].T, ".", color=f"C{kind}", markersize=1.5, label=label)
                a.set(title=f"{name}, seed {seed}: {error:.2f} m", aspect="equal")
        legend(figure, axes[0, 0])
    page.save(figure, path)


INTRODUCTION = """\
`tbd` tracks targets in the maps by the likelihood of all cells; `phd` and `mbm` take detections
from the same templates (preset `templates`) or from clusters (`tuned`, the chain of
[the other page](stations.md)). The bodies that they look for are those that are simulated.
Mean over scans 11 to 200 and recordings ± standard error over recordings; normalised OSPA and
GOSPA of order 2, cut-off 5 m. *Gone astray*: share of the runs in which, for more than a second,
a target is missed, false (1.5 m) or of another class. *NEES*: squared errors of places in units of
their covariance, over scans and targets; the median should be 1.4 and the mean 2."""
STREET_WORDS = """\
## A street

120 m, ten targets, lanes 3.5 m apart, four stations on masts of 6 m: a layout that nothing was
learnt for."""
LAYOUT_WORDS = """\
## Other powers, layouts and times

`tbd`, six stations, {runs} runs each, nothing changed but the scene. Noise bounds what a station
of 20 dBm sees: a pedestrian at 50 m is 25 dB above it, where 30 dBm have 35 dB."""
BODY_WORDS = """\
## Bodies that are not those looked for

`tbd`, six and three stations, {runs} runs each; vehicles differ from those stated to it. *Sizes
drawn*: log length and log width of each vehicle have deviations of 0.15 and 0.07."""
BESIDE_WORDS = """\
## Side by side

Two targets that go on side by side, `tbd`, six stations, {runs} runs of 40 scans each, anywhere and
in any direction: found are both where both have an estimate within {found} m."""
PICTURES = """\
## Runs that used to fail

The {shown} of {tried} recordings, six stations, in which `mbm` on clusters has the largest error:
above by it, below by `tbd`. Truth in grey."""

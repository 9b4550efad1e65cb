"""Figures 2 to 6 of Andrecki, Delande, Houssineau and Clark."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import control_table

from echoset.control import figures
from echoset.control.campaign import Campaign, join, mean_over
from echoset.models.records import Array

from . import page
from .pieces import Piece, chunks, share_of

NAME = "control"
CHUNK, EVERY = 10, 25


def pieces(share: float) -> list[Piece]:
    """Conditions by parts of the runs."""
    return [
        Piece(control_table.run, (name, runs))
        for name in figures.CONDITIONS
        for runs in chunks(share_of(control_table.published_runs(name), share), CHUNK)
    ]


def write(results: Sequence[tuple[Piece, Any]], folder: Path) -> None:
    """Write the page."""
    found = {
        name: join(r for p, r in results if p.arguments[0] == name) for name in figures.CONDITIONS
    }
    names = list(found)
    parts = []
    for title, keys in (("2 and 3", names[:2]), ("4 and 5", names[2:4]), ("6", names[4:])):
        some = {key: found[key] for key in keys}
        runs = len(found[keys[0]].view)
        parts += [
            f"## Figures {title}: {runs} runs" if len(title) > 1 else f"## Figure 6: {runs} runs"
        ]
        parts += [LEGENDS[title], figures.activity(some, EVERY), ERRORS]
        parts += [figures.errors(some, EVERY), LOOKS, figures.looks(some)]
    head = ["finding of the paper", "difference", "where", "ours"]
    page.write(
        folder,
        NAME,
        "Sensor control by regional statistics",
        f"Seed {control_table.SEED}; runs of one number share targets, misses, noise and clutter.",
        INTRODUCTION,
        page.table(head, findings(found)),
        *parts,
        MISSING,
    )


def findings(found: Mapping[str, Campaign]) -> Iterator[list[str]]:
    """What the paper says of its figures, beside paired differences of the mean absolute error."""

    def less(a: str, b: str, where: Array, regions: list[int]) -> str:
        one, other = (mean_over(found[c].error[..., regions], where[..., regions]) for c in (a, b))
        return page.mean(one - other, 3)

    crossing = found["naive 0.6 1"].true > 0
    first = "variance better over all (figure 3)", "variance less naive"
    for regions, name in (([0], "B1"), ([1], "B2"), ([2], "B3"), ([0, 1, 2], "all regions")):
        value = less("variance 0.6 1", "naive 0.6 1", crossing, regions)
        yield [*first, f"{name} while it is crossed", value]
    empty = found["naive 0.8 10"].true == 0
    early = empty.copy()
    early[:, 150:] = False
    second = "variance better in empty B2 and B3 (figure 5)", "variance less naive"
    yield [*second, "B2 empty", less("variance 0.8 10", "naive 0.8 10", empty, [1])]
    yield [*second, "B2 empty, up to step 150", less("variance 0.8 10", "naive 0.8 10", early, [1])]
    yield [*second, "B3 empty", less("variance 0.8 10", "naive 0.8 10", empty, [2])]
    everywhere = found["birth 1"].true >= 0
    for rate in ("0.05", "20"):
        value = less("birth 1", f"birth {rate}", everywhere, [0, 1, 2])
        yield [
            "birth rate 1 best over all (figure 6)",
            f"1 less {rate}",
            "all regions, steps",
            value,
        ]


INTRODUCTION = """\
M. Andrecki, E. D. Delande, J. Houssineau and D. E. Clark, *Sensor management with regional
statistics for the PHD filter*. The paper prints curves and what they show, no numbers; scene,
regions and views are the scenario's own. Mean absolute errors in the number of targets, and their
paired differences, ± standard error over runs: a negative difference agrees with the paper."""
ACTIVITY = "Number of targets in the regions: true, and mean ± standard deviation of the filter"
LEGENDS = {
    "2 and 3": f"{ACTIVITY}; detection probability 0.6, one false alarm a scan.",
    "4 and 5": f"{ACTIVITY}; detection probability 0.8, ten false alarms a scan.",
    "6": f"{ACTIVITY}; detection probability 0.8, one false alarm a scan, waves of targets, birth "
    "rates 0.05, 1 and 20.",
}
ERRORS = "Absolute error in the number of targets ± standard error over runs:"
LOOKS = "Share of looks at each region ± standard error over runs:"
MISSING = """\
## What is not here

Figure 1 is a sketch of the scene. `make control-table` prints the tables at every tenth step."""

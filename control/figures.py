"""Figures 2-6 of the paper as tables, and the looks that each policy spends on the regions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from ..models.records import Array
from .runs import Runs, paired

Changes = dict[str, Any]
NAIVE: Changes = {"policy": "naive"}
VARIANCE: Changes = {"policy": "variance"}
FEW: Changes = {"p_detect": 0.6, "clutter_rate": 1.0}
MANY: Changes = {"p_detect": 0.8, "clutter_rate": 10.0}
WAVES: Changes = {"groups": "waves", "p_detect": 0.8, "clutter_rate": 1.0}
CONDITIONS: dict[str, Changes] = {
    "naive 0.6 1": NAIVE | FEW,
    "variance 0.6 1": VARIANCE | FEW,
    "naive 0.8 10": NAIVE | MANY,
    "variance 0.8 10": VARIANCE | MANY,
    "birth 0.05": VARIANCE | WAVES | {"birth_rate": 0.05},
    "birth 1": VARIANCE | WAVES | {"birth_rate": 1.0},
    "birth 20": VARIANCE | WAVES | {"birth_rate": 20.0},
}
"""Parameters of the scenario in figures 2 and 3, 4 and 5, and 6."""


def activity(campaigns: Mapping[str, Runs], every: int) -> str:
    """Figures 2 and 4: true number and mean +- standard deviation, averaged over the runs."""
    first = next(iter(campaigns.values()))
    names = _regions(first)
    head = ["step", *(f"{n} {what}" for n in names for what in ("true", *campaigns))]
    true = first.true.mean(0)
    shown = {key: (c.mean.mean(0), np.sqrt(c.variance).mean(0)) for key, c in campaigns.items()}
    rows = [
        [
            str(k + 1),
            *(
                text
                for b in range(len(names))
                for text in (
                    f"{true[k, b]:.1f}",
                    *(f"{m[k, b]:.1f} ± {s[k, b]:.1f}" for m, s in shown.values()),
                )
            ),
        ]
        for k in _steps(first, every)
    ]
    return _table(head, rows)


def errors(campaigns: Mapping[str, Runs], every: int) -> str:
    """Figures 3, 5 and 6: absolute error in the number of targets, with its standard error."""
    first = next(iter(campaigns.values()))
    names = _regions(first)
    head = ["step", *(f"{n} {key}" for n in names for key in campaigns)]
    rows = [
        [
            str(k + 1),
            *(_mean(c.error[:, k, b]) for b in range(len(names)) for c in campaigns.values()),
        ]
        for k in _steps(first, every)
    ]
    whole = (_mean(c.error[:, :, b].mean(1)) for b in range(len(names)) for c in campaigns.values())
    return _table(head, [*rows, ["all", *whole]])


def looks(campaigns: Mapping[str, Runs]) -> str:
    """Share of looks at each region, with its standard error over the runs."""
    first = next(iter(campaigns.values()))
    rows = [[key, *(_mean(share) for share in c.looks().T)] for key, c in campaigns.items()]
    return _table(["", *_regions(first)], rows)


def _regions(campaign: Runs) -> list[str]:
    return [f"B{b + 1}" for b in range(campaign.true.shape[2])]


def _steps(campaign: Runs, every: int) -> range:
    return range(every - 1, campaign.true.shape[1], every)


def _mean(values: Array) -> str:
    mean, stderr = paired(values)
    return f"{mean:.2f} ± {stderr:.2f}"


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    columns = list(head)
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"

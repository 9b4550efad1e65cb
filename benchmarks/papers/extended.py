"""Figure 2 of the paper on DI-GSNCP, and the bound of its figure 1."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from echoset.metrics.kit.table import rows
from echoset.metrics.pooling import pool
from echoset.report.plots.protocol import Inputs
from echoset.simulate.radar_extended import Params

from . import gsncp_table as gsncp
from . import page
from .pieces import Piece, share_of

NAME = "extended"
RUNS = 100
SCENARIOS = {
    "radar-extended-r8": "the paper's hard-core radius of 8 m, 4.6 targets on average",
    "radar-extended": "hard-core radius 6 m, 9.6 targets on average: closer than the paper's",
}


def pieces(share: float) -> list[Piece]:
    """The runs of both scenarios."""
    runs = range(share_of(RUNS, share))
    return [Piece(gsncp.one, (run, scenario)) for scenario in SCENARIOS for run in runs]


def write(results: Sequence[tuple[Piece, Any]], folder: Path) -> None:
    """Write the page, a box plot for each scenario, and the map of the bound."""
    parts = []
    for scenario, text in SCENARIOS.items():
        found = [row for p, r in results if p.arguments[1] == scenario for row in r]
        boxes = f"{scenario.removeprefix('radar-')}.svg"
        _draw(scenario, found, folder / boxes)
        parts += [f"## `{scenario}`: {text}", f"![OSPA by epoch and method]({boxes})"]
        parts += [_published(found), gsncp.tables(found).replace("\n## ", "\n### ")]
    inputs = Inputs(recordings=(gsncp.simulated("radar-extended-r8", 0),))
    for kind in ("scene", "bound"):
        page.picture(kind, inputs, folder / f"{NAME}-{kind}.svg")
    page.write(
        folder,
        NAME,
        "Extended targets by jump MCMC",
        f"{len({r['run'] for r in found})} of its {RUNS} runs of each scenario, seed {gsncp.SEED}.",
        INTRODUCTION,
        *parts,
        SCENE,
    )


def _published(found: Sequence[gsncp.Row]) -> str:
    """What the paper says of its figure, beside ours."""

    def column(method: str, epoch: int, key: str = "ospa_gw") -> list[float]:
        return [float(r[key]) for r in found if (r["method"], r["epoch"]) == (method, epoch)]

    def difference(a: str, b: str, epoch: int) -> str:
        pairs = zip(column(a, epoch), column(b, epoch), strict=True)
        return page.mean([x - y for x, y in pairs], 3)

    last = max(r["epoch"] for r in found)
    lines = []
    for method in ("di-gsncp", "di-gsncp paper"):
        for epoch in range(2, last + 1):
            text = "significantly better than DBSCAN after two epochs"
            lines += [
                [text, method, f"less DBSCAN, epoch {epoch}", difference(method, "dbscan", epoch)]
            ]
        for epoch in range(4, last + 1):
            text = "close to the oracle after four epochs"
            lines += [
                [text, method, f"less oracle, epoch {epoch}", difference(method, "oracle", epoch)]
            ]
        most = max((column(method, t, "iterations") for t in range(1, last + 1)), key=sum)
        text = "fewer than 1000 moves on average in all epochs"
        lines += [[text, method, "moves in the epoch with most", page.mean(most, 0)]]
    return page.table(["the paper", "method", "OSPA [m], or moves", "ours"], lines)


def _draw(scenario: str, found: Sequence[gsncp.Row], path: Path) -> None:
    """OSPA by epoch, as a box for each method."""
    step = Params().epoch
    scores = concatenate(
        rows(
            (f"{scenario}-s{gsncp.SEED}-{r['run']:04d}", r["method"], "ospa-gw", ""),
            t,
            r["ospa_gw"],
        )
        for r in found
        if r["method"] in gsncp.METHODS
        for t in [step * r["epoch"]]
    )
    page.picture("box", Inputs(scores=scores, pooled=pool(scores)), path)


INTRODUCTION = """\
*Efficient sensing of multiple extended targets by a doubly inhomogeneous generalised shot noise
Cox process and jump Markov chain Monte Carlo sampling*, section 5. The paper prints its figure 2
as box plots without numbers. OSPA with the Gaussian-Wasserstein distance, order 2, cut-off 10 m;
means over runs ± standard error, differences paired. `di-gsncp paper` has the paper's moves only,
`oracle` is told which detection is whose. Moves are counted with the burn-in,
which ends when no better state has come for `patience` moves: the paper's 200 end it before all
targets are found, so ours are thousands; a move takes microseconds."""
SCENE = """\
## Figure 1: a scene, and its bound

The paper draws one scene, of which it publishes no numbers; this is run 0 of `radar-extended-r8`.

![Targets, radars and their detections](extended-scene.svg)

![Position error bound over the area](extended-bound.svg)"""

"""Figure 2 of the paper on DI-GSNCP, and the bound of its figure 1.

    python -m papers.extended [--runs 100] [--jobs 2] [--scenario radar-extended] [-o DIR]

Simulates the recordings that ``echoset simulate SCENARIO --runs 100 --seed 1`` writes, runs the
chain with both presets, the baselines, and for the first two epochs a chain that starts at the
truth. Writes ``gsncp.csv`` (every run: data for a box plot), ``gsncp.md`` (the tables) and
``gsncp-bound.csv`` (the position error bound of the first sensor at z = 5 m: Fig. 1) to DIR.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import echoset
from echoset.estimators.gsncp import dbscan, di_gsncp, oracle
from echoset.estimators.gsncp.chain import sample
from echoset.formats.windows import concatenate
from echoset.metrics.kit.table import rows
from echoset.metrics.pooling import pool
from echoset.models.parameters import resolve, sensor_model
from echoset.models.radar import ofdm
from echoset.models.random import generator
from echoset.models.records import Estimates, Meta, Recording, Scores
from echoset.report.plots.protocol import Inputs
from echoset.simulate import radar_extended
from echoset.simulate.radar_extended import Params

from . import page
from .pieces import Piece, share_of

SEED = 1
METHODS: dict[str, tuple[Any, str]] = {
    "oracle": (oracle, "default"),
    "di-gsncp": (di_gsncp, "default"),
    "di-gsncp paper": (di_gsncp, "paper"),
    "dbscan": (dbscan, "default"),
}
EARLY = 2
"""Epochs in which a chain started at the truth is compared."""
Row = dict[str, Any]


def simulated(scenario: str, run: int) -> Recording:
    """The recording that the command line simulates as this run."""
    path = Path(radar_extended.__file__).parent / "scenarios" / f"{scenario}.yaml"
    params = resolve(
        radar_extended.Params, (path.name, yaml.safe_load(path.read_text())["parameters"])
    )
    name = f"{scenario}-s{SEED}-{run:04d}"
    return radar_extended.simulate(params, generator(SEED, "simulate", name), name)


def estimated(recording: Recording, method: str) -> tuple[Estimates, list[float]]:
    """The estimates of a method, and the CPU seconds of each epoch."""
    module, preset = METHODS[method]
    setup = recording if module is oracle else recording.setup()
    layers = sensor_model(recording, module.Params)
    params = resolve(module.Params, *layers, (preset, module.PRESETS[preset]))
    rng = generator(SEED, f"estimate:{method}", recording.meta.name)
    steps, seconds, start = [], [], time.process_time()
    for step in module.estimate(setup, recording.scans(), params, rng):
        steps.append(step)
        seconds.append(time.process_time() - start)
        start = time.process_time()
    meta = Meta(recording.meta.name, provenance={"estimator": method})
    whole = concatenate(steps)
    return Estimates(meta, whole.objects, whole.steps), seconds


def from_truth(recording: Recording) -> Iterator[tuple[int, float]]:
    """Cardinality and mean log posterior of chains that start at the truth, in early epochs."""
    layers = sensor_model(recording, di_gsncp.Params)
    params = resolve(di_gsncp.Params, *layers, ("", {"restart": False}))
    assert recording.truth is not None
    objects = recording.truth.objects
    C = objects.state[: objects.row_offset[1]]
    for t, (_, scene) in enumerate(di_gsncp.scenes(recording.setup(), recording.scans(), params)):
        if t == EARLY:
            return
        rng = generator(SEED, "truth", recording.meta.name, t)
        result = sample(scene, params, [(C[:, :3], C[:, 3:])], None, rng)
        yield len(result.last[0]), float(result.explored.trace.mean())


def one(run: int, scenario: str) -> list[Row]:
    """All figures of one run."""
    recording = simulated(scenario, run)
    assert recording.truth is not None
    true = int(recording.truth.objects.row_offset[1])
    rows = []
    for method in METHODS:
        estimates, seconds = estimated(recording, method)
        scores = echoset.score(estimates, recording, "ospa-gw")
        parts = np.array(scores.part)
        for t, spent in enumerate(seconds):
            here = scores.time == estimates.objects.time_ns[t] / 1e9
            value = {p: float(scores.value[here & (parts == p)][0]) for p in ("", "extent")}
            row: Row = {"run": run, "method": method, "epoch": t + 1, "ospa_gw": value[""]}
            row |= {"extent": value["extent"], "true": true, "seconds": spent}
            row["estimated"] = int(np.diff(estimates.objects.row_offset)[t])
            for key in ("iterations", "log_posterior_explored"):
                row[key] = float(estimates.steps[key][t]) if key in estimates.steps else ""
            rows.append(row)
    for t, (count, posterior) in enumerate(from_truth(recording)):
        row = {"run": run, "method": "from truth", "epoch": t + 1, "ospa_gw": "", "extent": ""}
        row |= {"true": true, "seconds": "", "estimated": count, "iterations": ""}
        rows.append(row | {"log_posterior_explored": posterior})
    return rows


def tables(rows: list[Row]) -> str:
    """The tables as Markdown."""
    lines = []
    methods, epochs = list(METHODS), sorted({r["epoch"] for r in rows})

    def column(method: str, epoch: int, key: str) -> np.ndarray[Any, Any]:
        chosen = (r for r in rows if r["method"] == method and r["epoch"] == epoch)
        return np.array([r[key] for r in sorted(chosen, key=lambda r: r["run"])], float)

    def table(title: str, cell: Any, wanted: Iterable[str] = methods) -> None:
        head = " | ".join(f"epoch {t}" for t in epochs)
        lines.extend((f"\n## {title}\n", f"| | {head} |", "|---" * (len(epochs) + 1) + "|"))
        for method in wanted:
            lines.append(f"| {method} | " + " | ".join(cell(method, t) for t in epochs) + " |")

    def mean(x: np.ndarray[Any, Any], digits: int = 3) -> str:
        if not len(x):
            return "-"
        spread = x.std(ddof=1) / np.sqrt(len(x)) if len(x) > 1 else np.nan
        return f"{x.mean():.{digits}f} ± {spread:.{digits}f}"

    def right(method: str, t: int) -> np.ndarray[Any, Any]:
        return column(method, t, "estimated") == column(method, t, "true")

    def quartiles(method: str, t: int) -> str:
        return " / ".join(
            f"{q:.2f}" for q in np.quantile(column(method, t, "ospa_gw"), [0.25, 0.5, 0.75])
        )

    def ratio(method: str, t: int, among: bool) -> str:
        ok = right(method, t) if among else np.ones_like(right(method, t))
        a, b = (column(m, t, "ospa_gw")[ok] for m in (method, "oracle"))
        return f"{a.mean() / b.mean():.3f}" if ok.any() else "-"

    chains = ("di-gsncp", "di-gsncp paper")
    table("OSPA-GW [m]: mean and standard error", lambda m, t: mean(column(m, t, "ospa_gw")))
    table("OSPA-GW [m]: quartiles", quartiles)
    table("Cardinality exact [%]", lambda m, t: mean(100 * right(m, t), 0))
    estimators = methods[1:]
    table(
        "OSPA-GW over the oracle's, where the cardinality is exact",
        partial(ratio, among=True),
        estimators,
    )
    table("OSPA-GW over the oracle's, all runs", partial(ratio, among=False), estimators)
    table("Extent error [m]", lambda m, t: mean(column(m, t, "extent")))
    table("Moves", lambda m, t: mean(column(m, t, "iterations"), 0), chains)
    table("CPU seconds", lambda m, t: mean(column(m, t, "seconds")))
    lines.append("\n## Against chains that start at the truth\n")
    for t in epochs[:EARLY]:
        mine, theirs = (column(m, t, "log_posterior_explored") for m in ("di-gsncp", "from truth"))
        same = column("di-gsncp", t, "estimated") == column("from truth", t, "estimated")
        lines.append(
            f"Epoch {t}: log posterior higher by {mean(mine - theirs)}, cardinality equal in "
            f"{100 * same.mean():.0f} %, exact in {100 * right('di-gsncp', t).mean():.0f} % "
            f"(from the truth {100 * right('from truth', t).mean():.0f} %)."
        )
    return "\n".join(lines) + "\n"


def bound(path: Path) -> None:
    """The position error bound of the first sensor over the plane z = 5 m."""
    params = radar_extended.Params()
    rng = generator(SEED, "bound", "radar-extended")
    state = radar_extended.sensor_state(params, 0, 0, rng)
    x, y = np.meshgrid(np.arange(0.25, 50, 0.5), np.arange(0.25, 20, 0.5), indexing="ij")
    points = np.stack([x, y, np.full_like(x, 5.0)], -1).reshape(-1, 3)
    table = np.column_stack([points[:, :2], ofdm.error_bound(state, points)])
    np.savetxt(path, table, delimiter=",", header="x,y,error_bound", comments="", fmt="%.6g")


NAME = "extended"
RUNS = 100
SCENARIOS = {
    "radar-extended-r8": "the paper's hard-core radius of 8 m, 4.6 targets on average",
    "radar-extended": "hard-core radius 6 m, 9.6 targets on average: closer than the paper's",
}


def pieces(share: float) -> list[Piece]:
    """The runs of both scenarios."""
    runs = range(share_of(RUNS, share))
    return [Piece(one, (run, scenario)) for scenario in SCENARIOS for run in runs]


def write(results: Sequence[tuple[Piece, Any]], folder: Path) -> None:
    """Write the page, a box plot for each scenario, and the map of the bound."""
    parts = []
    for scenario, text in SCENARIOS.items():
        found = [row for p, r in results if p.arguments[1] == scenario for row in r]
        boxes = f"{scenario.removeprefix('radar-')}.svg"
        _draw(scenario, found, folder / boxes)
        parts += [f"## `{scenario}`: {text}", f"![OSPA by epoch and method]({boxes})"]
        parts += [_published(found), tables(found).replace("\n## ", "\n### ")]
    inputs = Inputs(recordings=(simulated("radar-extended-r8", 0),))
    for kind in ("scene", "bound"):
        page.picture(kind, inputs, folder / f"{NAME}-{kind}.svg")
    page.write(
        folder,
        NAME,
        "Extended targets by jump MCMC",
        f"{len({r['run'] for r in found})} of its {RUNS} runs of each scenario, seed {SEED}.",
        INTRODUCTION,
        *parts,
        SCENE,
    )


def _published(found: Sequence[Row]) -> str:
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


def _draw(scenario: str, found: Sequence[Row], path: Path) -> None:
    """OSPA by epoch, as a box for each method."""
    step = Params().epoch
    scores = Scores.join(
        rows(
            (f"{scenario}-s{SEED}-{r['run']:04d}", r["method"], "ospa-gw", ""),
            t,
            r["ospa_gw"],
        )
        for r in found
        if r["method"] in METHODS
        for t in [step * r["epoch"]]
    )
    page.picture("box", Inputs(scores=scores, pooled=pool(scores)), path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--scenario", default="radar-extended")
    parser.add_argument("-o", "--output", type=Path, default=Path("gsncp"))
    given = parser.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    start = time.perf_counter()
    with ProcessPoolExecutor(given.jobs) as pool:
        work = pool.map(partial(one, scenario=given.scenario), range(given.runs))
        rows = [row for result in work for row in result]
    with open(given.output / "gsncp.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    text = tables(rows)
    (given.output / "gsncp.md").write_text(f"# {given.scenario}, {given.runs} runs\n{text}")
    bound(given.output / "gsncp-bound.csv")
    print(text)
    print(f"{time.perf_counter() - start:.0f} s on {given.jobs} processes")


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

if __name__ == "__main__":
    main()

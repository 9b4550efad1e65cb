"""The device on a measured recording as a table: ``python -m papers.labyrinth``.

The Labyrinth Dataset (Tim Pfeifer, TU Chemnitz), from ``$ECHOSET_DATA`` or ``../shared/data``: a
robot with UWB two-way ranging to four anchors, one range at a time, and wheel odometry. Root mean
square error over all but the first ranges and over seeds, ± standard error by a bootstrap over
blocks of ranges.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import echoset
from echoset.models.registry import load

ROOT = Path(os.environ.get("ECHOSET_DATA", Path(__file__).parents[3] / "shared" / "data"))
DATA = ROOT / "labyrinth"
SEEDS, FIRST, BLOCKS, RESAMPLES = 10, 4, 15, 400
WITH = "with the wheels"
ROWS: dict[str, dict[str, Any]] = {
    "all defaults: what ranges have too much, and which are late, is learnt": {},
    "the same, smoothed: `--smooth`": {"smooth": "whole"},
    "ranges taken as calibrated, `--set range_bias_std=0 --set learn=[]`": {
        "range_bias_std": 0.0,
        "learn": [],
    },
}


def rmse(
    settings: Mapping[str, Any], estimator: str = "position", wheels: bool = False
) -> tuple[float, float]:
    """RMSE [m] of an estimator over all but the first ranges, and its standard error."""
    importer = load("echoset.importers", "labyrinth")
    recording = importer.read([DATA], importer.Params())
    if not wheels:
        recording = replace(recording, streams={"uwb": recording.streams["uwb"]})
    o = recording.truth.objects
    square = []
    for seed in range(1, SEEDS + 1 if estimator == "position" else 2):
        found = echoset.estimate(recording, estimator, seed, **settings).objects
        m, t = found.columns("device_x", "device_y"), found.time_ns
        truth = [np.interp(t, o.time_ns, x) for x in o.columns("device_x", "device_y").T]
        square.append(((m - np.stack(truth, 1)) ** 2).sum(1)[FIRST:])
    blocks = np.array_split(np.mean(square, axis=0), BLOCKS)
    rng = np.random.default_rng(0)
    means = [
        np.sqrt(np.concatenate([blocks[k] for k in rng.integers(0, BLOCKS, BLOCKS)]).mean())
        for _ in range(RESAMPLES)
    ]
    return float(np.sqrt(np.mean(square))), float(np.std(means))


def main() -> None:
    """Print the table."""
    print(f"| `position`, {SEEDS} seeds | device [m] |\n|---|---:|")
    for name, settings in ROWS.items():
        value, error = rmse(settings)
        print(f"| {name} | {value:.3f} ± {error:.3f} |", flush=True)
    for estimator, wheels in (("position", True), ("range-ls", False), ("range-ls", True)):
        value, error = rmse({}, estimator, wheels)
        name = f"`{estimator}`{', ' + WITH if wheels else ''}"
        print(f"| {name} | {value:.3f} ± {error:.3f} |", flush=True)


if __name__ == "__main__":
    main()

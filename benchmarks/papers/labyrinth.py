"""The device on a measured recording as a table: ``python -m papers.labyrinth``.

The Labyrinth Dataset (Tim Pfeifer, TU Chemnitz), from ``$ECHOSET_DATA`` or ``../shared/data``: a
robot with UWB two-way ranging to four anchors, one range at a time. Root mean square error over all
but the first ranges and over seeds, ± standard error by a bootstrap over blocks of ranges.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

import echoset
from echoset.models.registry import load

ROOT = Path(os.environ.get("ECHOSET_DATA", Path(__file__).parents[3] / "shared" / "data"))
DATA = ROOT / "labyrinth"
SEEDS, FIRST, BLOCKS, RESAMPLES = 10, 4, 15, 400
ROWS: dict[str, dict[str, Any]] = {
    "all defaults: what ranges have too much, and which are late, is learnt": {},
    "ranges taken as calibrated, `--set range_bias_std=0 --set learn=[]`": {
        "range_bias_std": 0.0,
        "learn": [],
    },
}


def rmse(settings: Mapping[str, Any]) -> tuple[float, float]:
    """RMSE [m] of ``position`` over all but the first ranges, and its standard error."""
    importer = load("echoset.importers", "labyrinth")
    recording = importer.read([DATA], importer.Params())
    o = recording.truth.objects
    square = []
    for seed in range(1, SEEDS + 1):
        found = echoset.estimate(recording, "position", seed, **settings).objects
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


if __name__ == "__main__":
    main()

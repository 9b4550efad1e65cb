"""Tables of scores take little memory: they are read line by line and held as columns."""

from __future__ import annotations

import tracemalloc

import numpy as np

from echoset.campaign.pictures import pooled
from echoset.formats import scores as archive
from echoset.metrics.kit.table import rows
from echoset.models.records import Scores
from echoset.report import gaps, plots

RUNS, STEPS = 2, 10_000


def test_bytes_of_a_row(tmp_path):
    """A row is 60 characters and four numbers; 252,000 of them are to fit into 200 MB."""
    rng = np.random.default_rng(1)
    time = np.arange(STEPS) / 10
    tables = [
        rows((f"s-s1-{run:04d}", "phd", "ospa", part), time, rng.random(STEPS))
        for run in range(RUNS)
        for part in ("", "localisation")
    ]
    path = tmp_path / "scores.csv"
    archive.write(Scores.join(tables), path, "csv")
    del tables
    pooled(archive.read(path).take(np.arange(10)))
    tracemalloc.start()
    found = archive.read(path)
    read = tracemalloc.get_traced_memory()[1]
    tracemalloc.reset_peak()
    pool = pooled(found)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(pool) == 2 * STEPS
    # A block of 16,384 rows on its way costs some 600 bytes a row, resamples of 512 columns 40 MB.
    assert read < 100 * len(found) + 600 * (1 << 14)
    assert peak < 200 * len(found) + 40e6


def test_bytes_of_a_row_in_pictures_and_gaps():
    time = np.arange(STEPS) / 10
    keys = [("s-s1-0000", name, "rmse", "device") for name in ("geo", "ideal")]
    keys += [("s-s1-0000", "", "pcrlb", "device")]
    scores = Scores.join([rows(key, time, 0.1 + time / 1e4, stderr=0.01) for key in keys])
    found = plots.Inputs(scores=scores, pooled=pooled(scores))
    kinds = ("box", "rmse")
    for kind in kinds:
        few = scores.take(np.arange(10))
        plots.figure(kind, plots.Inputs(scores=few, pooled=pooled(few)))
    tracemalloc.start()
    gaps(scores)
    for kind in kinds:
        plots.figure(kind, found)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 150 * len(scores) + 5e6

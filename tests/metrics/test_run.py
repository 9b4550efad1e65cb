"""A metric is run and pooled in one way, whoever asks."""

from __future__ import annotations

import json
from dataclasses import make_dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from support.sets import scene

import echoset
from echoset import formats
from echoset.cli.main import main
from echoset.formats import scores as archive
from echoset.metrics import protocol
from echoset.metrics.kit.table import rows
from echoset.models import registry
from echoset.models.parameters import parameter
from echoset.models.records import Estimates, Meta, Recording, Sensor, Stream

BOUNDS = ("pcrlb", "pcrlb-star")
NAMES = registry.names("echoset.metrics")
ALONE = ("rmse", "cdf", "nees")
"""Metrics of one object."""


def told(name: str, run: int) -> Estimates:
    """Estimates with their recording, unlike those of other runs, that the metric takes."""
    estimates, recording = scene(name in ALONE, 4 + run, f"a-s1-{run:04d}")
    if name == "capacity":
        axes = {"range_axis": np.arange(3.0), "azimuth_axis": np.arange(2.0)}
        empty = np.zeros(0, np.int64), np.zeros(1, np.int64), {"map": np.zeros((0, 3, 2), "f4")}, {}
        streams = {f"B{i}": Stream("range_angle_map", ("B",), axes, *empty) for i in range(run + 2)}
        sensors = {"B": Sensor.static("radar", np.zeros(2))}
        recording = replace(recording, sensors=sensors, streams=streams)
        provenance = {"estimator": "e", "parameters": {"stations": run + 1}}
        estimates = replace(estimates, meta=replace(estimates.meta, provenance=provenance))
    return replace(estimates, recording=recording)


def bounded(network: Recording, run: int) -> Estimates:
    """The network with an estimate, its object elsewhere in each run."""
    objects = network.truth.objects
    truth = replace(objects, state=objects.state + 0.3 * run)
    meta = Meta(f"a-s1-{run:04d}", provenance={"estimator": "e"})
    recording = replace(network, meta=meta, truth=replace(network.truth, objects=truth))
    return Estimates(
        meta, replace(truth, extent_kind="", semi_axes=None, rotation=None), {}, recording
    )


def table(path: Path) -> dict[tuple[str, str, str], float]:
    """What is said of all recordings together, by estimator, metric and part."""
    scores = archive.read(path)
    names = zip(scores.recording, scores.estimator, scores.metric, scores.part, strict=True)
    values = zip(names, scores.time.tolist(), scores.value.tolist(), strict=True)
    return {n[1:]: v for n, time, v in values if n[0] == "*" and np.isnan(time)}


@pytest.mark.parametrize("name", NAMES)
def test_report_pools_as_score_does(name, network, tmp_path):
    files = []
    for run in range(3):
        made = bounded(network, run) if name in BOUNDS else told(name, run)
        files.append(tmp_path / f"{run}.h5")
        formats.write(made, files[-1], "h5")
    words = ["score", *files, "-m", name, "--segments", "0:20"]
    single, pooled, report = (tmp_path / f for f in ("single.csv", "pooled.csv", "report.json"))
    assert main([*map(str, words), "-o", str(single)]) == 0
    assert main([*map(str, words), "--pool", "-o", str(pooled)]) == 0
    by = ("--by", "estimator,metric,part", "-o", str(report))
    assert main(["report", str(single), *by]) == 0
    expected = table(pooled)
    (found,) = json.loads(report.read_text())["tables"]
    cells = {tuple(row[:3]): row[3]["value"] for row in found["rows"]}
    for (estimator, metric, part), value in expected.items():
        if not estimator and metric.endswith("-valid"):
            continue
        if not estimator:
            bound = metric.removesuffix("-mean")
            estimator, metric = bound, metric.replace(bound, "rmse", 1)
        assert cells[estimator, metric, part] == value, (metric, part)
    assert len(cells) == sum(bool(e) or not m.endswith("-valid") for e, m, _ in expected)


@pytest.mark.parametrize("name", NAMES)
def test_function_gives_the_scores_of_the_command(name, network, tmp_path):
    made = bounded(network, 1) if name in BOUNDS else told(name, 1)
    formats.write(made, tmp_path / "e.h5", "h5")
    out = tmp_path / "scores.h5"
    skip = {} if name == "capacity" else {"skip": 1}
    settings = [f"--set={name}.{key}={value}" for key, value in skip.items()]
    words = ("score", tmp_path / "e.h5", "-m", name, *settings, "-o", out)
    assert main([*map(str, words)]) == 0
    read = formats.read(tmp_path / "e.h5")
    found, expected = echoset.score(read, read.recording, name, **skip), archive.read(out)
    for column in archive.COLUMNS:
        same = np.array(getattr(found, column)), np.array(getattr(expected, column))
        np.testing.assert_array_equal(*same)
    assert found.provenance == expected.provenance


def test_plain_module_is_a_metric(monkeypatch):
    def score(estimates, recording, params):
        return rows(("r", "e", "plain", ""), np.nan, params.offset)

    params = make_dataclass("Params", [("offset", float, parameter(2.0, "m", "added"))])
    module = SimpleNamespace(SUMMARY="a plain one", Params=params, score=score)
    load = registry.load
    monkeypatch.setattr(registry, "load", lambda g, n: module if n == "plain" else load(g, n))
    metric = protocol.load("plain")
    assert (metric.PARTS, metric.STREAMS, metric.FOR_SETS, metric.QUADRATIC) == ((), (), False, ())
    estimates, recording = scene(True)
    assert echoset.score(estimates, recording, "plain", offset=3.0).value.tolist() == [3.0]

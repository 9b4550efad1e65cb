"""A metric is run and pooled in one way, whoever asks."""

from __future__ import annotations

import json
from dataclasses import make_dataclass, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from support.sets import SECOND, scene, some

import echoset
from echoset import formats
from echoset.cli.main import main
from echoset.formats import scores as archive
from echoset.metrics import protocol
from echoset.metrics.kit.table import rows
from echoset.models import registry
from echoset.models.errors import InputError
from echoset.models.parameters import parameter
from echoset.models.records import Estimates, Meta, Objects, Recording, Sensor, Stream, Truth

BOUNDS = ("pcrlb", "pcrlb-star", "pcrlb-smooth")
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
    if name == "class-log-loss":
        estimates = replace(estimates, objects=classed(estimates.objects))
        truth = classed(recording.truth.objects)
        recording = replace(recording, truth=replace(recording.truth, objects=truth))
    return replace(estimates, recording=recording)


def classed(objects: Objects) -> Objects:
    """The objects, of two classes in turn, the second of which is the likelier."""
    index = np.arange(len(objects.label), dtype=np.int32) % 2
    sure = np.tile([0.4, 0.6], (len(index), 1))
    return replace(objects, class_names=("a", "b"), class_index=index, class_probability=sure)


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


def test_number_of_steps_that_count_is_told(tmp_path, capsys):
    """A reference of every 10 s, known at 100 s of 400."""
    times = np.arange(400) * SECOND
    rng = np.random.default_rng(3)
    estimates = Estimates(Meta("r", provenance={"estimator": "e"}), some(rng, times, 1, True), {})
    truth = Truth(some(rng, times[100:201:10], 1, True))
    estimates = replace(estimates, recording=Recording(Meta("r"), {}, {}, truth))
    formats.write(estimates, tmp_path / "e.h5", "h5")
    for metric in ("rmse", "gospa"):
        words = ("score", tmp_path / "e.h5", "-m", metric, "-o", tmp_path / f"{metric}.csv")
        assert main([*map(str, words)]) == 0
        (line,) = capsys.readouterr().err.splitlines()
        assert f"{metric} is of 101 of 400 steps" in line
        found = archive.read(tmp_path / f"{metric}.csv").where(metric=f"{metric}-left-out")
        assert (found.value.tolist(), found.n.tolist()) == ([299.0], [400])


def few(run: int, objects: int) -> Estimates:
    """Estimates of ten steps of so many objects, all right but one that is 3 m off."""
    label = np.tile(np.arange(objects), 10)
    state = np.stack((100.0 * label, np.repeat(np.arange(10.0), objects)), 1)
    time, offset = np.arange(10) * SECOND, np.arange(11) * objects
    truth = Objects(time, offset, label, ("x", "y"), ("m", "m"), state)
    moved = replace(truth, state=state + 3.0 * (label[:, None] == 0) * [1, 0])
    meta = Meta(f"a-s1-{run:04d}", provenance={"estimator": "e"})
    return Estimates(meta, moved, {}, Recording(meta, {}, {}, Truth(truth)))


def test_metrics_are_chosen_once_for_a_campaign(tmp_path, capsys):
    """One object in the first two of four runs, four in the others: GOSPA is of all."""
    files = [tmp_path / f"{run}.h5" for run in range(4)]
    for run, path in enumerate(files):
        formats.write(few(run, 1 if run < 2 else 4), path, "h5")
    out = tmp_path / "scores.csv"
    assert main(["score", *map(str, files), "--pool", "-o", str(out)]) == 0
    found = archive.read(out).where(recording="*", timed=False)
    (gospa,) = (i for i, m in enumerate(found.metric) if m == "gospa" and not found.part[i])
    assert (found.value[gospa], found.n[gospa]) == (pytest.approx(3.0), 4)
    assert found.where(metric="completeness").value.tolist() == [1.0]
    assert "rmse" not in set(found.metric)
    (told,) = (line for line in capsys.readouterr().err.splitlines() if "without rmse" in line)
    assert "does not apply to all files" in told and "several objects" in told
    assert main(["score", *map(str, files[:2]), "-o", str(tmp_path / "two.csv")]) == 0
    two = archive.read(tmp_path / "two.csv")
    assert "rmse" in set(two.metric) and "gospa" not in set(two.metric)


@pytest.mark.parametrize(
    ("gate", "hint"),
    [
        ("gospa > 1", "ask for it by -m gospa"),
        ("gospa-rms:missed > 1", "ask for it by -m gospa"),
        ("ospa-gw > 1", "ask for it by -m ospa-gw"),
        ("completeness < 1", "ask for it by -m siap"),
        ("rmse-mean:centre > 1", "ask for it by --pool"),
        ("rmse:centre@1:2 > 1", "ask for them by --segments"),
        ("rmse:center > 1", "did you mean 'rmse:centre'"),
    ],
)
def test_gate_on_what_was_not_computed_tells_how(gate, hint, tmp_path, capsys):
    formats.write(few(0, 1), tmp_path / "e.h5", "h5")
    words = ("score", tmp_path / "e.h5", "-m", "rmse", "--fail-if", gate, "-o", tmp_path / "s.csv")
    assert main([*map(str, words)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert gate in line and hint in line
    assert not (tmp_path / "s.csv").exists()


def huge(made: Estimates, size: float) -> tuple[Estimates, Recording]:
    """The estimates and their recording with all coordinates of one object at ``size`` [m]."""

    def moved(objects: Objects) -> Objects:
        state = objects.state.copy()
        state[0] = size
        return replace(objects, state=state)

    beside = made.recording
    truth = replace(beside.truth, objects=moved(beside.truth.objects))
    far = replace(beside, truth=truth)
    return replace(made, objects=moved(made.objects), recording=far), far


@pytest.mark.parametrize("size", [1e80, 1e160, 1e308])
@pytest.mark.parametrize("name", NAMES)
def test_numbers_beyond_reach_are_refused_or_scored(name, size, network):
    """No error of arithmetic, and nothing that is not a number where there is one."""
    made = bounded(network, 1) if name in BOUNDS else told(name, 1)
    plain = echoset.score(made, made.recording, name)
    try:
        found = echoset.score(*huge(made, size), name)
    except InputError as error:
        assert name in str(error)
        return
    assert not np.isinf(found.value).any()
    assert np.isnan(found.value).sum() <= np.isnan(plain.value).sum()

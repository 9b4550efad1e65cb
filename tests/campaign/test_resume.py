"""What ``--skip-existing`` leaves, makes and makes again, and what ``--dry-run`` says of it."""

from __future__ import annotations

import hashlib
import os
import shutil
from dataclasses import replace
from fcntl import LOCK_EX, flock
from pathlib import Path

import h5py
import map_scene
import numpy as np
import pytest

from echoset import formats
from echoset.campaign.estimate import Task
from echoset.campaign.files.outputs import Existing, plan
from echoset.estimators.run import Estimation
from echoset.formats import provenance, weights
from echoset.models.errors import FormatError, OutputError
from echoset.models.records import Recording


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def actions(out: str) -> list[str]:
    return [line.split()[0] for line in out.splitlines()]


@pytest.fixture(params=["h5", "mcap"])
def form(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture
def inputs(campaign: Path, tmp_path: Path, form: str) -> list[Path]:
    """Three recordings, to be changed at will."""
    files = []
    for path in sorted(campaign.iterdir()):
        files.append(tmp_path / f"{path.stem}.{form}")
        formats.write(formats.read(path), files[-1], form)
    return files


@pytest.fixture
def estimate(run, inputs, tmp_path, form):
    """Estimate the three into ``out/``."""

    def call(*args):
        words = ("-o", f"{tmp_path}/out/", "--format", form, "--skip-existing", *args)
        return run("estimate", "-e", "mean", *inputs, *words)

    return call


def test_complete_outputs_are_left(estimate, tmp_path):
    plan = estimate("--dry-run")
    assert plan.code == 0 and actions(plan.out) == ["run"] * 3 and not (tmp_path / "out").exists()
    assert estimate() == (0, "", "")
    before = {path: path.stat().st_ino for path in (tmp_path / "out").iterdir()}
    assert actions(estimate("--dry-run").out) == ["skip"] * 3
    assert estimate("-v").err.count("skipped: is complete") == 3
    assert before == {path: path.stat().st_ino for path in (tmp_path / "out").iterdir()}


@pytest.mark.parametrize("times", [(0, 0), (4e9, 4e9)])
def test_no_clock_is_asked(estimate, inputs, tmp_path, times):
    """Inputs and outputs from long ago or from the future, as after a clock was set back."""
    estimate()
    for path in (*inputs, *(tmp_path / "out").iterdir()):
        os.utime(path, times)
        assert actions(estimate("--dry-run").out) == ["skip"] * 3


@pytest.mark.parametrize(
    ("args", "reason"),
    [
        (("--seed", "2"), "seed was 1, is 2"),
        (("--set", "offset=1"), "parameters.offset was 0.0, is 1.0"),
        (("--set", "pair=[1, 2]"), "parameters.pair was"),
    ],
)
def test_other_parameters_redo(estimate, run, tmp_path, args, reason):
    estimate()
    plan = estimate("--dry-run", *args)
    assert actions(plan.out) == ["redo"] * 3 and plan.out.count(reason) == 3
    assert estimate(*args) == (0, "", "")
    found = contents(tmp_path / "out")
    shutil.rmtree(tmp_path / "out")
    assert estimate(*args) == (0, "", "")
    assert contents(tmp_path / "out") == found


def test_other_versions_redo(estimate, monkeypatch):
    estimate()
    changed = {**provenance.versions(), "numpy": "0.1"}
    monkeypatch.setattr("echoset.campaign.estimate.versions", lambda: changed)
    assert estimate("--dry-run").out.count("versions.numpy was ") == 3


def test_another_input_redoes_its_output_only(estimate, inputs, form):
    estimate()
    record = formats.read(inputs[1])
    assert isinstance(record, Recording)
    uwb = record.streams["uwb"]
    rows = {**uwb.rows, "distance": uwb.rows["distance"] + 0.1}
    changed = replace(record, streams={"uwb": replace(uwb, rows=rows)})
    formats.write(changed, inputs[1], form)
    plan = estimate("--dry-run")
    assert actions(plan.out) == ["skip", "redo", "skip"] and "input.digest was" in plan.out
    formats.write(record.observed(), inputs[1], form)
    assert actions(estimate("--dry-run").out) == ["skip"] * 3


def test_output_of_a_worker_that_was_lost_after_it_had_written(run, rec, tmp_path):
    """It was not there when the run began: what is there now is its own, or a stranger's."""
    path = tmp_path / "est.h5"
    target = plan(str(path), ["est"], None, Existing())[0]
    task = Task(str(rec), target, Estimation("mean"))
    assert task.decide().action == "run"
    assert run("estimate", "-e", "mean", rec, "-o", path).code == 0
    assert task.decide().action == "skip"
    with pytest.raises(OutputError, match="exists already"):
        replace(task, asked=Estimation("mean", seed=2)).decide()


def test_truth_counts_for_the_oracle(run, tmp_path):
    rec, est = tmp_path / "rec.h5", tmp_path / "est.h5"
    assert run("simulate", "radar-extended", "-o", rec).code == 0
    words = ("estimate", "-e", "oracle", rec, "-o", est, "--skip-existing")
    assert run(*words).code == 0 and actions(run(*words, "--dry-run").out) == ["skip"]
    record = formats.read(rec)
    moved = replace(record.truth.objects, state=record.truth.objects.state + 0.1)
    formats.write(replace(record, truth=replace(record.truth, objects=moved)), rec, "h5")
    assert "input.content_digest was" in run(*words, "--dry-run").out
    record = formats.read(rec)
    assert formats.content_digest(record) == formats.header(rec)["content_digest"]


@pytest.mark.parametrize("damage", ["cut", "empty", "text", "longer"])
def test_incomplete_outputs_are_made_again(estimate, tmp_path, damage):
    estimate()
    whole = contents(tmp_path / "out")
    path = sorted((tmp_path / "out").iterdir())[1]
    data = path.read_bytes()
    spoilt = {"cut": data[:-1], "empty": b"", "text": b"mine", "longer": data + b"\0"}
    path.write_bytes(spoilt[damage])
    assert actions(estimate("--dry-run").out) == ["skip", "redo", "skip"]
    assert path.read_bytes() == spoilt[damage]
    assert estimate() == (0, "", "") and contents(tmp_path / "out") == whole


def test_times_of_a_resumed_campaign(estimate, inputs, tmp_path):
    times = tmp_path / "times.csv"
    assert estimate("--timing", times).code == 0
    before = times.read_bytes()
    assert estimate("--timing", times).code == 0 and times.read_bytes() == before
    (tmp_path / "out" / f"{inputs[0].stem}.mean{inputs[0].suffix}").unlink()
    assert estimate("--timing", times).code == 5 and times.read_bytes() == before
    assert len(contents(tmp_path / "out")) == 3


def test_output_that_failed_again_stays(estimate, inputs, tmp_path):
    estimate()
    whole = contents(tmp_path / "out")
    assert estimate("--seed", "2", "--set", "fail_at=2").code == 7
    assert contents(tmp_path / "out") == whole
    inputs[0].write_bytes(b"")
    result = estimate("--keep-going")
    assert result.code == 4 and inputs[0].name in result.err and contents(tmp_path / "out") == whole


def test_other_format_redoes(run, campaign, tmp_path):
    rec, est = sorted(campaign.iterdir())[0], tmp_path / "est.h5"
    words = ("estimate", "-e", "mean", rec, "-o", est, "--skip-existing")
    assert run(*words, "--format", "mcap").code == 0
    assert "format was mcap, is h5" in run(*words, "--format", "h5", "--dry-run").out


def test_recordings_are_resumed(run, tmp_path, form):
    words = ("simulate", "uwb-los", "--runs", 3, "-o", f"{tmp_path}/", "--skip-existing")
    words = (*words, "--format", form, "--set")
    assert run(*words, "steps=5").code == 0
    assert actions(run(*words, "steps=5", "--dry-run").out) == ["skip"] * 3
    assert run(*words, "steps=6", "--dry-run").out.count("parameters.steps was 5, is 6") == 3
    first = tmp_path / f"uwb-los-s1-0000.{form}"
    shutil.copy(tmp_path / f"uwb-los-s1-0001.{form}", first)
    assert actions(run(*words, "steps=5", "--dry-run").out) == ["redo", "skip", "skip"]


def test_converted_files_are_resumed(run, campaign, tmp_path):
    files = sorted(campaign.iterdir())
    words = ("convert", *files, "--format", "mcap", "-o", f"{tmp_path}/", "--skip-existing")
    assert run(*words).code == 0 and actions(run(*words, "--dry-run").out) == ["skip"] * 3
    shutil.copy(tmp_path / f"{files[0].stem}.mcap", tmp_path / f"{files[1].stem}.mcap")
    assert actions(run(*words, "--dry-run").out) == ["skip", "redo", "skip"]


def test_dry_run_says_what_would_fail(run, campaign, tmp_path):
    rec, est = sorted(campaign.iterdir())[0], tmp_path / "est.h5"
    words = ("estimate", "-e", "mean", rec, "-o", est, "--dry-run")
    assert run(*words).out == f"run {est}: is missing\n"
    est.write_text("mine")
    assert run(*words).code == 5
    assert run(*words, "--overwrite").out == f"redo {est}: is overwritten\n"
    summary = tmp_path / "summary.json"
    assert run(*words, "--overwrite", "--summary", summary).code == 0
    assert est.read_text() == "mine" and not summary.exists()


def test_stamp_is_what_the_file_says_without_its_data(inputs, form):
    found = formats.header(inputs[0])
    whole = formats.summary(inputs[0])
    for key in ("name", "observed_digest", "content_digest"):
        assert found[key] == whole[key]
    assert found["provenance"] == formats.read(inputs[0]).meta.provenance
    assert (found["format"], found["scenario"]) == (form, "uwb-los")
    data = bytearray(inputs[0].read_bytes())
    place = len(data) // 3
    if form == "h5":
        with h5py.File(inputs[0]) as file:
            place = file["streams/uwb/rows/distance"].id.get_chunk_info(0).byte_offset + 9
    data[place] ^= 4
    inputs[0].write_bytes(data)
    with pytest.raises(FormatError):
        formats.read(inputs[0])
    assert formats.header(inputs[0]) == found


def test_damage_at_the_end_of_mcap_is_seen(campaign, tmp_path):
    path = tmp_path / "x.mcap"
    formats.write(formats.read(sorted(campaign.iterdir())[0]), path, "mcap")
    data = path.read_bytes()
    for place in range(len(data) - 600, len(data), 7):
        path.write_bytes(data[:place] + bytes([data[place] ^ 4]) + data[place + 1 :])
        with pytest.raises(FormatError):
            formats.header(path)


def test_what_a_killed_run_left_is_removed_and_nothing_else(estimate, inputs, tmp_path, form):
    out = tmp_path / "out"
    out.mkdir()
    name = f"{inputs[0].stem}.mean.{form}"
    stale, live, foreign, other = (
        out / f".{name}.0123456789ab.tmp",
        out / f".{name}.0123456789ac.tmp",
        out / f".{name}.swp.tmp",
        out / f".other.{form}.0123456789ab.tmp",
    )
    for path in (stale, live, foreign, other):
        path.write_text("half")
    with live.open() as held:
        flock(held, LOCK_EX)
        assert actions(estimate("--dry-run").out) == ["run"] * 3 and stale.exists()
        assert estimate().code == 0
    assert [path.exists() for path in (stale, live, foreign, other)] == [False, True, True, True]
    assert estimate().code == 0 and not live.exists()


def test_other_weights_are_other_estimates(run, tmp_path):
    """Their digest stands in the provenance, and their file among the dependencies."""
    rng = np.random.default_rng(1)
    track = np.zeros((2, 1, 2))
    maps = map_scene.recording(track, [map_scene.PEDESTRIAN], 2, rng, np.zeros((0, 9)))
    path, network, out = tmp_path / "maps.h5", tmp_path / "byhand.npz", tmp_path / "out.h5"
    formats.write(maps, path, "h5")
    weights.write(network, map_scene.classifier())
    words = ("estimate", "-e", "phd", "--preset", "tuned", path, "-o", out, "--skip-existing")
    words += ("--set", f"weights={network}", "--deps", tmp_path / "d")
    assert run(*words).code == 0
    digest = hashlib.sha256(network.read_bytes()).hexdigest()
    assert formats.read(out).meta.provenance["files"] == {"weights": digest}
    assert str(network) in (tmp_path / "d").read_text()
    before = out.read_bytes()
    assert run(*words).code == 0 and out.read_bytes() == before
    weights.write(network, map_scene.classifier(area=10.0), overwrite=True)
    assert "files.weights was" in run(*words, "--dry-run").out
    assert run(*words).code == 0 and out.read_bytes() != before

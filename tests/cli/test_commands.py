"""What commands make of good input: equal bytes by every route, and names where they belong."""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from echoset import formats
from echoset.cli.main import COMMANDS, commands
from echoset.models import registry
from echoset.models.records import Recording


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def rows(text: str) -> list[dict[str, str]]:
    lines = [line for line in text.splitlines(keepends=True) if not line.startswith("#")]
    return list(csv.DictReader(io.StringIO("".join(lines))))


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_and_option_has_help(name):
    command = commands.get_command(None, name)
    assert command.help and not command.get_short_help_str(80).endswith("...")
    for option in command.params:
        assert option.param_type_name == "argument" or option.help, option.name
    result = CliRunner().invoke(commands, [name, "--help"])
    assert result.exit_code == 0 and result.output.startswith("Usage: ")


def test_start_up_imports_nothing_heavy(command):
    heavy = "numpy", "scipy", "h5py", "numba", "mcap", "yaml", "tqdm"
    code = "import sys; from echoset.cli.main import main; main(['--help'])"
    code += f"; print(sys.modules.keys() & {set(heavy)}, file=sys.stderr)"
    start = time.perf_counter()
    result = subprocess.run([command[0], "-c", code], capture_output=True, check=True)
    assert result.stderr == b"set()\n"
    assert time.perf_counter() - start < 1.5


def test_version(run):
    assert run("--version") == (0, "echoset 0.1.0\n", "")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion(run, shell):
    result = run("completion", shell)
    assert result.code == 0 and "_ECHOSET_COMPLETE" in result.out


def test_names_are_completed(command):
    environment = {**os.environ, "_ECHOSET_COMPLETE": "bash_complete"}
    environment |= {"COMP_WORDS": "echoset estimate -e mea", "COMP_CWORD": "3"}
    result = subprocess.run(command, env=environment, capture_output=True, check=True)
    assert result.stdout == b"plain,mean\n"


def test_recordings_are_the_same_in_any_part_and_number_of_processes(run, campaign, tmp_path):
    words = ("simulate", "uwb-los", "--set", "steps=20", "-o")
    assert run(*words, f"{tmp_path}/two/", "--runs", 3, "-j", 2).code == 0
    assert contents(tmp_path / "two") == contents(campaign)
    assert run(*words, tmp_path / "last.h5", "--first-run", 2).code == 0
    assert (tmp_path / "last.h5").read_bytes() == (campaign / "uwb-los-s1-0002.h5").read_bytes()
    assert run(*words, tmp_path / "other.h5", "--seed", 2).code == 0
    first, other = (
        formats.read(p) for p in (campaign / "uwb-los-s1-0000.h5", tmp_path / "other.h5")
    )
    assert other.meta.name == "uwb-los-s2-0000"
    assert len(first.streams["uwb"].rows["distance"]) != len(other.streams["uwb"].rows["distance"])


def test_estimates_are_the_same_in_any_number_of_processes(run, campaign, tmp_path):
    files = sorted(campaign.iterdir())
    for jobs in (1, 2):
        words = ("-o", f"{tmp_path}/{jobs}/", "-j", jobs)
        assert run("estimate", "-e", "mean", *files, *words) == (0, "", "")
    found = contents(tmp_path / "1")
    assert sorted(found) == [f"uwb-los-s1-000{k}.mean.h5" for k in range(3)]
    assert found == contents(tmp_path / "2") and len(set(found.values())) == 3


def test_truth_changes_nothing(run, rec, tmp_path):
    blind = tmp_path / "blind.h5"
    formats.write(formats.read(rec).observed(), blind, "h5")
    for source in (rec, blind):
        assert (
            run("estimate", "-e", "mean", source, "-o", tmp_path / f"{source.stem}.est.h5").code
            == 0
        )
    assert (tmp_path / f"{rec.stem}.est.h5").read_bytes() == (
        tmp_path / "blind.est.h5"
    ).read_bytes()


def test_pipe_gives_the_numbers_of_the_file_route(fork, command, rec, tmp_path):
    est, table = tmp_path / "est.mcap", tmp_path / "scores.csv"
    for words in (
        ("estimate", "-e", "mean", rec, "-o", est),
        ("score", est, "--truth", rec, "-m", "rmse,cdf", "-o", table),
    ):
        assert fork(*words).communicate()[1] == b""
    simulate = subprocess.Popen(
        [*command, "simulate", "uwb-los", "--set", "steps=20", "-o", "-"], stdout=subprocess.PIPE
    )
    estimate = subprocess.Popen(
        [*command, "estimate", "-e", "mean", "-", "-o", "-"],
        stdin=simulate.stdout, stdout=subprocess.PIPE,
    )  # fmt: skip
    simulate.stdout.close()
    score = subprocess.run(
        [*command, "score", "-", "-m", "rmse,cdf", "-o", "-"],
        stdin=estimate.stdout,
        capture_output=True,
        check=True,
    )
    estimate.stdout.close()
    assert (simulate.wait(), estimate.wait()) == (0, 0)
    assert score.stdout == table.read_bytes() and score.stderr == b""


def test_truth_is_found_by_its_digest(run, campaign, rec, tmp_path):
    est = tmp_path / "renamed.h5"
    assert run("estimate", "-e", "mean", rec, "-o", est).code == 0
    (tmp_path / "truth").mkdir()
    (tmp_path / "truth/notes.txt").write_text("not a recording")
    for k, path in enumerate(sorted(campaign.iterdir(), reverse=True)):
        (tmp_path / f"truth/{k}.h5").write_bytes(path.read_bytes())
    direct = run("score", est, "-m", "rmse", "--truth", rec)
    assert (
        direct.code == 0
        and run("score", est, "-m", "rmse", "--truth", tmp_path / "truth") == direct
    )
    wrong = run("score", est, "--truth", campaign / "uwb-los-s1-0001.h5")
    assert wrong.code == 4 and "digests differ" in wrong.err
    alone = run("score", est)
    assert alone.code == 4 and "--truth" in alone.err


def test_keep_going(run, campaign, tmp_path):
    (tmp_path / "bad.h5").write_text("junk")
    files = sorted(campaign.iterdir())
    words = ("estimate", "-e", "mean", files[0], tmp_path / "bad.h5", *files[1:])
    for jobs in (1, 2):
        out = tmp_path / f"all{jobs}"
        result = run(*words, "-o", f"{out}/", "-j", jobs, "--keep-going")
        assert result.code == 4 and "bad.h5" in result.err and "1 of 4 failed" in result.err
        assert len(contents(out)) == 3
    result = run(*words, "-o", f"{tmp_path}/some/")
    assert result.code == 4 and result.err.count("\n") == 1
    assert len(contents(tmp_path / "some")) == 1
    result = run(*words, "-o", f"{tmp_path}/some/", "--keep-going")
    assert result.code == 5 and len(contents(tmp_path / "some")) == 3
    result = run(*words, "-o", f"{tmp_path}/some/", "--keep-going", "--skip-existing")
    assert result.code == 4 and "1 of 4 failed" in result.err and result.err.count("\n") == 2


def test_several_outputs_need_a_folder_and_names_of_their_own(run, campaign, rec, tmp_path):
    files = sorted(campaign.iterdir())
    assert run("estimate", "-e", "mean", *files, "-o", tmp_path / "x.h5").code == 2
    assert run("estimate", "-e", "mean", *files, "-o", "-").code == 2
    result = run("estimate", "-e", "mean", rec, rec, "-o", f"{tmp_path}/")
    assert result.code == 2 and "two outputs" in result.err
    assert run("simulate", "uwb-los", "--runs", 2, "-o", "-").code == 2


def test_binary_data_are_refused_on_a_terminal(run, monkeypatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    result = run("simulate", "uwb-los", "-o", "-")
    assert result.code == 2 and "terminal" in result.err and result.out == ""


def test_precedence_of_parameters(run, rec, tmp_path):
    config = tmp_path / "config.yaml"
    config.write_text("offset: 1e-3\nnoise: 0.2\nmax_range: 30\n")

    def parameters(*args):
        out = tmp_path / "e.h5"
        assert run("estimate", "-e", "mean", rec, "-o", out, "--overwrite", *args).code == 0
        return formats.read(out).meta.provenance["parameters"]

    assert parameters()["max_range"] == 20.0
    found = parameters("--preset", "slow", "--config", config, "--set", "noise=3e-1")
    assert (found["offset"], found["noise"], found["delay"]) == (1e-3, 0.3, 0.05)
    assert found["max_range"] == 30.0
    assert parameters("--ignore-sensor-model", "--set", "max_range=5")["max_range"] == 5.0


@pytest.mark.parametrize(
    "text",
    [
        "a: &x [1]\nb: *x\n",
        "offset: 1\noffset: 2\n",
        "!!python/object/apply:os.system [ls]\n",
        "- 1\n",
        "1: 2\n",
        "offset: [",
        "[" * 10_000,
        "#" * (1 << 20) + "\n#",
    ],
)
def test_hostile_yaml(run, rec, tmp_path, text):
    config = tmp_path / "config.yaml"
    config.write_text(text)
    result = run("estimate", "-e", "mean", rec, "-o", tmp_path / "x.h5", "--config", config)
    assert result.code == 2 and result.err.count("\n") == 1 and "config.yaml" in result.err
    assert not (tmp_path / "x.h5").exists()


def test_timing(run, rec, tmp_path):
    timing = tmp_path / "timing.csv"
    words = ("estimate", "-e", "mean", rec, "--set", "delay=0.01", "--timing", timing)
    assert run(*words, "-o", tmp_path / "e.h5").code == 0
    *steps, mean = rows(timing.read_text())
    assert [float(row["time"]) for row in steps] == [k / 10 for k in range(1, 21)]
    assert all(0.01 < float(row["value"]) < 1 for row in steps)
    average = sum(float(row["value"]) for row in steps) / 20
    assert mean["time"] == "" and float(mean["value"]) == pytest.approx(average)
    assert run(*words, "-o", tmp_path / "f.h5").code == 5


def described(run, name: str, tmp_path: Path) -> Path:
    result = run("describe", name)
    assert result.code == 0
    path = tmp_path / f"{name}.yaml"
    path.write_text(result.out)
    return path


def test_description_of_a_scenario_is_the_scenario(run, tmp_path):
    path = described(run, "uwb-olos", tmp_path)
    assert run("simulate", "uwb-olos", "-o", tmp_path / "a.h5").code == 0
    assert run("simulate", path, "-o", tmp_path / "b.h5").code == 0
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    path.rename(tmp_path / "mine.yaml")
    assert run("simulate", tmp_path / "mine.yaml", "-o", f"{tmp_path}/out/").code == 0
    assert os.listdir(tmp_path / "out") == ["mine-s1-0000.h5"]


@pytest.mark.parametrize("name", ["mean", "eopda-geo"])
def test_description_of_an_estimator_is_its_configuration(run, rec, tmp_path, name):
    path = described(run, name, tmp_path)
    few = () if name == "mean" else ("--set", "particles=100")
    words = ("estimate", "-e", name, rec, *few, "-o")
    assert run(*words, tmp_path / "a.h5").code == 0
    assert run(*words, tmp_path / "b.h5", "--config", path).code == 0
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()
    if name != "mean":
        path.write_text(path.read_text().replace("#max_range: null", "max_range: 5.0"))
        assert run(*words, tmp_path / "c.h5", "--config", path).code == 0
        assert formats.read(tmp_path / "c.h5").meta.provenance["parameters"]["max_range"] == 5


def test_description_of_a_metric_is_its_configuration(run, rec, tmp_path):
    assert run("estimate", "-e", "mean", rec, "-o", tmp_path / "e.h5").code == 0
    words = ("score", tmp_path / "e.h5", "--truth", rec, "-m", "rmse")
    path = described(run, "rmse", tmp_path)
    assert run(*words) == run(*words, "--config", path)
    skipped = run(*words, "--set", "skip=7")
    path.write_text(path.read_text().replace("#skip: 0", "skip: 7"))
    assert run(*words, "--config", path) == skipped
    assert run(*words, "--set", "skip=7") == run(*words, "--set", "rmse.skip=7") != run(*words)


@pytest.fixture
def scored(run, campaign, tmp_path) -> Path:
    files = sorted(campaign.iterdir())
    assert run("estimate", "-e", "mean", *files, "-o", f"{tmp_path}/est/").code == 0
    words = ("--truth", campaign, "-m", "rmse", "--pool", "-o", tmp_path / "scores.csv")
    assert run("score", *sorted((tmp_path / "est").iterdir()), *words).code == 0
    return tmp_path / "scores.csv"


def test_pooled_error_is_the_root_of_the_mean_square(scored):
    found = rows(scored.read_text())
    whole = [r for r in found if (r["metric"], r["part"], r["time"]) == ("rmse", "device", "")]
    single = [float(r["value"]) for r in whole if r["recording"] != "*"]
    (pooled,) = [float(r["value"]) for r in whole if r["recording"] == "*"]
    assert len(single) == 3 and pooled == pytest.approx(np.sqrt(np.mean(np.square(single))))


def test_report(run, scored):
    result = run("report", scored)
    assert result.code == 0 and "| uwb-los | mean | 3 |" in result.out and "\\*" not in result.out
    for form in ("csv", "latex", "html", "json"):
        assert run("report", scored, "--format", form, "--by", "estimator,metric").code == 0
    assert run("report", scored, "--by", "recording").code in (0, 4)
    result = run("report", scored, "--by", "estimatr")
    assert result.code == 2


def test_segments(run, scored, campaign):
    est = sorted((scored.parent / "est").iterdir())
    result = run("score", *est, "--truth", campaign, "-m", "rmse", "--segments", "0.1:1,1.1:2")
    assert {"device@0.1:1", "device@1.1:2"} <= {r["part"] for r in rows(result.out)}


@pytest.mark.parametrize(
    ("gate", "code"),
    [
        ("rmse:device > 1e6", 0),
        ("rmse:device > 1e-6", 6),
        ("rmse>=1e6", 0),
        ("rmse < 1e6", 6),
        ("rmse:devise > 1", 2),
        ("rmse = 1", 2),
        ("rmse > nan", 2),
    ],
)
def test_gate(run, scored, rec, gate, code):
    est, out = sorted((scored.parent / "est").iterdir())[0], scored.parent / "gated.csv"
    result = run("score", est, "--truth", rec, "-m", "rmse", "--fail-if", gate, "-o", out)
    assert result.code == code and out.exists() == (code != 2)
    assert ("gate: " in result.err) == (code == 6)


def test_convert_there_and_back_gives_equal_bytes(run, rec, scored, tmp_path):
    assert run("convert", rec, "-o", tmp_path / "a.mcap").code == 0
    assert run("convert", tmp_path / "a.mcap", "-o", tmp_path / "b.h5").code == 0
    assert (tmp_path / "b.h5").read_bytes() == rec.read_bytes()
    assert run("convert", scored, "-o", tmp_path / "s.h5").code == 0
    assert run("convert", tmp_path / "s.h5", "-o", tmp_path / "s.json").code == 0
    assert run("convert", tmp_path / "s.json", "-o", tmp_path / "s.csv").code == 0
    assert (tmp_path / "s.csv").read_bytes() == scored.read_bytes()
    assert run("convert", rec, "-o", tmp_path / "r.csv").code == 2


def test_import_by_a_mapping(run, tmp_path):
    log, mapping = tmp_path / "log.csv", tmp_path / "mapping.yaml"
    log.write_text("t,id,range\n0.0,A1,150\n0.1,A2,250\n")
    mapping.write_text(
        "kind: uwb\ncolumns: {time: t, anchor: id, distance: {column: range, unit: cm}}\n"
        "anchors: {A1: [0, 0], A2: [4.2, 0]}\n"
    )
    words = ("convert", "--from", "csv", log, "--mapping", mapping, "-o", tmp_path / "log.h5")
    assert run(*words) == (0, "", "")
    record = formats.read(tmp_path / "log.h5")
    assert isinstance(record, Recording)
    assert record.streams["uwb"].rows["distance"].tolist() == [1.5, 2.5]
    assert run("convert", log, "--mapping", mapping, "-o", tmp_path / "x.h5").code == 2


def test_validate(run, rec, scored, tmp_path):
    est = sorted((scored.parent / "est").iterdir())[0]
    assert run("validate", "--strict", rec, est, scored) == (
        0, f"{rec}: ok, recording\n{est}: ok, estimates\n{scored}: ok, scores\n", ""
    )  # fmt: skip
    (tmp_path / "bad.h5").write_bytes(rec.read_bytes()[:-1])
    result = run("validate", tmp_path / "bad.h5", rec)
    assert result.code == 4 and "bad.h5" in result.err and result.out == f"{rec}: ok, recording\n"
    formats.write(formats.read(rec).observed(), tmp_path / "bare.h5", "h5")
    assert run("validate", tmp_path / "bare.h5").code == 0
    assert run("validate", "--strict", tmp_path / "bare.h5").code == 4


def test_info(run, rec, scored):
    result = run("info", rec)
    assert result.code == 0 and "A1 (anchor)" in result.out and "uwb-los-s1-0000" in result.out
    found = json.loads(run("info", "--json", rec).out)
    assert found["observed_digest"] == formats.observed_digest(rec)
    assert found["provenance"]["scenario"] == "uwb-los"
    assert json.loads(run("info", "--json", scored).out)["estimators"] == ["mean"]


def test_list(run):
    result = run("list", "metrics")
    assert [line.split()[0] for line in result.out.splitlines()] == registry.names(
        "echoset.metrics"
    )
    assert "estimators:" in run("list").out


def test_json_lines_on_stderr(run, tmp_path):
    result = run("info", tmp_path / "none.h5", "--log-format", "json")
    entry = json.loads(result.err)
    assert entry["level"] == "error" and "none.h5" in entry["message"] and result.code == 4


def test_quiet_and_verbose(run, rec, tmp_path):
    words = ("estimate", "-e", "mean", rec, "-o", tmp_path / "e.h5", "--skip-existing")
    assert "done in" in run("-v", *words).err
    assert "skipped: is complete" in run("-v", *words).err
    assert "skipped: is complete" in run(*words, "-v").err
    assert run(*words).err == ""

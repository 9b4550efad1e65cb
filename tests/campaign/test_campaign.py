"""Campaigns of many files: workers that die, summaries, locks, lists, rules for make, logs."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import time
from pathlib import Path

import pytest

from echoset.campaign.batch import makefile
from echoset.campaign.files.outputs import Target
from echoset.models.errors import ParameterError


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_task_whose_worker_died_is_tried_again(run, files, tmp_path):
    mark = tmp_path / "mark"
    words = ("estimate", "-e", "deadly", *files, "--set", f"mark={mark}")
    words = (*words, "--set", f"victim={files[1].stem}")
    result = run(*words, "-o", f"{tmp_path}/out/", "-j", 2, "-v")
    assert result.code == 0 and result.err.count("its worker died: tried again") == 1
    assert run(*words, "-o", f"{tmp_path}/calm/") == (0, "", "")
    assert contents(tmp_path / "out") == contents(tmp_path / "calm")


@pytest.mark.parametrize("victim", [0, 2])
def test_task_that_kills_every_worker_fails_alone(run, files, tmp_path, victim):
    name = files[victim].stem
    words = ("estimate", "-e", "deadly", *files, "--set", f"victim={name}", "-j", 2)
    result = run(*words, "-o", f"{tmp_path}/out/", "--keep-going", "--summary", tmp_path / "s")
    assert result.code == 1 and result.err.count("its worker died 3 times") == 1
    assert sorted(contents(tmp_path / "out")) == [
        f"{path.stem}.deadly.h5" for path in files if path.stem != name
    ]
    found = json.loads((tmp_path / "s").read_text())
    assert (found["done"], found["failed"], found["left"]) == (2, 1, 0)
    result = run(*words, "-o", f"{tmp_path}/other/")
    assert result.code == 1 and result.err.count("\n") == 1 and name in result.err


def test_summary(run, files, tmp_path):
    bad, out, summary = tmp_path / "bad.h5", tmp_path / "out", tmp_path / "deep/summary.json"
    bad.write_text("junk")
    words = ("estimate", "-e", "mean", *files[:2], bad, "-o", f"{out}/", "--summary", summary)
    assert run("estimate", "-e", "mean", files[0], "-o", f"{out}/").code == 0
    result = run(*words, "--keep-going", "--skip-existing")
    assert result.code == 4 and "1 of 3 failed: exit code 4 (input unreadable" in result.err
    assert json.loads(summary.read_text()) == {
        "total": 3,
        "done": 1,
        "skipped": 1,
        "failed": 1,
        "left": 0,
        "stopped": None,
        "failures": [
            {
                "input": str(bad),
                "output": f"{out}/bad.mean.h5",
                "exit_code": 4,
                "reason": f"{bad}: byte 0: neither HDF5 nor MCAP",
            }
        ],
    }
    result = run(*words[:3], bad, *files, *words[6:], "--overwrite")
    found = json.loads(summary.read_text())
    assert result.code == 4 and (found["done"], found["left"]) == (0, 3)
    assert found["stopped"] == found["failures"][0]["reason"]


def test_summary_of_many_failures_names_some(run, tmp_path):
    files = [tmp_path / f"{k}.h5" for k in range(8)]
    result = run("estimate", "-e", "mean", *files, "-o", f"{tmp_path}/out/", "--keep-going")
    assert result.code == 4 and "4.h5 and 3 more\n" in result.err


def test_summary_after_a_signal(fork, files, tmp_path):
    process = fork(
        "estimate", "-e", "mean", *files, "-o", f"{tmp_path}/out/", "-j", 2,
        "--set", "delay=10", "--summary", tmp_path / "s",
    )  # fmt: skip
    while not (tmp_path / "out").exists() or not os.listdir(tmp_path / "out"):
        time.sleep(0.05)
    process.send_signal(signal.SIGTERM)
    assert process.communicate(timeout=30)[1] == b"" and process.returncode == 143
    found = json.loads((tmp_path / "s").read_text())
    assert (found["left"], found["stopped"]) == (3, "ended by signal 15")


def test_lock(run, fork, files, tmp_path):
    lock, out = tmp_path / "lock", tmp_path / "out"
    words = ("estimate", "-e", "mean", files[0], "-o", f"{out}/", "--lock", lock)
    holder = fork(*words, "--set", "delay=10")
    while not out.exists():
        time.sleep(0.05)
    result = run(*words)
    assert result.code == 75 and result.err.count("\n") == 1 and "another command" in result.err
    holder.kill()
    holder.communicate()
    assert run(*words) == (0, "", "") and [p.name for p in out.iterdir()] == [
        f"{files[0].stem}.mean.h5"
    ]
    assert run(*words, "--overwrite", "--lock", tmp_path / "none/lock").code == 5


def test_lists_of_inputs(run, fork, files, tmp_path):
    listed = tmp_path / "list.txt"
    listed.write_text("".join(f"{path}\n" for path in files) + "\n")
    words = ("estimate", "-e", "mean", f"@{listed}", "-o", f"{tmp_path}/out/")
    assert run(*words) == (0, "", "") and len(contents(tmp_path / "out")) == 3
    process = fork(*words[:3], "@-", "-o", f"{tmp_path}/piped/", stdin=subprocess.PIPE)
    assert process.communicate(listed.read_bytes(), timeout=60)[1] == b""
    assert contents(tmp_path / "piped") == contents(tmp_path / "out")
    estimates = tmp_path / "estimates.txt"
    estimates.write_text("\n".join(map(str, sorted((tmp_path / "out").iterdir()))))
    result = run("score", f"@{estimates}", "--truth", files[0].parent, "-m", "rmse")
    assert result.code == 0 and all(path.stem in result.out for path in files)
    (tmp_path / "empty.txt").write_text("\n")
    for bad in ("empty.txt", "none.txt"):
        result = run("estimate", "-e", "mean", f"@{tmp_path}/{bad}", "-o", f"{tmp_path}/x/")
        assert result.code == 2 and bad in result.err and result.err.count("\n") == 1


@pytest.mark.parametrize("name", ["a b", "a#b", "$a", "a=b", "a:b", "a%b", "a|b", "[a]*?", "~a"])
def test_rules_are_what_make_reads(tmp_path, name):
    """make finds the output older than the input by the rule, and then not."""
    source, output = tmp_path / f"{name}.in", tmp_path / f"{name}.out"
    (tmp_path / "Makefile").write_text(".SUFFIXES:\ninclude deps\n%.out:\n\t@touch '$@'\n")
    for place in (tmp_path, Path(".")):
        for path in (source, output):
            path.touch()
        os.utime(output, (1e9, 1e9))
        rule = Target(place / output.name, "h5"), [str(place / source.name), None]
        makefile.write(str(tmp_path / "deps"), [rule])
        words = ["make", "--question", "--", str(place / output.name)]
        assert subprocess.run(words, cwd=tmp_path).returncode == 1
        os.utime(output, (4e9, 4e9))
        os.utime(source, (1e9, 1e9))
        assert subprocess.run(words, cwd=tmp_path, stderr=subprocess.DEVNULL).returncode == 0


def test_rules_that_make_cannot_read(run, rec, tmp_path):
    with pytest.raises(ParameterError, match="a;b"):
        makefile.check("deps", [], ["a;b"])
    result = run("estimate", "-e", "mean", rec, "-o", "-", "--deps", tmp_path / "deps")
    assert result.code == 2 and "--deps" in result.err and not (tmp_path / "deps").exists()


def test_rules_of_commands(run, files, tmp_path):
    deps, config = tmp_path / "x.d", tmp_path / "c.yaml"
    config.write_text("noise: 0.2\n")
    out, scores = tmp_path / "out", tmp_path / "s.csv"
    words = ("estimate", "-e", "mean", *files[:2], "-o", f"{out}/", "--config", config)
    assert run(*words, "--deps", deps, "--dry-run").code == 0 and not deps.exists()
    lines = "".join(f"{out}/{p.stem}.mean.h5: {p} {config}\n" for p in files[:2])
    for _ in range(2):
        assert run(*words, "--deps", deps, "--skip-existing").code == 0
        assert deps.read_text() == lines
    est = sorted(out.iterdir())
    words = ("score", *est, "--truth", files[0].parent, "-m", "rmse", "-o", scores)
    assert run(*words, "--deps", deps).code == 0
    assert deps.read_text() == f"{scores}: {' '.join(map(str, [*est, *files[:2]]))}\n"
    scenario = tmp_path / "mine.yaml"
    scenario.write_text("scenario: uwb-los\nparameters: {steps: 5}\n")
    words = ("simulate", scenario, "-o", tmp_path / "r.h5", "--deps", deps)
    assert run(*words).code == 0 and deps.read_text() == f"{tmp_path}/r.h5: {scenario}\n"


def test_log_off_a_terminal_has_times_and_is_quiet(fork, files, tmp_path):
    words = ("estimate", "-e", "mean", *files, "-o", f"{tmp_path}/out/", "-j", 2)
    assert fork(*words).communicate(timeout=60)[1] == b""
    lines = fork(*words, "--skip-existing", "-v").communicate(timeout=60)[1].decode().splitlines()
    form = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ echoset: \S+: skipped: is complete")
    assert len(lines) == 3 and all(map(form.fullmatch, lines))
    error = fork(*words).communicate(timeout=60)[1].decode()
    assert re.match(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ echoset: error: ", error)


def test_cluster_works_on_files(run, rec, tmp_path):
    for source, output in (("-", tmp_path / "x.h5"), (rec, "-")):
        words = ("estimate", "-e", "mean", source, "-o", output, "--cluster", "tcp://127.0.0.1:1")
        result = run(*words)
        assert result.code == 2 and "--cluster works on files" in result.err

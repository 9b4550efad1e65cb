"""Bad input and bad outputs: one line, the right exit code, nothing left behind."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from echoset import formats
from echoset.models.records import Recording, Sensor


def check(result, code, *words):
    assert result.code == code, result
    assert result.err.count("\n") == 1 and result.err.startswith("echoset: error: "), result.err
    assert all(word in result.err for word in words), result.err


@pytest.fixture
def estimate(run, tmp_path, empty):
    """Estimate a file, expecting an error and no output."""

    def call(source, *args, code=4, words=(), estimator="mean"):
        result = run("estimate", "-e", estimator, source, "-o", tmp_path / "out/x.h5", *args)
        check(result, code, *words)
        assert empty()

    return call


def test_missing_file(estimate, tmp_path):
    estimate(tmp_path / "none.h5", words=["none.h5"])


def test_directory(estimate, tmp_path):
    estimate(tmp_path, words=[str(tmp_path)])


@pytest.mark.parametrize("content", [b"", b"time range\n1.0 2.0\n", b"\x89HDF\r\n\x1a\n"])
def test_no_recording(estimate, tmp_path, content):
    (tmp_path / "bad.h5").write_bytes(content)
    estimate(tmp_path / "bad.h5", words=["bad.h5"])


@pytest.mark.parametrize("form", ["h5", "mcap"])
@pytest.mark.parametrize("tenth", range(1, 11))
def test_truncated(estimate, rec, tmp_path, form, tenth):
    path = tmp_path / f"cut.{form}"
    formats.write(formats.read(rec), path, form)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * tenth // 10 - 1])
    estimate(path, words=["cut"])


@pytest.mark.parametrize("form", ["h5", "mcap"])
@pytest.mark.parametrize("place", [0.1, 0.3, 0.5, 0.7, 0.9])
def test_flipped_bit(run, rec, tmp_path, form, place):
    """It is found, or it was in the truth or in no data at all and changes nothing."""
    good, bad = tmp_path / f"good.{form}", tmp_path / f"bad.{form}"
    formats.write(formats.read(rec), good, form)
    data = bytearray(good.read_bytes())
    data[int(len(data) * place)] ^= 4
    bad.write_bytes(data)
    result = run("estimate", "-e", "mean", bad, "-o", tmp_path / "bad.est.h5")
    if result.code:
        check(result, 4, "bad")
        assert not (tmp_path / "bad.est.h5").exists()
    else:
        assert run("estimate", "-e", "mean", good, "-o", tmp_path / "good.est.h5").code == 0
        assert (tmp_path / "bad.est.h5").read_bytes() == (tmp_path / "good.est.h5").read_bytes()


def test_wrong_kind(estimate, rec):
    estimate(rec, estimator="radar", words=["uwb", "range_bearing"])


def test_estimates_in_place_of_a_recording(estimate, run, rec, tmp_path):
    assert run("estimate", "-e", "mean", rec, "-o", tmp_path / "e.h5").code == 0
    estimate(tmp_path / "e.h5", words=["estimates"])


def spoilt(monkeypatch, rec, path, change):
    """A file of the recording with ``change`` made to it, which no writer of ours would write."""
    monkeypatch.setattr(formats.files, "check", lambda record: None)
    formats.write(change(formats.read(rec)), path, "h5")


@pytest.mark.parametrize("value", [np.nan, -1.0])
def test_range_that_is_none(estimate, rec, tmp_path, monkeypatch, value):
    def change(record: Recording) -> Recording:
        uwb = record.streams["uwb"]
        distance = uwb.rows["distance"].copy()
        distance[7] = value
        return replace(
            record, streams={"uwb": replace(uwb, rows={**uwb.rows, "distance": distance})}
        )

    spoilt(monkeypatch, rec, tmp_path / "spoilt.h5", change)
    estimate(tmp_path / "spoilt.h5", words=["distance[7]"])


def test_anchors_missing(estimate, rec, tmp_path, monkeypatch):
    def change(record: Recording) -> Recording:
        return replace(record, sensors=dict.fromkeys(record.sensors, Sensor.device()))

    spoilt(monkeypatch, rec, tmp_path / "spoilt.h5", change)
    estimate(tmp_path / "spoilt.h5", words=["anchors missing"])


@pytest.mark.parametrize(
    ("args", "words"),
    [
        (("--set", "ofset=1"), ["'ofset'", "did you mean 'offset'"]),
        (("--set", "noise=-1"), ["noise must be at least 0", "-1.0"]),
        (("--set", "noise=much"), ["noise", "'much'"]),
        (("--set", "noise"), ["NAME=VALUE"]),
        (("--set", "noise=[1"), ["--set noise=[1"]),
        (("--preset", "slwo"), ["did you mean 'slow'"]),
        (("--config", "none.yaml"), ["none.yaml"]),
        (("--keep",), ["--keep"]),
        (("--smooth",), ["no way back", "--smooth"]),
        (("--format", "h6"), ["'h6'"]),
        (("--overwrite", "--skip-existing"), ["exclude"]),
        (("-j", "0"), ["0"]),
        (("--sede", "1"), ["--sede"]),
    ],
)
def test_wrong_usage(estimate, rec, args, words):
    estimate(rec, *args, code=2, words=words)


def test_unknown_names(run, rec):
    check(run("estimate", "-e", "maen", rec, "-o", "x.h5"), 2, "did you mean 'mean'")
    check(run("simulate", "uwb-olso", "-o", "x.h5"), 2, "did you mean 'uwb-olos'")
    check(run("score", rec, "-m", "rsme", "-o", "x.csv"), 2, "did you mean 'rmse'")
    check(run("estimat"), 2, "did you mean 'estimate'")


@pytest.mark.parametrize("command", ["simulate", "estimate", "convert", "plot", "train-classifier"])
def test_output_that_nobody_named(run, rec, command):
    words = {"simulate": ["uwb-los"], "estimate": ["-e", "mean", rec], "convert": [rec, "x.h5"]}
    words |= {"plot": ["scene", rec], "train-classifier": []}
    check(run(command, *words[command]), 2, "Missing option '-o'")


def test_parameter_that_only_the_recording_gives(estimate, rec):
    estimate(rec, "--ignore-sensor-model", words=["'max_range'"])


def test_estimate_that_is_not_finite(estimate, rec):
    estimate(rec, "--set", "fail_at=3", code=7, words=["step 3", "not finite"])


def test_existing_output_stays(run, rec, tmp_path):
    path = tmp_path / "x.h5"
    path.write_text("mine")
    check(run("estimate", "-e", "mean", rec, "-o", path), 5, "exists already")
    assert path.read_text() == "mine" and os.listdir(tmp_path) == ["x.h5"]
    assert run("estimate", "-e", "mean", rec, "-o", path, "--overwrite").code == 0
    assert formats.read(path).estimator == "mean"


def test_failed_overwrite_leaves_the_old_file(run, rec, tmp_path):
    path = tmp_path / "x.h5"
    path.write_text("mine")
    assert (
        run("estimate", "-e", "mean", rec, "-o", path, "--overwrite", "--set", "fail_at=9")[0] == 7
    )
    assert path.read_text() == "mine" and os.listdir(tmp_path) == ["x.h5"]


@pytest.mark.parametrize("form", ["h5", "mcap"])
def test_unwritable_folder(run, rec, tmp_path, form):
    (tmp_path / "file").write_text("")
    check(run("estimate", "-e", "mean", rec, "-o", tmp_path / f"file/x.{form}"), 5)
    check(run("estimate", "-e", "mean", rec, "-o", f"/proc/x.{form}"), 5)


def test_special_file_is_not_replaced(run):
    check(run("simulate", "uwb-los", "--format", "h5", "-o", "/dev/null", "--overwrite"), 5)


@pytest.mark.parametrize("form", ["h5", "mcap"])
@pytest.mark.parametrize("limit", [0, 4096, 100_000])
def test_full_disk(fork, tmp_path, form, limit):
    """A limit on the size of files stops writing in the middle, as a full disk does."""
    process = fork(
        "simulate", "uwb-los", "-o", tmp_path / f"x.{form}",
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )  # fmt: skip
    error = process.communicate(timeout=60)[1].decode()
    assert process.returncode == 5 and error.count("\n") == 1, error
    assert "cannot be written" in error and not os.listdir(tmp_path)


@pytest.mark.parametrize("form", ["h5", "mcap"])
def test_full_disk_while_estimating(fork, rec, tmp_path, form):
    process = fork(
        "estimate", "-e", "mean", rec, "-o", tmp_path / f"x.{form}",
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096)),
    )  # fmt: skip
    error = process.communicate(timeout=60)[1].decode()
    assert process.returncode == 5 and error.count("\n") == 1, error
    assert not os.listdir(tmp_path)


def test_full_stdout(fork, rec):
    for args in (("simulate", "uwb-los", "-o", "-"), ("info", rec)):
        with open("/dev/full", "wb") as full:
            process = fork(*args, stdout=full)
            error = process.communicate(timeout=60)[1].decode()
        assert process.returncode == 5 and "No space left" in error


@pytest.mark.parametrize("form", ["h5", "mcap"])
def test_closed_pipe(start, form):
    process = start("simulate", "uwb-los", "-o", "-", "--format", form, stdout=subprocess.PIPE)
    process.stdout.close()
    assert process.stderr.read() == b"" and process.wait(60) == 141
    process.stderr.close()


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize(
    ("signum", "code"), [(signal.SIGHUP, 129), (signal.SIGINT, 130), (signal.SIGTERM, 143)]
)
def test_signal_in_the_middle(fork, campaign, tmp_path, jobs, signum, code):
    folder = tmp_path / "out"
    files = sorted(campaign.glob("*.h5"))
    process = fork(
        "estimate", "-e", "mean", *files, "-o", f"{folder}/", "-j", jobs, "--set", "delay=10"
    )  # fmt: skip
    for _ in range(200):
        if folder.exists() and len(os.listdir(folder)) == jobs:
            break
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.1)
    process.send_signal(signum)
    assert process.communicate(timeout=30)[1] == b""
    assert process.returncode == code
    assert os.listdir(folder) == []


def test_traceback_only_where_wanted(run, rec, monkeypatch):
    monkeypatch.setattr(formats, "summary", lambda *_: 1 / 0)
    check(run("info", rec), 1, "internal error: ZeroDivisionError")
    assert "Traceback" in run("info", rec, "-vv").err


@pytest.mark.parametrize("words", [["--from", "labyrinth"], []])
def test_an_output_must_be_named(run, rec, tmp_path, words):
    check(run("convert", *words, rec, tmp_path / "x.h5"), 2, "Missing option '-o'")


def test_hdf5_of_others_is_called_so(estimate, run, tmp_path):
    import h5py

    with h5py.File(tmp_path / "foreign.h5", "w") as file:
        file["speed"] = [1.0, 2.0]
    message = "foreign.h5: /: not a file of echoset: "
    estimate(tmp_path / "foreign.h5", words=[message])
    check(run("info", tmp_path / "foreign.h5"), 4, message)


def test_files_of_others_get_a_command_that_reads_them(estimate, run, tmp_path):
    log, folder = tmp_path / "my log.csv", tmp_path / "robot"
    log.write_text("t,anchor,range\n0,A,1.5\n1,A,2.5\n")
    folder.mkdir()
    (folder / "Indoor_UWB_Input.txt").write_text("range2 0 1 0.01 0 0 a 0\n")
    (tmp_path / "x.bag").write_bytes(b"#ROSBAG V2.0\n\x00\xff\x01" + bytes(range(256)))
    propose = f"try echoset convert --from csv '{log}' --propose"
    imported = f"try echoset convert --from labyrinth {folder} -o robot.h5"
    for name, words in (
        (log, propose),
        (folder, imported),
        (tmp_path / "x.bag", "see 'echoset list importers'"),
    ):
        estimate(name, words=[words])
        check(run("info", name), 4, words)
        check(run("convert", name, "-o", tmp_path / "out/x.h5"), 4, words)


def test_a_proposal_goes_to_stdout(run, tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("t,anchor,range\n0,A,1.5\n1,A,2.5\n")
    result = run("convert", "--from", "csv", log, "--propose")
    assert result.code == 0 and "  anchor: anchor\n" in result.out
    check(run("convert", log, "--propose"), 2, "--propose is for one log and --from")
    check(run("convert", "--from", "csv", log, "--propose", "-o", "x.h5"), 2, "--propose")
    check(run("convert", "--from", "labyrinth", log, "--propose"), 2, "needs no mapping")


def test_what_is_not_ours_gets_a_hint(run, tmp_path):
    """Each line names the file, and what to type or where to look."""
    (tmp_path / "foreign.json").write_text('{"a": 1}')
    (tmp_path / "list.json").write_text('[{"sensorID": 1}]')
    folder = tmp_path / "logs"
    folder.mkdir()
    (folder / "Indoor_UWB_Input.txt").write_text("range2 0.0 1.0 0.01 0 0 1\n")
    none = (
        "foreign.json: line 1: not an object of provenance and scores: see 'echoset list importers'"
    )
    check(run("info", tmp_path / "foreign.json"), 4, none)
    check(run("info", tmp_path / "list.json"), 4, "try echoset convert --from autoferry")
    both = ("convert", "--from", "labyrinth", folder, folder, "-o", tmp_path / "x.h5")
    check(run(*both), 4, "logs: Is a directory: import a folder by itself, or its files by name")
    check(run("convert", "--from", "labyrinth", folder), 2, "where to write, as in -o logs.h5")

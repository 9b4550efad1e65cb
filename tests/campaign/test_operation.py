"""Commands under odd circumstances: closed streams, pipes, odd names, files that are one."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from support import forks

ECHOSET = str(Path(sys.executable).parent / "echoset")
ESTIMATE = ("estimate", "-e", "mean")


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def refused(result, code, *words):
    assert result.code == code and result.err.count("\n") == 1, result
    assert "internal error" not in result.err and all(w in result.err for w in words), result


def call(*words: object, **how: object) -> subprocess.CompletedProcess[bytes]:
    """The installed command as a process."""
    line = [ECHOSET, *map(str, words)]
    return subprocess.run(line, capture_output=True, timeout=120, check=False, **how)


@pytest.mark.parametrize("jobs", [1, 2])
def test_nothing_of_the_current_folder_is_imported(files, tmp_path, jobs):
    """Neither by workers nor by the process that keeps track of what they share."""
    for name in ("selectors", "pickle", "numpy", "queue", "signal", "_posixshmem", "echoset"):
        (tmp_path / f"{name}.py").write_text("open('ran', 'a').write(__name__)\n")
    found = call(*ESTIMATE, *files, "-o", "out/", "-j", jobs, cwd=tmp_path)
    assert (found.returncode, found.stderr) == (0, b"") and not (tmp_path / "ran").exists()
    assert len(contents(tmp_path / "out")) == 3


CHANGED = """
import os, signal, sys
from echoset.campaign import batch, exits
from echoset.campaign.batch import run as module
from echoset.cli.main import run

class Task:
    target, sources = None, ()
    def __init__(self, label): self.label = label
    def placed(self, execution): return self
    def decide(self): return None
    def run(self):
        print(self.label, flush=True)
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            for _ in range(10_000): pass
        except SystemExit as error:
            {change}

from echoset.campaign.batch.execution import Execution
tasks = [Task(name) for name in "abc"]
sys.exit(run(lambda: module.run(tasks, Execution(keep_going=True))))
"""


@pytest.mark.parametrize(
    "change", ["raise SystemError('returned a result with an exception set') from error", "pass"]
)
def test_a_signal_is_not_forgotten_where_its_exception_is_changed(command, change):
    """numba's dispatcher makes a SystemError of it, a class body a RuntimeError."""
    code = CHANGED.replace("{change}", change)
    found = subprocess.run([command[0], "-c", code], capture_output=True, timeout=60, check=False)
    assert (found.returncode, found.stdout, found.stderr) == (143, b"a\n", b"")


@pytest.mark.parametrize("after", [0.0, 1.0])
def test_a_stopped_worker_is_killed(fork, files, tmp_path, after):
    process = fork(*ESTIMATE, *files, "-o", f"{tmp_path}/out/", "-j", 2, "--set", "delay=10")
    out = tmp_path / "out"
    while not out.exists() or len(os.listdir(out)) < 2:
        time.sleep(0.05)
    for worker in children(process.pid):
        os.kill(worker, signal.SIGSTOP)
    time.sleep(after)
    process.send_signal(signal.SIGTERM)
    assert process.communicate(timeout=30)[1] == b"" and process.returncode == 143
    assert os.listdir(out) == []


def children(pid: int) -> list[int]:
    """Workers of a process: not the one that keeps track of what they share."""
    found = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    return [int(p) for p in found if b"spawn_main" in Path(f"/proc/{p}/cmdline").read_bytes()]


def test_hang_up_of_the_whole_group(start, files, tmp_path):
    """As when a terminal closes: nothing is said, also by the process that counts semaphores."""
    words = (*ESTIMATE, *files, "-o", f"{tmp_path}/out/", "-j", 2, "--set", "delay=10")
    process, out = start(*words, start_new_session=True), tmp_path / "out"
    while not out.exists() or len(os.listdir(out)) < 2:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGHUP)
    assert process.communicate(timeout=30)[1] == b"" and process.returncode == 129
    assert os.listdir(out) == []


@pytest.mark.parametrize("jobs", [1, 2])
@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
def test_closed_streams(files, tmp_path, closed, jobs):
    line = f'exec "$0" "$@" {closed}'
    words = (*ESTIMATE, *files, "-o", f"{tmp_path}/out/", "-j", jobs)
    found = subprocess.run(
        ["sh", "-c", line, ECHOSET, *map(str, words)], capture_output=True, timeout=60, check=False
    )
    assert (found.returncode, found.stdout, found.stderr) == (0, b"", b"")
    assert len(contents(tmp_path / "out")) == 3


def test_messages_do_not_land_in_the_data(rec):
    """Where stderr is closed, print() writes to stdout."""
    line = 'exec "$0" "$@" 2>&-'
    words = ("sh", "-c", line, ECHOSET, *ESTIMATE, rec, "-o", "-", "-v", "--log-format", "json")
    found = subprocess.run(list(map(str, words)), capture_output=True, timeout=60, check=False)
    clean = call(*ESTIMATE, rec, "-o", "-")
    assert found.returncode == 0 and found.stdout == clean.stdout


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("estimate", "-e", "mean", "{rec}", "-o", "{rec}", "--overwrite"), "-o"),
        (("estimate", "-e", "mean", "{rec}", "-o", "{hard}", "--overwrite"), "-o"),
        (("estimate", "-e", "mean", "{rec}", "-o", "{soft}", "--overwrite"), "-o"),
        (("estimate", "-e", "mean", "{rec}", "-o", "e.h5", "--summary", "{rec}"), "--summary"),
        (("estimate", "-e", "mean", "{rec}", "-o", "e.h5", "--summary", "./e.h5"), "--summary"),
        (("estimate", "-e", "mean", "{rec}", "-o", "e.h5", "--deps", "{rec}"), "--deps"),
        (("estimate", "-e", "mean", "{rec}", "-o", "e.h5", "--deps", "x", "--summary", "x"),
         "--summary"),
        (("estimate", "-e", "mean", "{rec}", "-o", "e.h5", "--timing", "t.csv", "--deps", "t.csv"),
         "--deps"),
        (("estimate", "-e", "mean", "{rec}", "-o", "e.h5", "--config", "c.yaml", "--deps",
          "c.yaml"), "--deps"),
        (("estimate", "-e", "mean", "{rec}", "-o", "e.h5", "--lock", "e.h5",
          "--overwrite"), "--lock"),
        (("convert", "{rec}", "-o", "{rec}", "--overwrite"), "-o"),
        (("simulate", "s.yaml", "-o", "s.h5", "--deps", "s.yaml"), "--deps"),
        (("score", "e0.h5", "--truth", "{rec}", "-o", "e0.h5", "--overwrite"), "-o"),
        (("score", "e0.h5", "--truth", "{rec}", "-o", "{rec}", "--overwrite"), "-o"),
        (("report", "s.csv", "-o", "s.csv", "--overwrite"), "-o"),
    ],
)  # fmt: skip
def test_files_that_are_one(run, rec, tmp_path, monkeypatch, words, said):
    monkeypatch.chdir(tmp_path)
    mine = tmp_path / "rec.h5"
    mine.write_bytes(rec.read_bytes())
    os.link(mine, "hard.h5")
    os.symlink(mine, "soft.h5")
    Path("c.yaml").write_text("noise: 0.2\n")
    Path("s.yaml").write_text("scenario: uwb-los\nparameters: {steps: 3}\n")
    assert run(*ESTIMATE, mine, "-o", "e0.h5").code == 0
    assert run("score", "e0.h5", "--truth", mine, "-m", "rmse", "-o", "s.csv").code == 0
    before = contents(tmp_path)
    names = {"{rec}": mine, "{hard}": "hard.h5", "{soft}": "soft.h5"}
    refused(run(*(names.get(word, word) for word in words)), 2, f"{said} ")
    after = contents(tmp_path)
    if said == "--lock":
        after.pop("e.h5")
    assert after == before


@pytest.mark.parametrize("option", ["--summary", "--deps", "--timing"])
@pytest.mark.parametrize("name", ["file/x.csv", "folder.csv", "/proc/x.csv", "x" * 252 + ".csv"])
def test_what_cannot_be_written_is_known_before_the_work(run, rec, tmp_path, option, name):
    (tmp_path / "file").touch()
    (tmp_path / "folder.csv").mkdir()
    result = run(*ESTIMATE, rec, "-o", tmp_path / "e.h5", option, tmp_path / name)
    refused(result, 5)
    assert not (tmp_path / "e.h5").exists()


def test_an_output_that_appears_meanwhile_stays(fork, rec, tmp_path):
    out = tmp_path / "out"
    process = fork(*ESTIMATE, rec, "-o", out / "x.h5", "--set", "delay=0.1")
    while not out.exists() or not os.listdir(out):
        time.sleep(0.02)
    (out / "x.h5").write_text("theirs")
    error = process.communicate(timeout=60)[1]
    assert process.returncode == 5 and b"exists already" in error
    assert contents(out) == {"x.h5": b"theirs"}


def feed(path: Path, data: bytes) -> threading.Thread:
    """Write to a pipe with a name, while somebody else reads."""
    thread = threading.Thread(target=path.write_bytes, args=(data,))
    thread.start()
    return thread


@pytest.mark.parametrize("form", ["h5", "mcap"])
def test_pipes_with_a_name_are_read_as_files(run, rec, tmp_path, form):
    source, fifo = tmp_path / f"rec.{form}", tmp_path / "fifo"
    assert run("convert", rec, "-o", source).code == 0
    est = tmp_path / "est.h5"
    assert run(*ESTIMATE, source, "-o", est).code == 0
    assert run("score", est, "--truth", rec, "-m", "rmse", "-o", tmp_path / "s.csv").code == 0
    os.mkfifo(fifo)
    commands = {
        ("info",): source, ("validate", "--strict"): source,
        ("convert", "-o", "-"): source, ("report",): tmp_path / "s.csv",
        ("score", "--truth", rec, "-m", "rmse"): est,
    }  # fmt: skip
    for words, file in commands.items():
        plain = run(*words, file)
        assert plain.code == 0
        writer = feed(fifo, file.read_bytes())
        piped = run(*words, fifo)
        writer.join()
        if words[0] not in ("info", "validate"):
            assert piped == plain, words
        assert piped.code == 0 and piped.err == "", words
    writer = feed(fifo, source.read_bytes())
    assert run(*ESTIMATE, fifo, "-o", tmp_path / "piped.h5") == (0, "", "")
    writer.join()
    assert (tmp_path / "piped.h5").read_bytes() == est.read_bytes()


def test_pipes_of_a_shell(rec, tmp_path):
    line = f"{ECHOSET} info <(cat {rec}) && {ECHOSET} info /dev/stdin <{rec} >{tmp_path}/file"
    line += f" && cat {rec} | {ECHOSET} info /dev/stdin && {ECHOSET} report /dev/null"
    found = subprocess.run(["bash", "-c", line], capture_output=True, timeout=60, check=False)
    assert found.returncode == 4 and found.stdout.count(b"A1 (anchor)") == 2
    assert b"/dev/null: is neither a file nor a pipe" in found.stderr


def test_pipe_that_nobody_writes_to(run, tmp_path, monkeypatch):
    monkeypatch.setattr("echoset.campaign.files.inputs._PATIENCE", 0.1)
    os.mkfifo(tmp_path / "fifo")
    for command in ("info", "validate", "report"):
        refused(run(command, tmp_path / "fifo"), 4, "nobody writes to")


@pytest.mark.parametrize("command", ["info", "validate", "report", "convert"])
def test_devices_have_no_end(run, command, tmp_path):
    more = ("-o", tmp_path / "x.h5") if command == "convert" else ()
    refused(run(command, "/dev/zero", *more), 4, "/dev/zero")


def test_names_that_are_not_utf8(rec, tmp_path):
    folder = os.fsencode(tmp_path)
    name = b"r\xff\x1b[31m\x07=.h5"
    (tmp_path / os.fsdecode(name)).write_bytes(rec.read_bytes())
    words = [*ESTIMATE, name, "-o", b"out/", "--deps", "d", "--summary", "s", "-v"]
    found = forks.call(*words, cwd=folder)
    assert found.returncode == 0 and b"\x1b" not in found.stderr, found
    assert rb"r\xff\x1b[31m\x07=.h5: done" in found.stderr
    estimated = b"out/r\xff\x1b[31m\x07=.mean.h5"
    assert (tmp_path / os.fsdecode(estimated)).exists()
    rule = estimated.replace(b"=", b"$(or =)").replace(b"[", b"\\[") + b": "
    assert (tmp_path / "d").read_bytes().startswith(rule)
    for command in ("info", "validate"):
        found = forks.call(command, name, cwd=folder)
        assert found.returncode == 0 and found.stdout.startswith(rb"r\xff\x1b[31m\x07=.h5: "), found
    (tmp_path / os.fsdecode(name)).write_bytes(b"junk")
    words = [*ESTIMATE, name, rec, "-o", b"o2/", "--summary", "s", "--keep-going"]
    words += ["--log-format", "json"]
    found = forks.call(*words, cwd=folder)
    assert found.returncode == 4, found
    assert all(json.loads(line)["message"] for line in found.stderr.splitlines())
    failure = json.loads((tmp_path / "s").read_text())["failures"][0]
    assert os.fsencode(failure["input"]) == name

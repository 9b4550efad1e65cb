"""The same work on a Dask cluster of loopback workers that are killed, as is their scheduler."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import pytest

if find_spec("distributed") is None:
    pytest.skip("the extra echoset[cluster] is not installed", allow_module_level=True)

FULL = pytest.mark.verification
BAD = (
    *("tcp://", "tcp://127.0.0.1", "tcp://:8786", "tcp://127.0.0.1:port", "tcp://127.0.0.1:0"),
    *("tcp://127.0.0.1:99999", "tcp://[::1", "inproc://x"),
)
"""Addresses that lack a host or a port."""


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


class Lab:
    """A scheduler and workers as processes."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "scheduler.json"
        self.workers: list[subprocess.Popen[bytes]] = []
        self.scheduler: subprocess.Popen[bytes] | None = None
        self._folder = folder

    def _start(self, *args: object) -> subprocess.Popen[bytes]:
        words = [sys.executable, "-m", "dask", *map(str, args), "--scheduler-file", str(self.file)]
        environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        with (self._folder / "log").open("ab") as log:
            return subprocess.Popen(
                [*words, "--no-dashboard"], stdout=log, stderr=log, env=environment, cwd="/"
            )

    def start(self) -> None:
        """Start the scheduler, and wait until it has written its file."""
        self.file.unlink(missing_ok=True)
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", 0)
        while not self.file.exists():
            assert self.scheduler.poll() is None
            time.sleep(0.05)

    def add_worker(self) -> None:
        """Start a worker of one thread."""
        self.workers.append(self._start("worker", "--nthreads", 1, "--no-nanny"))

    def kill(self, process: subprocess.Popen[bytes]) -> None:
        """Kill the scheduler or a worker."""
        process.send_signal(signal.SIGKILL)
        process.wait()

    @property
    def address(self) -> str:
        """Where the scheduler is."""
        return str(json.loads(self.file.read_text())["address"])


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    """A running scheduler, and one worker."""
    found = Lab(tmp_path)
    found.start()
    found.add_worker()
    yield found
    for process in [found.scheduler, *found.workers]:
        found.kill(process)


def wait_for(condition, process: subprocess.Popen[bytes]) -> None:
    while not condition():
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)


@pytest.mark.parametrize(
    ("recordings", "delay", "pause"), [(4, 0.04, None), pytest.param(1000, 0.01, 3, marks=FULL)]
)
def test_killed_cluster(run, start, lab, tmp_path, recordings, delay, pause):
    """Workers die now and then and others come; the scheduler dies once; the bytes are the same."""
    words = ("simulate", "uwb-los", "--runs", recordings, "--set", "steps=10")
    assert run(*words, "-o", f"{tmp_path}/rec/").code == 0
    files, out = sorted((tmp_path / "rec").iterdir()), tmp_path / "out"
    words = ("estimate", "-e", "mean", *files, "--set", f"delay={delay}")
    assert run(*words, "-o", f"{tmp_path}/whole/", "-j", 2).code == 0
    whole = contents(tmp_path / "whole")
    words = (*words, "-o", f"{out}/", "--skip-existing", "--summary", tmp_path / "s")

    def check() -> int:
        found = {p.name: p.read_bytes() for p in out.glob("[!.]*")} if out.exists() else {}
        assert found.items() <= whole.items()
        return len(found)

    def kill_workers_until(wanted: int, process: subprocess.Popen[bytes]) -> int:
        """Kill a worker every few seconds of work, or just one; another comes in its place."""
        killed, last = 0, -1
        while (found := check()) < wanted and process.poll() is None:
            if (pause is not None and found > last) or not killed:
                lab.kill(lab.workers[killed])
                lab.add_worker()
                killed, last = killed + 1, found
            time.sleep(pause or 0.2)
        return killed

    lab.add_worker() if pause else None
    process = start(*words, "--cluster", lab.file)
    wait_for(lambda: check() >= 1, process)
    killed = kill_workers_until(recordings // 2, process)
    assert process.poll() is None
    lab.kill(lab.scheduler)
    error = process.communicate(timeout=60)[1].decode()
    lines = [line for line in error.splitlines() if "has no workers: waiting" not in line]
    assert process.returncode == 75 and len(lines) == 1, error
    assert "the scheduler is lost" in error and check() < recordings
    summary = json.loads((tmp_path / "s").read_text())
    assert "the scheduler is lost" in summary["stopped"] and summary["left"] > 0
    for worker in lab.workers:
        lab.kill(worker)

    lab.workers.clear()
    lab.start()
    for _ in range(2 if pause else 1):
        lab.add_worker()
    process = start(*words, "--cluster", lab.address)
    if pause:
        wait_for(lambda: check() > recordings // 2 + 20, process)
        killed += kill_workers_until(recordings, process)
        assert killed >= 10
    error = process.communicate(timeout=300)[1].decode()
    assert all("has no workers: waiting" in line for line in error.splitlines()), error
    assert process.returncode == 0 and contents(out) == whole


def test_simulations_and_scores_on_a_cluster(run, start, lab, campaign, tmp_path):
    """Relative names, a task that kills its workers, and errors are those of this machine."""
    words = ("simulate", "uwb-los", "--runs", 2, "--set", "steps=20", "-o", "rec/")
    process = start(*words, "--cluster", lab.file, cwd=tmp_path)
    assert process.communicate(timeout=120)[1] == b""
    assert contents(tmp_path / "rec").items() < contents(campaign).items()
    files = sorted((tmp_path / "rec").iterdir())
    assert run("estimate", "-e", "mean", *files, "-o", f"{tmp_path}/est/").code == 0
    words = ("score", *sorted((tmp_path / "est").iterdir()), "--truth", "rec", "-m", "rmse")
    words = (*words, "-o", "s.csv", "--deps", "s.d")
    process = start(*words, "--cluster", lab.file, cwd=tmp_path)
    assert process.communicate(timeout=120)[1] == b""
    assert (tmp_path / "s.d").read_text().startswith("s.csv: ")
    assert (tmp_path / "s.d").read_text().endswith(f" rec/{files[1].name}\n")
    words = ("score", *sorted((tmp_path / "est").iterdir()), "--truth", tmp_path / "rec")
    here = run(*words, "-m", "rmse", "-o", tmp_path / "h.csv")
    assert here.code == 0
    assert (tmp_path / "s.csv").read_bytes() == (tmp_path / "h.csv").read_bytes()
    bad = tmp_path / "bad.mcap"
    assert run("convert", files[1], "-o", bad).code == 0
    data = bytearray(bad.read_bytes())
    data[len(data) // 3] ^= 4
    bad.write_bytes(data)
    words = ("estimate", "-e", "mean", files[0], bad, "-o", f"{tmp_path}/out/", "--keep-going")
    process = start(*words, "--cluster", lab.file)
    error = process.communicate(timeout=120)[1].decode()
    assert process.returncode == 4 and f"{bad}: " in error and "1 of 2 failed" in error
    here = run(*words[:5], "-o", f"{tmp_path}/x/", "--keep-going")
    assert here.err.splitlines()[0].removeprefix("echoset: ") in error


def test_workers_import_nothing_of_their_folder(tmp_path, monkeypatch):
    from echoset.campaign.batch import cluster

    monkeypatch.chdir(tmp_path)
    rest = ["/elsewhere", *sys.path]
    for asked in (False, True):
        monkeypatch.setattr(sys, "path", ["", str(tmp_path), *rest])
        monkeypatch.setenv("PYTHONPATH", str(tmp_path) if asked else "")
        found = cluster._on_worker(cluster._versions(), lambda: list(sys.path))
        assert found == (["", str(tmp_path)] if asked else []) + rest


def test_unfit_workers_and_signals(command, start, lab, files, tmp_path):
    """Workers that lack a module or have another version, and an end by SIGTERM."""
    (tmp_path / "only_here.py").write_text("def nothing(): pass")
    code = """
import sys
from only_here import nothing
from echoset.campaign.batch.cluster import Cluster
cluster = Cluster(sys.argv[1])
cluster._versions, versions = {**cluster._versions, "numpy": "0.1"}, cluster._versions
for call in (print, nothing):
    print(cluster.submit(call).exception())
    cluster._versions = versions
cluster.close()
"""
    path = f"{tmp_path}{os.pathsep}{os.environ['PYTHONPATH']}"
    found = subprocess.run(
        [command[0], "-c", code, lab.file],
        env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True,
    )  # fmt: skip
    assert found.stdout.count("\n") == 2, found.stdout
    version, module = found.stdout.splitlines()
    assert "a worker of the cluster has numpy" in version and "instead of 0.1" in version
    assert "No module named 'only_here'" in module and found.stderr == ""

    words = ("estimate", "-e", "mean", *files, "-o", f"{tmp_path}/out/", "--set", "delay=0.2")
    process = start(*words, "--cluster", lab.file)
    wait_for(lambda: (tmp_path / "out").exists(), process)
    process.send_signal(signal.SIGTERM)
    assert process.communicate(timeout=30)[1] == b"" and process.returncode == 143


@pytest.mark.parametrize(
    ("address", "code", "word"),
    [
        ("tcp://127.0.0.1:1", 75, "no scheduler answers"),
        ("none.json", 75, "No such file"),
        ("ftp://127.0.0.1:1", 2, "ftp"),
        *((bad, 2, f"--cluster {bad}: {bad} is no address like") for bad in BAD),
        (__file__, 2, "is no scheduler file"),
    ],
)
def test_no_cluster(start, rec, tmp_path, monkeypatch, address, code, word):
    monkeypatch.setenv("DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT", "2s")
    words = ("estimate", "-e", "mean", rec, "-o", tmp_path / "x.h5", "--cluster", address)
    process = start(*words)
    error = process.communicate(timeout=60)[1].decode()
    assert process.returncode == code and error.count("\n") == 1 and word in error
    assert not (tmp_path / "x.h5").exists()

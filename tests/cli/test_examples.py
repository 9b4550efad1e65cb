"""The recipes of examples/campaign, each run as it stands."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples/campaign"


@pytest.fixture
def place(tmp_path: Path, command: list[str], monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the examples, in which ``echoset`` is this one."""
    folder = tmp_path / "campaign"
    shutil.copytree(EXAMPLES, folder)
    install(tmp_path / "bin/echoset", f'exec {command[0]} -c "{command[2]}" "$@"')
    monkeypatch.setenv("PATH", f"{tmp_path}/bin:{os.environ['PATH']}")
    monkeypatch.setenv("HOME", str(tmp_path))
    return folder


def install(path: Path, body: str) -> None:
    path.parent.mkdir(exist_ok=True)
    path.write_text(f"#!/bin/sh\n{body}\n")
    path.chmod(0o755)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_makefile(place):
    words = [
        "make",
        "--silent",
        "RUNS=1",
        "SCENARIO=uwb-los",
        "SET=--set steps=5",
        "ESTIMATOR=mean",
    ]

    def make() -> str:
        done = subprocess.run([*words, "--debug=b"], cwd=place, capture_output=True, text=True)
        assert done.returncode == 0 and done.stderr == ""
        return done.stdout

    make()
    assert (place / "report.md").read_text().startswith("## ")
    estimates = names(place / "estimates")
    assert estimates == sorted(
        f"uwb-los-s1-000{k}.mean.h5{s}" for k in range(1) for s in ("", ".d")
    )
    assert "Must remake" not in make()
    (place / "config.yaml").write_text("noise: 0.2\n")
    again = make()
    assert again.count("Must remake target 'estimates/") == 1 and "target 'recordings" not in again


def test_crontab(place, campaign):
    lines = [x for x in (place / "crontab").read_text().splitlines() if not x.startswith("#")]
    assert len(lines) == 1 and "%" not in lines[0]
    line = lines[0].split(maxsplit=5)[5].replace("eopda-geo", "mean")
    shutil.copytree(campaign, place / "recordings")

    def cron() -> subprocess.CompletedProcess[bytes]:
        return subprocess.run(["/bin/sh", "-c", line], capture_output=True, cwd="/")

    (place / "recordings/bad.h5").write_bytes(b"")
    found = cron()
    assert (found.returncode, found.stdout, found.stderr) == (4, b"", b"")
    assert "bad.h5: byte 0: the file is empty" in (place / "campaign.log").read_text()
    assert len(names(place / "estimates")) == 3
    (place / "recordings/bad.h5").unlink()
    assert cron().returncode == 0
    assert json.loads((place / "summary.json").read_text())["skipped"] == 3
    busy = subprocess.run(["flock", "lock", "/bin/sh", "-c", line], cwd=place, capture_output=True)
    assert (busy.returncode, busy.stderr) == (75, b"")


def test_job_array(place, campaign, monkeypatch):
    files = sorted(campaign.iterdir())
    (place / "list.txt").write_text("".join(f"{path}\n" for path in files))
    monkeypatch.setenv("ESTIMATOR", "mean")
    monkeypatch.setenv("SLURM_ARRAY_TASK_COUNT", "2")
    for task, number in ((1, 2), (0, 3), (1, 3)):
        monkeypatch.setenv("SLURM_ARRAY_TASK_ID", str(task))
        done = subprocess.run(["sh", "array.sh"], cwd=place, capture_output=True)
        assert (done.returncode, done.stderr) == (0, b"")
        assert len(names(place / "estimates")) == number
    assert json.loads((place / "summary-1.json").read_text())["skipped"] == 2


def test_slurm_cluster(place, campaign, tmp_path):
    """With an sbatch that starts its jobs here."""
    if find_spec("dask_jobqueue") is None:
        pytest.skip("dask-jobqueue is not installed")
    start = 'cp "$1" job.$$\nsetsid sh job.$$ >> jobs.log 2>&1 &\necho "Submitted job $!"'
    install(tmp_path / "bin/sbatch", start)
    install(tmp_path / "bin/scancel", 'kill -- "-$1"')
    words = ["estimate", "-e", "mean", *map(str, sorted(campaign.iterdir())), "-o", "estimates/"]
    script = [sys.executable, "slurm_cluster.py", "--jobs", "1", "--interface", "lo", "--"]
    done = subprocess.run([*script, *words], cwd=place, capture_output=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert len(names(place / "estimates")) == 3

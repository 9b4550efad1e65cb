"""Disks that are full, read-only, another or gone: one line, nothing half-written, resumable."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

SIZE = 96
"""Kibibytes of a small disk, which takes the first estimates and not the rest."""


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A small disk of its own."""
    folder = tmp_path / "disk"
    folder.mkdir()
    words = ["mount", "-t", "tmpfs", "-o", f"size={SIZE}k", "tmpfs", str(folder)]
    if shutil.which("mount") is None or subprocess.run(words, capture_output=True).returncode:
        pytest.skip("mounting a small disk needs the rights of root")
    yield folder
    subprocess.run(["umount", "--lazy", folder], check=True)


def remount(disk: Path, options: str) -> None:
    subprocess.run(["mount", "-o", f"remount,{options}", disk], check=True)


@pytest.fixture
def estimate(run, campaign, tmp_path) -> Callable:
    """Estimate three recordings into a folder."""
    files = sorted(campaign.iterdir())

    def call(folder, *args):
        return run("estimate", "-e", "mean", *files, "-o", f"{folder}/", *args)

    return call


@pytest.fixture
def whole(estimate, tmp_path) -> Callable[[str], dict[str, bytes]]:
    """The undisturbed outputs in a format."""

    def call(form: str) -> dict[str, bytes]:
        assert estimate(tmp_path / "whole", "--format", form).code == 0
        return contents(tmp_path / "whole")

    return call


def check_failed(result, reason: str) -> None:
    assert result.code == 5 and result.err.count("\n") == 1, result
    assert "cannot be written" in result.err and reason in result.err


@pytest.mark.parametrize(("form", "jobs"), [("h5", 2), ("mcap", 1)])
def test_full_disk(estimate, whole, disk, form, jobs):
    expected = whole(form)
    (disk / "other").write_bytes(bytes(1024 * SIZE - 2 * max(map(len, expected.values()))))
    words = ("--format", form, "-j", jobs, "--skip-existing")
    check_failed(estimate(disk / "out", *words), "No space left on device")
    found = contents(disk / "out")
    assert found.items() < expected.items()
    result = estimate(disk / "out", *words, "--keep-going")
    assert result.code == 5 and contents(disk / "out").items() < expected.items()
    (disk / "other").unlink()
    assert estimate(disk / "out", *words) == (0, "", "") and contents(disk / "out") == expected


def test_full_disk_of_scores_summary_and_rules(estimate, run, campaign, disk, tmp_path):
    assert estimate(tmp_path / "est").code == 0
    (disk / "other").write_bytes(bytes(1024 * (SIZE - 4)))
    words = ("score", *sorted((tmp_path / "est").iterdir()), "--truth", campaign)
    check_failed(run(*words, "-o", disk / "s.csv"), "No space left on device")
    assert os.listdir(disk) == ["other"]


def test_read_only_disk(estimate, whole, disk):
    expected = whole("h5")
    assert estimate(disk / "out").code == 0
    (disk / "out" / sorted(expected)[1]).unlink()
    remount(disk, "ro")
    left = contents(disk / "out")
    check_failed(estimate(disk / "out", "--skip-existing"), "Read-only file system")
    check_failed(estimate(disk / "out", "--skip-existing", "-j", 2), "Read-only file system")
    assert contents(disk / "out") == left
    remount(disk, "rw")
    assert estimate(disk / "out", "--skip-existing").code == 0
    assert contents(disk / "out") == expected


def test_target_on_another_file_system(estimate, whole, disk, tmp_path):
    """Behind a link, while inputs and the folder for temporary files are elsewhere."""
    expected = whole("h5")
    (tmp_path / "link").symlink_to(disk)
    assert (tmp_path / "link").stat().st_dev != tmp_path.stat().st_dev
    assert estimate(tmp_path / "link", "-j", 2) == (0, "", "")
    assert contents(disk) == expected


@pytest.mark.parametrize("jobs", [1, 2])
def test_folder_removed_during_the_run(fork, estimate, whole, campaign, tmp_path, jobs):
    expected, out = whole("h5"), tmp_path / "out"
    words = ("estimate", "-e", "mean", *sorted(campaign.iterdir()), "-o", f"{out}/", "-j", jobs)
    process = fork(*words, "--set", "delay=0.02")
    while not out.exists() or len(os.listdir(out)) < jobs:
        assert process.poll() is None
        time.sleep(0.01)
    out.rename(tmp_path / "gone")
    shutil.rmtree(tmp_path / "gone")
    error = process.communicate(timeout=60)[1].decode()
    assert process.returncode == 5 and error.count("\n") == 1, error
    assert "No such file or directory" in error and not (out.exists() and os.listdir(out))
    assert estimate(out, "--skip-existing") == (0, "", "") and contents(out) == expected

"""Faults of the machine have their exit code and name the file."""

from __future__ import annotations

import ctypes
import os
import resource
import subprocess
import sys
from pathlib import Path

import pytest
from support.forks import call

from echoset.campaign.machine import parse_bytes
from echoset.models.errors import ParameterError

ECHOSET = str(Path(sys.executable).parent / "echoset")
ESTIMATE = ("estimate", "-e", "mean")
GB = 1 << 30


def refused(found: subprocess.CompletedProcess[bytes], code: int, *words: object) -> None:
    error = found.stderr.decode()
    assert found.returncode == code and error.count("\n") == 1, found
    assert "internal error" not in error and all(str(w) in error for w in words), found


@pytest.mark.parametrize(
    ("text", "size"), [("4G", 4 * GB), ("1.5 GiB", 3 * GB // 2), ("500 MB", 500 << 20)]
)
def test_sizes(text, size):
    assert parse_bytes(text) == size


@pytest.mark.parametrize("text", ["", "G", "-1G", "1e9", "nan", "0", "1k", "4 X", "inf"])
def test_what_is_no_size(text):
    with pytest.raises(ParameterError, match="--memory"):
        parse_bytes(text)


@pytest.mark.parametrize("jobs", [1, 2])
def test_memory_is_refused_before_it_is_taken(tmp_path, jobs):
    """A scenario of 10^9 steps; the kernel would kill it."""
    words = ("simulate", "uwb-los", "--set", "steps=1000000000", "--memory", "2G", "--runs", 2)
    found = call(*words, "-o", f"{tmp_path}/out/", "-j", jobs)
    refused(found, 75, "uwb-los-s1-000", "--memory")
    assert not (tmp_path / "out").exists() or os.listdir(tmp_path / "out") == []


def test_the_budget_is_left_as_it_was(run, rec, tmp_path):
    before = resource.getrlimit(resource.RLIMIT_DATA)
    assert run(*ESTIMATE, rec, "-o", tmp_path / "x.h5", "--memory", "3G").code == 0
    assert resource.getrlimit(resource.RLIMIT_DATA) == before
    assert run(*ESTIMATE, rec, "-o", tmp_path / "y.h5", "--memory", "much").code == 2


@pytest.mark.parametrize("number", [12, 16, 20, 24, 40])
def test_too_few_descriptors(files, tmp_path, number):
    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_NOFILE, (number, number))

    line = [ECHOSET, *ESTIMATE, *map(str, files), "-o", f"{tmp_path}/out/", "-j", "3"]
    found = subprocess.run(line, capture_output=True, timeout=120, check=False, preexec_fn=limit)
    if found.returncode:
        assert found.returncode in (4, 5, 75), found
        assert b"internal error" not in found.stderr and found.stderr.count(b"\n") == 1, found
    assert not list(tmp_path.rglob("*.tmp"))


def without_privileges() -> None:
    """Have permissions hold for the superuser, too: drop what overrides them, and for good."""
    libc = ctypes.CDLL(None, use_errno=True)
    header, sets = (ctypes.c_uint32 * 2)(0x20080522, 0), (ctypes.c_uint32 * 6)()
    libc.capget(header, sets)
    for capability in (1, 2):  # CAP_DAC_OVERRIDE, CAP_DAC_READ_SEARCH
        libc.prctl(24, capability, 0, 0, 0)  # PR_CAPBSET_DROP
        for which in (0, 1):  # effective, permitted
            sets[which] &= ~(1 << capability)
    libc.capset(header, sets)


@pytest.mark.parametrize("jobs", [1, 2])
def test_files_and_folders_without_permission(files, tmp_path, jobs):
    shut, folder = tmp_path / "shut.h5", tmp_path / "folder"
    shut.write_bytes(files[0].read_bytes())
    shut.chmod(0)
    folder.mkdir()
    (folder / "x.h5").write_bytes(files[0].read_bytes())
    folder.chmod(0o600)
    how = {"preexec_fn": without_privileges}
    words = (*ESTIMATE, shut, *files[:2], "-o", f"{tmp_path}/out/", "-j", jobs, "--keep-going")
    found = call(*words, **how)
    assert found.returncode == 4 and b"internal error" not in found.stderr, found
    assert f"{shut}: ".encode() in found.stderr and b"Permission denied" in found.stderr
    assert len(os.listdir(tmp_path / "out")) == 2
    refused(call(*ESTIMATE, folder / "x.h5", "-o", tmp_path / "e.h5", **how), 4, folder / "x.h5")
    for command in ("info", "validate", "report"):
        refused(call(command, folder / "x.h5", **how), 4, folder / "x.h5", "Permission denied")
    refused(call(*ESTIMATE, files[0], "-o", folder / "e.h5", **how), 5, folder / "e.h5")
    assert call(*ESTIMATE, files[0], "-o", tmp_path / "e.h5").returncode == 0
    words = ("score", tmp_path / "e.h5", "--truth", folder)
    refused(call(*words, **how), 4, folder, "Permission denied")
    words = (*ESTIMATE, files[0], "-o", tmp_path / "z.h5", "--config", folder / "c.yaml")
    refused(call(*words, **how), 2, folder / "c.yaml")
    folder.chmod(0o700)


def test_overlong_paths(run, rec, tmp_path):
    long = tmp_path / ("x" * 300)
    deep = "/".join([str(tmp_path), *["y" * 200] * 25])
    for path in (long, deep):
        assert run(*ESTIMATE, path, "-o", tmp_path / "e.h5").code == 4
        assert run(*ESTIMATE, rec, "-o", path, "--format", "h5").code == 5
        assert run("info", path).code == 4
        assert run(*ESTIMATE, rec, "-o", tmp_path / "e.h5", "--config", path).code == 2
        assert run(*ESTIMATE, rec, "-o", tmp_path / "e.h5", "--lock", path).code == 5
        assert run(*ESTIMATE, f"@{path}", "-o", tmp_path / "e.h5").code == 2
        assert run("score", rec, "--truth", path).code == 4
    assert os.listdir(tmp_path) == []


@pytest.mark.parametrize("command", ["convert", "estimate", "report"])
def test_no_room_for_what_comes_through_a_pipe(rec, tmp_path, command):
    """The temporary folder is missing, or takes no more than some bytes."""
    words = {"convert": ("convert", "-"), "estimate": (*ESTIMATE, "-"), "report": ("report", "-")}
    out = ("-o", tmp_path / "x.h5") if command != "report" else ()

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))

    found = call(*words[command], *out, input=rec.read_bytes(), preexec_fn=limit)
    assert found.returncode == 5 and found.stderr.count(b"\n") == 1, found
    assert b"internal error" not in found.stderr and not (tmp_path / "x.h5").exists()


@pytest.mark.parametrize("words", [("--help",), ("estimate", "--help"), ("list",), ("--version",)])
def test_help_on_a_full_disk(words):
    with open("/dev/full", "wb") as full:
        found = subprocess.run(
            [ECHOSET, *words], stdout=full, stderr=subprocess.PIPE, timeout=60, check=False
        )
    assert found.returncode == 5 and found.stderr.count(b"\n") == 1, found
    assert b"internal error" not in found.stderr and b"No space left" in found.stderr

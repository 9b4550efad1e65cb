"""Campaigns that are killed and run again end as if nothing had happened."""

from __future__ import annotations

import os
import random
import signal
import time
from pathlib import Path

import pytest

ESTIMATE = ("estimate", "-e", "mean", "--set", "delay=0.04")
FILTER = ("estimate", "-e", "eopda-geo", "--set", "particles=300")
FULL = pytest.mark.verification
SIZES = [(6, 1, ESTIMATE), pytest.param(1000, 20, FILTER, marks=FULL)]
"""Recordings, kills, and what is done with them."""


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def visible(folder: Path) -> list[str]:
    return [name for name in os.listdir(folder) if name[0] != "."] if folder.exists() else []


def kill_at_random(fork, words, folder, whole, kills, rng):
    """Run the command until it has been killed ``kills`` times, and then to its end.

    Each time the process alone or, as when a machine goes down, all of its workers with it are
    killed once some more outputs are there, and what is there is compared with the ``whole``.
    """
    for _ in range(kills):
        wanted = len(visible(folder)) + rng.randint(0, int(0.6 * len(whole) / kills))
        process = fork(*words, start_new_session=True)
        while len(visible(folder)) < wanted:
            time.sleep(0.01)
            assert process.poll() is None, "over before it was killed"
        time.sleep(rng.uniform(0, 0.05))
        assert process.poll() is None, "over before it was killed"
        (os.killpg if rng.random() < 0.7 else os.kill)(process.pid, signal.SIGKILL)
        process.communicate()
        found = {name: (folder / name).read_bytes() for name in visible(folder)}
        assert found.items() <= whole.items()
    process = fork(*words)
    assert process.communicate()[1] == b"" and process.returncode == 0


@pytest.mark.parametrize(("recordings", "kills", "words"), SIZES)
def test_killed_campaign_ends_in_the_same_bytes(run, fork, tmp_path, recordings, kills, words):
    rng = random.Random(5)
    rec, est = tmp_path / "rec", tmp_path / "est"
    simulate = ("simulate", "uwb-los", "--runs", recordings, "--set", "steps=10", "-j", 2)
    assert run(*simulate, "-o", f"{tmp_path}/whole-rec/").code == 0
    whole = contents(tmp_path / "whole-rec")
    if kills > 2:
        resumed = (*simulate, "-o", f"{rec}/", "--skip-existing")
        kill_at_random(fork, resumed, rec, whole, kills, rng)
        assert contents(rec) == whole

    files = sorted((tmp_path / "whole-rec").iterdir())
    estimate = (*words, *files, "-j", 2)
    assert run(*estimate, "-o", f"{tmp_path}/whole-est/").code == 0
    whole = contents(tmp_path / "whole-est")
    resumed = (*estimate, "-o", f"{est}/", "--skip-existing")
    kill_at_random(fork, resumed, est, whole, kills, rng)
    assert contents(est) == whole


@pytest.mark.parametrize("words", [ESTIMATE[:3], pytest.param(FILTER, marks=FULL)])
def test_bytes_are_the_same_by_every_way(run, tmp_path, words):
    """Any number of processes, any order, in parts and by another name of the input."""
    rec = tmp_path / "rec"
    simulate = ("simulate", "uwb-los", "--runs", 5, "--set", "steps=5", "-o", f"{rec}/")
    assert run(*simulate).code == 0
    files = sorted(rec.iterdir())
    words = (*words, "-o")
    assert run(*words, f"{tmp_path}/1/", *files).code == 0
    whole = contents(tmp_path / "1")
    for jobs, order in ((2, files), (4, files[::-1])):
        assert run(*words, f"{tmp_path}/{jobs}/", *order, "-j", jobs).code == 0
        assert contents(tmp_path / str(jobs)) == whole
    for part in (files[3:], files[:2]):
        assert run(*words, f"{tmp_path}/parts/", *part).code == 0
    assert run(*words, f"{tmp_path}/parts/", *files, "--skip-existing").code == 0
    assert contents(tmp_path / "parts") == whole
    other = tmp_path / "other/renamed.h5"
    other.parent.mkdir()
    other.write_bytes(files[0].read_bytes())
    assert run(*words, f"{tmp_path}/other.h5", other).code == 0
    assert (tmp_path / "other.h5").read_bytes() == whole[f"{files[0].stem}.{words[2]}.h5"]

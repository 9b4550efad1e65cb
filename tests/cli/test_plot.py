"""The command that draws: where pictures go, what they are made from, what is refused."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest


@pytest.fixture
def est(run, rec, tmp_path) -> Path:
    target = tmp_path / "est.mcap"
    assert run("estimate", "-e", "mean", rec, "-o", target).code == 0
    return target


def test_files_and_pipes_give_the_same_picture(run, command, rec, est, tmp_path):
    words = ("plot", "scene", "--size", "12x8", "--time", "0.5:1.5")
    assert run(*words, rec, est, "-o", tmp_path / "a.svg") == (0, "", "")
    assert run(*words, est, rec, "-o", tmp_path / "b.svg").code == 0
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert b'width="340.157' in (tmp_path / "a.svg").read_bytes()
    pipe = f"echoset() {{ {command[0]} -c '{command[2]}' \"$@\"; }}; "
    pipe += f"echoset convert {rec} -o - | echoset estimate -e mean - -o - | "
    pipe += f"echoset {' '.join(words)} - -o {tmp_path / 'c.svg'}"
    subprocess.run(["bash", "-c", pipe], check=True)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "c.svg").read_bytes()


def test_an_existing_picture_stays_unless_told(run, rec, tmp_path):
    target = tmp_path / "a.pdf"
    assert run("plot", "scene", rec, "-o", target).code == 0
    before = target.read_bytes()
    result = run("plot", "bound", rec, "-o", target)
    assert result.code == 5 and target.read_bytes() == before
    assert run("plot", "bound", rec, "-o", target, "--overwrite").code == 0
    assert target.read_bytes() != before


@pytest.mark.parametrize(
    ("words", "code", "reason"),
    [
        (("sceen", "REC", "-o", "OUT.png"), 2, "did you mean 'scene'"),
        (("scene", "REC", "-o", "OUT.jpg"), 2, ".png, .svg or .pdf"),
        (("scene", "REC", "-o", "-"), 2, ".png, .svg or .pdf"),
        (("scene", "REC", "-o", "OUT.png", "--size", "0x3"), 2, "WxH"),
        (("scene", "REC", "-o", "OUT.png", "--size", "wide"), 2, "WxH"),
        (("scene", "REC", "-o", "OUT.png", "--time", "soon"), 2, "START:STOP"),
        (("scene", "REC", "-o", "OUT.png", "--time", "3:2"), 2, "end before it starts"),
        (("rmse", "REC", "-o", "OUT.png"), 4, "rmse: needs scores"),
        (("map", "REC", "-o", "OUT.png"), 4, "no range_angle_map"),
        (("scene", "absent.h5", "-o", "OUT.png"), 4, "absent.h5"),
    ],
)
def test_refusals_are_one_line_and_leave_nothing(run, rec, tmp_path, empty, words, code, reason):
    out = tmp_path / "out"
    out.mkdir()
    known = {"REC": str(rec)}
    result = run("plot", *(known.get(w, w.replace("OUT", f"{out}/x")) for w in words))
    assert result.code == code and reason in result.err and result.err.count("\n") == 1
    assert empty()

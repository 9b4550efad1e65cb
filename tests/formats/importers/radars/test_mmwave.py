"""Tables of TI's radars: a walker, whose times are right or refused with what to say."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from echoset.cli.main import main
from echoset.formats.importers.radars import mmwave
from echoset.models.errors import FormatError
from echoset.models.records import Recording

HEADER = "Frame #,# Obj,X,Y,Z,Doppler,Intensity,y,m,d,h,m,s"
START = datetime(2024, 5, 1, 23, 59, 40, tzinfo=UTC)
EPOCH = int(START.timestamp()) * 10**9
RATE = 10.0


def walker(
    path: Path,
    frames: int = 60,
    restart: int = 40,
    digits: int = 3,
    empty: tuple[int, ...] = (7,),
    noise: float = 0.15,
) -> np.ndarray:
    """A walker on a circle 4 m ahead, 10 to 60 points a frame; returns the true times [ns].

    The counter begins anew at frame ``restart``; frames in ``empty`` have no rows.
    """
    rng = np.random.default_rng(8)
    lines, times = [HEADER], []
    for k in range(frames):
        at = START + timedelta(seconds=k / RATE)
        times.append(EPOCH + round(k / RATE * 1e9))
        if k in empty:
            continue
        angle = 0.5 * k / RATE
        middle = np.array([np.cos(angle), 4 + np.sin(angle), 0.9])
        speed = 0.5 * np.array([-np.sin(angle), np.cos(angle), 0])
        n = int(rng.integers(10, 61))
        points = middle + rng.normal(0, noise, (n, 3))
        doppler = points @ speed / np.linalg.norm(points, axis=1)
        second = at.second + at.microsecond * 1e-6
        stamp = [at.year, at.month, at.day, at.hour, at.minute]
        second = f"{int(second)}" if digits == 0 else f"{second:.{digits}f}"
        number = 100 + k if k < restart else k - restart
        for p, v in zip(points, doppler, strict=True):
            numbers = [*p, v, 20.0]
            words = [number, n, *(f"{x:.4f}" for x in numbers), *stamp, second]
            lines.append(",".join(map(str, words)))
    path.write_text("\n".join(lines) + "\n")
    return np.array(times)


def imported(path: Path, **params: Any) -> Recording:
    return mmwave.read([path], mmwave.Params(**params))


def test_times_points_and_empty_frames(tmp_path: Path, caplog):
    """Over midnight and over a counter that begins anew; the frame that was skipped is empty."""
    times = walker(tmp_path / "walk.csv")
    found = imported(tmp_path / "walk.csv")
    stream = found.streams["radar"]
    np.testing.assert_array_equal(stream.time_ns, times)
    counts = np.diff(stream.row_offset)
    assert counts[7] == 0 and (np.delete(counts, 7) >= 10).all()
    assert counts.sum() == len((tmp_path / "walk.csv").read_text().splitlines()) - 1
    first = (tmp_path / "walk.csv").read_text().splitlines()[1].split(",")
    x, y, z, doppler = (float(v) for v in first[2:6])
    rows = {key: values[0] for key, values in stream.rows.items()}
    assert rows == {"x": y, "y": -x, "z": z, "doppler": doppler, "power": pytest.approx(100.0)}
    assert not caplog.records


def test_whole_seconds_are_refused_with_what_to_say(tmp_path: Path):
    times = walker(tmp_path / "walk.csv", digits=0)
    with pytest.raises(FormatError, match=r"line \d+, column 's': .*\(about 1[01].*--set rate="):
        imported(tmp_path / "walk.csv")
    stream = imported(tmp_path / "walk.csv", rate=RATE).streams["radar"]
    # Each run begins on a stamp of whole seconds that lies in it, so that both are exact here.
    np.testing.assert_allclose(stream.time_ns - times, 0, atol=1)
    with pytest.raises(FormatError, match=r"off what 5 frames a second make"):
        imported(tmp_path / "walk.csv", rate=5.0)


def test_numbers_alone(tmp_path: Path):
    times = walker(tmp_path / "walk.csv")
    lines = (tmp_path / "walk.csv").read_text().splitlines()
    bare = ["\t".join(line.split(",")[:7]) for line in lines]
    (tmp_path / "bare.txt").write_text("\n".join(bare) + "\n")
    with pytest.raises(FormatError, match=r"there are no dates: .*--set rate=20"):
        imported(tmp_path / "bare.txt")
    with pytest.raises(FormatError, match=r"line \d+, column 'Frame #': .*--set run=1"):
        imported(tmp_path / "bare.txt", rate=RATE)
    for run, part in ((1, slice(0, 40)), (2, slice(40, 60))):
        stream = imported(tmp_path / "bare.txt", rate=RATE, run=run).streams["radar"]
        np.testing.assert_array_equal(stream.time_ns, times[part] - times[part][0])
    with pytest.raises(FormatError, match="run 3 of 2"):
        imported(tmp_path / "bare.txt", rate=RATE, run=3)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (",Doppler", ",Dopler", None),
        ("Frame #", "Number", "line 1: names no column frame"),
        ("\n101,", "\n101.5,", "is no whole number"),
        ("\n103,", "\n999,", "the number goes on by 897 in 0.1 s"),
        (",2024,5,1,23,59,40.100", ",2024,5,1,25,59,40.100", "column 'h': '25' is no hour"),
        (",2024,5,1,23,59,40.100", ",2024,13,1,23,59,40.100", "is of no date: month"),
        (",2024,5,1,23,59,40.300", ",2024,5,1,23,58,40.300", "the clock goes back"),
        (",2024,5,1,23,59,40.300", ",2024,5,1,23,59,40.200", r"is shared by frames: .*rate="),
        ("\n102,", "\n102,x,", "has 14 fields, needs 13"),
    ],
)
def test_what_breaks_the_table(tmp_path: Path, old: str, new: str, message: str | None):
    walker(tmp_path / "walk.csv")
    text = (tmp_path / "walk.csv").read_text()
    assert old in text
    (tmp_path / "walk.csv").write_text(text.replace(old, new))
    if message is None:
        assert "doppler" not in imported(tmp_path / "walk.csv").streams["radar"].rows
        return
    with pytest.raises(FormatError, match=message):
        imported(tmp_path / "walk.csv")


def test_a_doppler_of_the_other_sign_is_told(tmp_path: Path, caplog):
    walker(tmp_path / "walk.csv", noise=0.005)
    imported(tmp_path / "walk.csv")
    assert not caplog.records
    lines = (tmp_path / "walk.csv").read_text().splitlines()
    for i, line in enumerate(lines[1:], 1):
        words = line.split(",")
        words[5] = str(-float(words[5]))
        lines[i] = ",".join(words)
    (tmp_path / "walk.csv").write_text("\n".join(lines) + "\n")
    imported(tmp_path / "walk.csv")
    assert "sign of approaching" in caplog.text


def test_a_walk_of_2766_frames_in_one_command(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    log, out = tmp_path / "walk.csv", tmp_path / "walk.h5"
    times = walker(log, 2766, 1400, empty=(100, 101, 2000))
    assert main(["info", str(log)]) == 4
    assert "convert --from mmwave" in capfd.readouterr().err
    command = ["convert", "--from", "mmwave", str(log), "-o", str(out)]
    assert main([*command, "--set", "position=[1, 2, 1.5]", "--set", "yaw=90"]) == 0
    assert capfd.readouterr().err == ""
    assert main(["validate", "--strict", str(out)]) == 0
    from echoset import formats

    found = formats.read(out)
    np.testing.assert_array_equal(found.streams["radar"].time_ns, times)
    assert (np.diff(found.streams["radar"].row_offset) == 0).sum() == 3
    np.testing.assert_array_equal(found.sensors["radar"].position, [[1.0, 2.0, 1.5]])

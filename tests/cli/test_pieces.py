"""``cut`` takes pieces of recordings, ``join`` puts them together."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import builders

from echoset import formats
from echoset.formats import leaves
from echoset.models.records import Recording, Sensor, Stream, Truth


def made(**more) -> Recording:
    """A radar that sees k % 3 points in second k, a tag and two anchors, and a truth."""
    points = [[(float(k), float(j)) for j in range(k % 3)] for k in range(30)]
    objects = builders.objects([[(float(k), 0.0)] for k in range(30)])
    radar = builders.radar(points, p_detect=0.9)
    found = builders.recording({"R": radar}, objects)
    n = 60
    stream = builders.uwb([[1.0 + k] for k in range(n)], sigma=0.1)
    rx = np.arange(n, dtype="i4") % 2
    stream = replace(
        stream,
        nodes=("A", "B", "D"),
        time_ns=np.repeat(np.arange(30) * 10**9, 2),
        scan={"mode": np.zeros(n, "u1"), "tx": np.full(n, 2, "i4"), "rx": rx},
    )
    sensors = {
        "A": Sensor.static("anchor", np.zeros(2)),
        "B": Sensor.static("anchor", np.ones(2)),
        "D": Sensor.device(),
    }
    streams = {**found.streams, "uwb": stream}
    return replace(found, sensors={**found.sensors, **sensors}, streams=streams, **more)


@pytest.fixture(params=["h5", "mcap"])
def file(request, tmp_path: Path) -> Path:
    path = tmp_path / f"a.{request.param}"
    formats.write(made(), path, request.param)
    return path


def content(record: Recording) -> dict:
    return {
        k: v.tolist() if isinstance(v, np.ndarray) else v
        for k, v in leaves.of(record).items()
        if k != "provenance"
    }


@pytest.mark.parametrize("window", [4, 1024])
def test_halves_make_the_whole(run, file: Path, tmp_path: Path, monkeypatch, window: int):
    monkeypatch.setattr(formats.windows, "WINDOW", window)
    a, b, c = (tmp_path / f"{n}{file.suffix}" for n in "xyz")
    assert run("cut", file, "--stop", 14, "-o", a).code == 0
    assert run("cut", file, "--relative", "--start", 15, "-o", b).code == 0
    done = run("join", a, b, "-o", c)
    assert done.code == 0, done.err
    assert run("validate", "--strict", c).code == 0
    assert content(formats.read(c)) == content(formats.read(file))
    assert [p["name"] for p in formats.read(c).meta.provenance["joined"]] == ["small", "small"]
    done = run("join", b, a, "-o", tmp_path / "w.h5")
    assert done.code == 4 and "begins before the end" in done.err
    assert not (tmp_path / "w.h5").exists()


def test_a_piece(run, file: Path, tmp_path: Path):
    out = tmp_path / "p.h5"
    assert run("cut", file, "--start", 3, "--stop", 9, "--every", 2, "-o", out).code == 0
    found = formats.read(out)
    assert (found.streams["R"].time_ns // 10**9).tolist() == [3, 5, 7, 9]
    assert np.diff(found.streams["R"].row_offset).tolist() == [0, 2, 1, 0]
    assert found.streams["R"].rows["x"].tolist() == [5, 5, 7]
    assert (found.streams["uwb"].time_ns // 10**9).tolist() == [3, 3, 5, 5, 7, 7, 9, 9]
    assert (found.truth.objects.time_ns // 10**9).tolist() == list(range(3, 10))
    (told,) = found.meta.provenance["cut"]
    assert told["start"] == 3.0 and told["every"] == 2 and told["input"]["name"] == "small"


def test_streams_and_sensors(run, file: Path, tmp_path: Path):
    out = tmp_path / "p.h5"
    assert run("cut", file, "--sensors", "B", "-o", out).code == 0
    found = formats.read(out)
    assert list(found.streams) == ["uwb"] and set(found.sensors) == {"A", "B", "D"}
    assert found.streams["uwb"].rows["distance"].tolist() == [2.0 + 2 * k for k in range(30)]
    assert run("cut", file, "--streams", "R", "-o", tmp_path / "r.h5").code == 0
    assert set(formats.read(tmp_path / "r.h5").sensors) == {"R"}


def tagged() -> Recording:
    """The same with differences of distance to A and to B in turn, and the tag's odometry."""
    record = made()
    uwb = record.streams["uwb"]
    n = len(uwb)
    anchor = np.arange(n, dtype="i4") % 2
    scan = {
        "mode": np.full(n, 2, "u1"),
        "tx": np.full(n, 2, "i4"),
        "rx": anchor,
        "reference": (1 - anchor).astype("i4"),
    }
    rows = {**uwb.rows, "distance": -uwb.rows["distance"]}
    k = np.arange(300)
    motion = Stream(
        "odometry", ("D",), {}, k * 10**8, np.zeros(301, np.int64),
        {"velocity_x": k / 10.0, "turn_rate": np.full(300, 0.1)}, {},
    )  # fmt: skip
    three = replace(uwb, nodes=("A", "B", "D"), scan=scan, rows=rows)
    far = {**uwb.scan, "mode": scan["mode"], "reference": np.full(n, 3, "i4")}
    four = replace(uwb, nodes=("A", "B", "D", "C"), scan=far, rows=rows)
    streams = {**record.streams, "uwb": three, "far": four, "wheels": motion}
    sensors = {**record.sensors, "C": Sensor.static("anchor", np.full(2, 5.0))}
    return replace(record, sensors=sensors, streams=streams)


@pytest.mark.parametrize("form", ["h5", "mcap"])
def test_differences_and_odometry(run, tmp_path: Path, form: str):
    """Halves make the whole; each n-th scan leaves out no motion; a difference has three ends."""
    file, a, b, c = (tmp_path / f"{n}.{form}" for n in "fabc")
    formats.write(tagged(), file, form)
    assert run("cut", file, "--stop", 14.95, "-o", a).code == 0
    assert run("cut", file, "--start", 14.96, "-o", b).code == 0
    done = run("join", a, b, "-o", c)
    assert done.code == 0, done.err
    assert run("validate", "--strict", c).code == 0
    assert content(formats.read(c)) == content(formats.read(file))
    assert run("cut", file, "--every", 5, "-o", a, "--overwrite").code == 0
    found = formats.read(a).streams
    assert (found["uwb"].time_ns // 10**9).tolist() == [k for k in range(0, 30, 5) for _ in "AB"]
    assert found["wheels"].scan["velocity_x"].tolist() == [k / 10 for k in range(300)]
    assert run("cut", file, "--sensors", "A,B", "-o", a, "--overwrite").code == 0
    found = formats.read(a).streams
    assert len(found["uwb"]) == 60 and len(found["far"]) == 0 and len(found["wheels"]) == 300
    assert run("cut", file, "--sensors", "A,C", "-o", a, "--overwrite").code == 0
    found = formats.read(a).streams
    assert len(found["uwb"]) == 0 and found["far"].scan["rx"].tolist() == [0] * 30
    assert run("cut", file, "--streams", "wheels", "-o", a, "--overwrite").code == 0
    assert set(formats.read(a).sensors) == {"D"}


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (("--streams", "uwbb"), 2, "no stream 'uwbb' (did you mean 'uwb'?)"),
        (("--sensors", "C"), 2, "no sensor 'C'"),
        (("--start", "5", "--stop", "4"), 2, "stop must be start or later"),
        (("--every", "0"), 2, "every must be at least 1"),
        (("--start", "100"), 4, "no scan is in the piece"),
    ],
)
def test_what_cannot_be_cut(run, file: Path, tmp_path: Path, words, code: int, message: str):
    done = run("cut", file, *words, "-o", tmp_path / "p.h5")
    assert done.code == code and message in done.err
    assert not (tmp_path / "p.h5").exists()


def test_what_cannot_be_joined(run, tmp_path: Path):
    record = made()
    formats.write(record, tmp_path / "a.h5", "h5")
    others = {
        "streams": replace(record, streams={"R": record.streams["R"]}),
        "truth": replace(record, truth=None),
        "model": replace(
            record,
            streams={**record.streams, "R": replace(record.streams["R"], model={"p_detect": 0.5})},
        ),
    }
    for word, other in others.items():
        formats.write(other, tmp_path / f"{word}.h5", "h5")
        done = run("join", tmp_path / "a.h5", tmp_path / f"{word}.h5", "-o", tmp_path / "o.h5")
        assert done.code == 4 and word in done.err


def test_moving_sensors_keep_their_way(run, tmp_path: Path):
    """A radar that moves has the poses of all parts."""
    record = made()
    assert record.truth is not None
    for k, name in enumerate("ab"):
        t = np.arange(10) * 10**9 + k * 40 * 10**9
        way = Sensor("radar", t, np.column_stack([t * 1e-9, 0 * t, 0 * t]),
                     np.tile([0.0, 0, 0, 1], (10, 1)))  # fmt: skip
        stream = record.streams["R"]
        stream = replace(stream, time_ns=stream.time_ns + k * 40 * 10**9)
        o = record.truth.objects
        true = Truth(replace(o, time_ns=o.time_ns + k * 40 * 10**9))
        part = replace(record, sensors={"R": way}, streams={"R": stream}, truth=true)
        formats.write(part, tmp_path / f"{name}.h5", "h5")
    assert run("join", tmp_path / "a.h5", tmp_path / "b.h5", "-o", tmp_path / "c.h5").code == 0
    found = formats.read(tmp_path / "c.h5").sensors["R"]
    assert found.position[:, 0].tolist() == [*range(10), *range(40, 50)]

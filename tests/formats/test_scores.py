"""Scores come back bit by bit from each format, and damage is named with its place."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from echoset.formats import header
from echoset.formats.scores import read, write
from echoset.models.errors import FormatError, ParameterError
from echoset.models.records import Scores

FORMATS = ("csv", "json", "h5")
HEADER = "recording,estimator,metric,part,time,value,n,stderr\n"


def table() -> Scores:
    return Scores(
        ("a-s1-0000", 'odd "name",\nüß', "a-s1-0000"),
        ("e", "", "e"),
        ("rmse", "pcrlb", "cdf"),
        ("device", "", "device<=0.1"),
        np.array([0.1, np.nan, 1e9 + 0.1]),
        np.array([1 / 3, -5e-324, 1.7976931348623157e308]),
        np.array([1, 0, 2**40]),
        np.array([np.nan, 0.0, 2 / 3]),
        {"metrics": {"rmse": {"skip": 4}}, "versions": {"echoset": "0"}},
    )


def data(scores: Scores, format: str) -> bytes:
    target = io.BytesIO()
    write(scores, target, format)
    return target.getvalue()


@pytest.mark.parametrize("format", FORMATS)
def test_round_trip(format: str, tmp_path: Path) -> None:
    path = tmp_path / "scores"
    write(table(), path, format)
    assert path.read_bytes() == data(table(), format)
    for back in (read(path), read(io.BytesIO(path.read_bytes()))):
        for name in ("recording", "estimator", "metric", "part", "provenance"):
            assert getattr(back, name) == getattr(table(), name)
        for name in ("time", "value", "n", "stderr"):
            a, b = getattr(back, name), getattr(table(), name)
            np.testing.assert_array_equal(a, b)
            assert a.dtype == b.dtype


@pytest.mark.parametrize("format", FORMATS)
def test_empty_table(format: str) -> None:
    empty = Scores((), (), (), (), np.zeros(0), np.zeros(0), np.zeros(0, np.int64), np.zeros(0))
    back = read(io.BytesIO(data(empty, format)))
    assert len(back) == 0 and back.n.dtype == np.int64 and back.provenance == {}


@pytest.mark.parametrize("format", FORMATS)
@pytest.mark.parametrize(
    ("column", "value", "place"),
    [("value", np.nan, "row 2, value"), ("time", np.inf, "row 2, time"), ("n", -1, "row 2, n")],
)
def test_not_written(format: str, column: str, value: float, place: str) -> None:
    bad = table()
    getattr(bad, column)[1] = value
    with pytest.raises(FormatError, match=place):
        data(bad, format)


def test_unknown_format() -> None:
    with pytest.raises(ParameterError, match="xml"):
        data(table(), "xml")


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("", "line 0"),
        ("a,b\n", "line 1"),
        (HEADER + "r,e,m,p,0,1,1\n", "line 2"),
        (HEADER + "r,e,m,p,0,1,1,\nr,e,m,p,0,x,1,\n", "line 3"),
        (HEADER + "r,e,m,p,0,nan,1,\n", "line 2"),
        (HEADER + "r,e,m,p,0,1e999,1,\n", "line 2"),
        (HEADER + "r,e,m,p,0,,1,\n", "line 2"),
        (HEADER + "r,e,m,p,0,1_0,1,\n", "line 2"),
        (HEADER + "r,e,m,p,0,1,1.5,\n", "line 2"),
        (HEADER + "r,e,m,p,0,1,9999999999999999999,\n", "line 2"),
        (HEADER + "r,e,m,p,0,1,1,-1\n", "row 1, stderr"),
        (HEADER + 'r,e,m,"p,0,1,1,\n', "line 2"),
        (HEADER + "r" * 200_000 + ",e,m,p,0,1,1,\n", "line 2"),
        ("# provenance: {\n" + HEADER, "line 1"),
        ("# provenance: {}\n" + HEADER + "r\n", "line 3"),
    ],
)
def test_damaged_csv(text: str, where: str) -> None:
    with pytest.raises(FormatError) as caught:
        read(io.BytesIO(text.encode()), "f.csv")
    assert caught.value.where.startswith(where) and str(caught.value).startswith("f.csv: ")


def row(**change: object) -> str:
    names = HEADER.strip().split(",")
    good = dict(zip(names, ("r", "e", "m", "p", 0.0, 1.0, 1, None), strict=True))
    return '{"provenance": {}, "scores": [\n' + json.dumps(good | change) + "\n]}"


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("{", "line 1"),
        ('{"provenance": {}}', "line 1"),
        ('{"provenance": [], "scores": []}', "line 1"),
        ('{"provenance": {}, "scores": {}}', "scores"),
        ('{"provenance": {}, "scores": [1]}', "line 2"),
        (row(more=1), "line 2"),
        (row(value=None), "line 2"),
        (row(value=True), "line 2"),
        (row(value=10**400), "line 2"),
        (row(n=1.0), "line 2"),
        (row(n=2**63), "line 2"),
        (row(part=3), "line 2"),
        (row(value=float("nan")), ""),
        (row(value=0).replace('"value": 0', '"value": 1e999'), "line 2"),
        ('{"a":' * 100_000, ""),
    ],
)
def test_damaged_json(text: str, where: str) -> None:
    with pytest.raises(FormatError) as caught:
        read(io.BytesIO(text.encode()), "f.json")
    assert caught.value.where.startswith(where)


@pytest.mark.parametrize(
    "damage",
    [
        lambda b: b[: len(b) // 2],
        lambda b: b[:40],
        lambda b: b.replace(b"device", b"devise"),
        lambda b: b + b"x",
        lambda b: b"\xff" + b,
    ],
)
def test_damaged_hdf5(damage: Callable[[bytes], bytes]) -> None:
    whole = data(table(), "h5")
    broken = damage(whole)
    assert broken != whole
    with pytest.raises(FormatError, match=r"f\.h5"):
        read(io.BytesIO(broken), "f.h5")


def test_other_files(tmp_path: Path) -> None:
    with pytest.raises(FormatError, match="No such file"):
        read(tmp_path / "none.csv")
    with pytest.raises(FormatError, match="directory"):
        read(tmp_path)


def test_headers_tell_that_it_is_scores(tmp_path: Path) -> None:
    write(table(), tmp_path / "s.h5", "h5")
    found = header(tmp_path / "s.h5")
    assert found["kind"] == "scores" and "name" not in found
    (tmp_path / "s.h5").write_bytes((tmp_path / "s.h5").read_bytes()[:-9])
    with pytest.raises(FormatError, match="superblock"):
        header(tmp_path / "s.h5")

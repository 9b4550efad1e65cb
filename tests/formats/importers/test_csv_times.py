"""Times of logs that are not what they seem: restarts, stamps that collapse, stray stamps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from echoset.formats.importers.csv import importer as csv
from echoset.models.errors import FormatError
from echoset.models.records import Recording

RANGES: dict[str, Any] = {
    "kind": "uwb",
    "columns": {"time": "t", "anchor": "id", "distance": "r"},
    "anchors": {"A": [0, 0], "B": [4, 0]},
}
POINTS: dict[str, Any] = {"kind": "position", "columns": {"time": "t", "x": "r", "y": "r"}}


def read(folder: Path, said: dict[str, Any], times: Any, ids: str = "A") -> Recording:
    rows = "".join(f"{t},{ids[k % len(ids)]},{k + 1}\n" for k, t in enumerate(times))
    log = folder / "log.csv"
    log.write_text("t,id,r\n" + rows)
    return csv.read([log], csv.Params(said))


def seconds(log: Recording) -> list[float]:
    (stream,) = log.streams.values()
    return (stream.time_ns * 1e-9).tolist()


@pytest.mark.parametrize("said", [RANGES, POINTS])
def test_a_counter_that_restarts_is_refused(tmp_path: Path, said: dict[str, Any]):
    passes = [0, 1, 2, 3, 0, 1, 2, 3]
    with pytest.raises(FormatError, match=r"line 6, column 't': '0': .* 'restarts'"):
        read(tmp_path, said, passes)
    log = read(tmp_path, said | {"restarts": "sort"}, passes)
    assert len(log.streams["uwb" if said is RANGES else "radar"].rows) > 0


def test_restarts_are_passes_or_go_on(tmp_path: Path):
    passes = [0, 1, 2, 3, 0, 1, 2]
    for run, rows in ((1, [1, 2, 3, 4]), (2, [5, 6, 7])):
        log = read(tmp_path, RANGES | {"restarts": "split", "run": run}, passes)
        assert seconds(log) == list(range(len(rows)))
        assert log.streams["uwb"].rows["distance"].tolist() == rows
    with pytest.raises(FormatError, match="2 runs, there is no run 3"):
        read(tmp_path, RANGES | {"restarts": "split", "run": 3}, passes)
    log = read(tmp_path, RANGES | {"restarts": "wrap"}, passes)
    assert seconds(log) == [0, 1, 2, 3, 4, 5, 6]
    assert log.streams["uwb"].rows["distance"].tolist() == [1, 2, 3, 4, 5, 6, 7]


def test_rows_that_are_late_or_of_links_one_after_the_other_are_sorted(tmp_path: Path):
    assert seconds(read(tmp_path, RANGES, [0, 2, 1, 4, 3, 5])) == [0, 1, 2, 3, 4, 5]
    blocks = [0, 1, 2, 3, 0, 1, 2, 3]
    assert seconds(read(tmp_path, RANGES, blocks, "AAAABBBB")) == [0, 0, 1, 1, 2, 2, 3, 3]


@pytest.mark.parametrize("said", [RANGES, POINTS])
@pytest.mark.parametrize("stamps", [["1.73234e+09"] * 40, ["1732340000"] * 3 + ["1732340001"] * 3])
def test_stamps_that_collapse_are_refused(tmp_path: Path, said: dict[str, Any], stamps):
    with pytest.raises(FormatError, match=r"line 3, column 't': '1.*whole seconds.*shared_times"):
        read(tmp_path, said, stamps)
    log = read(tmp_path, said | {"shared_times": True}, stamps)
    assert len(seconds(log)) == len(set(stamps))


def test_whole_seconds_of_different_links_are_no_collapse(tmp_path: Path):
    stamps = [1732340000, 1732340000, 1732340001, 1732340001]
    assert len(seconds(read(tmp_path, RANGES, stamps, "AB"))) == 4


@pytest.mark.parametrize("said", [RANGES, POINTS])
@pytest.mark.parametrize("place", [0, 2, 4])
def test_a_stray_stamp_is_refused(tmp_path: Path, said: dict[str, Any], place: int):
    stamps = [1732340000.5 + k for k in range(5)]
    stamps[place] = 0.0
    with pytest.raises(
        FormatError, match=rf"line {place + 2}, column 't': '0.0' .* 'longest_pause'"
    ):
        read(tmp_path, said, stamps)
    assert seconds(read(tmp_path, said | {"longest_pause": 2e9}, stamps))[0] == 0


def test_stray_stamps_and_restarts_of_further_tables(tmp_path: Path):
    for table, place, word in (
        ("t,x,y\n0,0,0\n1732340000,1,1\n1732340001,1,1\n", "line 2", "longest_pause"),
        ("t,x,y\n0,0,0\n1,1,1\n2,1,1\n0.5,1,1\n1.5,2,2\n", "line 5", "restarts"),
    ):
        (tmp_path / "g.csv").write_text(table)
        columns = {"time": "t", "device_x": "x", "device_y": "y"}
        said = RANGES | {"truth": {"file": "g.csv", "columns": columns}}
        with pytest.raises(FormatError, match=rf"g\.csv: {place}, column 't'.*{word}"):
            read(tmp_path, said, [0, 1, 2])

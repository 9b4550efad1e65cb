"""Mappings that are proposed: layouts as makers have them, from the log to the ranges."""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from echoset.formats.importers.csv import importer as csv
from echoset.formats.importers.csv.propose import propose
from echoset.models.plain_yaml import parse

N = 60
ANCHORS = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 5.0], [0.0, 5.0]])
T = 0.1 * np.arange(N)
TAG = np.column_stack([1.0 + 0.05 * np.arange(N), 1.0 + 0.04 * np.arange(N)])
R = np.linalg.norm(TAG[:, None] - ANCHORS, axis=2)
START = datetime(2024, 5, 1, 12, 0, tzinfo=UTC)


def stamp(k: int, form: str) -> str:
    text = (START + timedelta(milliseconds=100 * k)).strftime(form)
    return text[:-3] if form.endswith("%f") else text


def wide(row: Callable[[int], str], header: str = "", d: str = ",", unit: float = 1.0) -> str:
    digits = 3 if unit == 1 else 0
    lines = [
        d.join([row(k), *(f"{unit * r:.{digits}f}" for r in R[k])]) for k in range(N)
    ]  # fmt: skip
    return "\n".join([*([header] if header else []), *lines]) + "\n"


def long(row: Callable[[int, int], str], header: str) -> str:
    lines = [row(k, a) for k in range(N) for a in range(4)]
    return "\n".join([header, *lines]) + "\n"


LAYOUTS: dict[str, str] = {
    "long": long(lambda k, a: f"{T[k]:.1f},A{a},{R[k, a]:.3f}", "time,anchor,range"),
    "long in cm and ms": long(
        lambda k, a: f"{100 * k},{a},{100 * R[k, a]:.1f},0.9", "stamp_ms,anchor_id,range_cm,quality"
    ),
    "long with tags": long(
        lambda k, a: f"{T[k]:.1f},T7,A{a},{1000 * R[k, a]:.0f}", "t,tag,anchor,distance [mm]"
    ),
    "long with semicolons and decimal commas": long(
        lambda k, a: f"{T[k]:.1f};A{a};{R[k, a]:.3f}".replace(".", ","), "t;anchor;distance"
    ),
    "long with MAC addresses": long(
        lambda k, a: f"{stamp(k, '%Y-%m-%dT%H:%M:%S.%f')}Z,00:1B:{a:02X},{R[k, a]:.3f}",
        "timestamp,node,range_m",
    ),
    "Unix seconds": long(
        lambda k, a: f"{1714564800 + T[k]:.3f},{a},{R[k, a]:.3f}", "unix,beacon,dist"
    ),
    "Unix milliseconds": long(
        lambda k, a: f"{1714564800000 + 100 * k},{a},{R[k, a]:.3f}", "timestamp,anchor,range"
    ),
    "Unix nanoseconds": long(
        lambda k, a: f"{1714564800000000000 + 100000000 * k},{a},{R[k, a]:.3f}",
        "timestamp,anchor,range",
    ),
    "seconds and nanoseconds": long(
        lambda k, a: f"{1714564800 + k // 10},{k % 10 * 10**8},{a},{R[k, a]:.3f}",
        "sec,nanosec,anchor,range",
    ),
    "wide": wide(lambda k: f"{T[k]:.1f}", "t,r0,r1,r2,r3"),
    "wide in mm with tabs": wide(lambda k: str(100 * k), "time_ms\td1\td2\td3\td4", "\t", 1000),
    "wide with anchors and a tag": wide(
        lambda k: stamp(k, "%Y-%m-%d %H:%M:%S.%f"), "time,a0-t0,a1-t0,a2-t0,a3-t0"
    ),
    "wide without a header": wide(lambda k: stamp(k, "%Y-%m-%d %H:%M:%S.%f")),
    "wide with digits of the time": wide(
        lambda k: stamp(k, "%H%M%S.%f").replace(".", "") + "\t0", "", "\t", 1000
    ),
    "wide with the time of day": wide(lambda k: stamp(k, "%H:%M:%S.%f"), "clock,A1,A2,A3,A4"),
    "date and time in two columns": wide(
        lambda k: stamp(k, "%Y-%m-%d,%H:%M:%S.%f"), "date,time,range_1,range_2,range_3,range_4"
    ),
    "six columns of the time": wide(
        lambda k: f"2024,5,1,12,0,{T[k]:.3f}", "y,m,d,h,min,s,range1,range2,range3,range4"
    ),
    "blanks": wide(lambda k: f"  {T[k]:.1f}", "time  r_1  r_2  r_3  r_4", "   "),
    "comments": "% made by hand\n" + wide(lambda k: f"{T[k]:.1f}", "t,r0,r1,r2,r3"),
    "words for nothing": wide(lambda k: f"{T[k]:.1f}", "t,r0,r1,r2,r3")
    + "6.0,nan,nan,nan,nan\n6.1,-,0.0,-1,-\n",
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_what_is_proposed_needs_only_the_anchors(tmp_path: Path, layout: str):
    log = tmp_path / "log.csv"
    log.write_text(LAYOUTS[layout])
    places = iter(ANCHORS.tolist())
    text = re.sub(r"\[x, y\]", lambda _: str(next(places)), propose(log))
    assert text.count("\n") <= 25
    (tmp_path / "log.yaml").write_text(text)
    found = csv.read([log], csv.Params(str(tmp_path / "log.yaml")))
    uwb = found.streams["uwb"]
    assert len(uwb.nodes) == 5, "four anchors and a device"
    seen = np.diff(uwb.row_offset) == 1
    time, rx = uwb.time_ns[seen][: 4 * N], uwb.scan["rx"][seen][: 4 * N]
    np.testing.assert_allclose((time - time[0]) * 1e-9, np.repeat(T, 4), atol=1e-6)
    np.testing.assert_array_equal(rx, np.tile([1, 2, 3, 4], N))
    np.testing.assert_allclose(uwb.rows["distance"], R.ravel(), atol=6e-4)


def test_radar_tables(tmp_path: Path):
    log = tmp_path / "log.csv"
    log.write_text("frame,range,azimuth_deg,doppler\n0,10,45,1\n0,12,-45,2\n1,11,40,1\n1,13,30,3\n")
    said = parse(propose(log), "proposal")
    assert said["kind"] == "range_bearing"
    assert said["columns"] == {
        "time": {"column": "frame", "scale": 0.1},
        "range": "range",
        "azimuth": {"column": "azimuth_deg", "unit": "deg"},
        "doppler": "doppler",
    }
    log.write_text("t,x,y,v\n0,1,2,1\n0,3,4,2\n1,5,6,1\n")
    said = parse(propose(log), "proposal")
    assert said == {
        "kind": "position", "columns": {"time": "t", "x": "x", "y": "y", "doppler": "v"}
    }  # fmt: skip


@pytest.mark.parametrize(
    ("header", "value"), [("dt_ns", 10.0), ("tdoa_m", 2.99792458), ("range_diff_mm", 2997.92458)]
)
def test_differences_to_a_reference(tmp_path: Path, header: str, value: float):
    """The second anchor is farther by 10 ns, the third nearer: no row is skipped for that."""
    log = tmp_path / "log.csv"
    log.write_text(f"t,ref,anchor,{header}\n" + f"0,A0,A1,{value}\n0,A0,A2,{-value}\n" * 5)
    text = propose(log)
    assert "skip" not in text and "reference: ref" in text
    said = parse(text.replace("[x, y]", "[0, 0]"), "proposal")
    said["shared_times"] = True
    found = csv.read([log], csv.Params(said)).streams["uwb"]
    assert sorted(found.nodes) == ["A0", "A1", "A2", "device"]
    np.testing.assert_allclose(np.abs(found.rows["distance"]), 2.99792458, rtol=1e-12)
    assert (found.scan["reference"] == found.nodes.index("A0")).all()


def test_guesses_and_gaps_are_marked(tmp_path: Path):
    log = tmp_path / "log.csv"
    log.write_text("a,b,c\n0,1,7.5\n1,2,8.5\n2,1,9.0\n")
    text = propose(log)
    assert "time: a  # guessed" in text
    assert "FILL IN where they stand" in text
    log.write_text("t,anchor,range\n" + "".join(f"{t},A,1.5\n" for t in [0, 1, 2, 3, 0, 1, 2]))
    assert "restarts: split  # guessed" in propose(log)


@pytest.mark.parametrize("seed", range(3))
def test_any_text_gets_a_proposal(tmp_path: Path, seed: int):
    rng = np.random.default_rng(seed)
    log = tmp_path / "log.csv"
    for _ in range(60):
        words = rng.choice(
            ["0", "1.5", "nan", "a", "t", "x,y", ";", ",", "\t", " ", "\n", "#", "-", "2024-05-01",
             "12:00:00", '"', "r1", "r2", "é", "1e999", "_", "frame", "azimuth"],
            rng.integers(1, 60),
        )  # fmt: skip
        log.write_text("x" + "".join(words))
        assert isinstance(parse(propose(log), "proposal"), dict)

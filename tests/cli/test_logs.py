"""Logs of ranges as people have them: from the file to a score and a picture, by mapping alone.

Each layout is a walk of 16 s past four anchors with its truth, as one maker or another would have
written it. The score of what comes out says that times, ranges, ids and truth came in rightly.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

from echoset import formats

N = 160
T = 0.1 * np.arange(N)
ANCHORS = np.array([[0.0, 0.0], [6.0, 0.0], [6.0, 5.0], [0.0, 5.0]])
TAG = np.column_stack([3 + 2 * np.sin(0.4 * T), 2.5 + 1.5 * np.cos(0.4 * T)])
R = np.linalg.norm(TAG[:, None] - ANCHORS, axis=2)
R = R + 0.03 * np.random.default_rng(2).standard_normal(R.shape)
START = datetime(2022, 8, 15, 9, 42, 24, tzinfo=UTC)
PLACES = "anchors: {0: [0, 0], 1: [6, 0], 2: [6, 5], 3: [0, 5]}\n"
STD = "std: {value: 0.1}"


def stamp(k: int, form: str) -> str:
    text = (START + timedelta(milliseconds=100 * k)).strftime(form)
    return text[:-3] if form.endswith("%f") else text


def wide(stamp: Callable[[int], str], header: str = "", d: str = ",", unit: float = 1.0) -> str:
    digits = 3 if unit == 1 else 0
    rows = [d.join([stamp(k), *(f"{unit * r:.{digits}f}" for r in R[k])]) for k in range(N)]
    return "\n".join([*([header] if header else []), *rows]) + "\n"


def long(row: Callable[[int, int], str], header: str) -> str:
    return "\n".join([header, *(row(k, a) for k in range(N) for a in range(4))]) + "\n"


def truth(place: np.ndarray = TAG, time: np.ndarray = T, header: str = "t,x,y") -> str:
    rows = [f"{t:.3f},{x:.6f},{y:.6f}" for t, (x, y) in zip(time, place, strict=True)]
    return "\n".join([header, *rows]) + "\n"


def told(text: str = "", dialect: str = "") -> str:
    """What a mapping says of the truth; times of the log are those after its first."""
    own = dialect or 'delimiter: ",", decimal: ".", header: true'
    columns = "columns: {time: t, device_x: x, device_y: y}"
    return f"truth: {{file: g.csv, {own}, {columns}{text}}}\n"


def fixes(place: np.ndarray) -> np.ndarray:
    """Latitudes and longitudes [deg] of places (k, 2) [m] at 48.1 N 11.5 E, by the radii there."""
    a, e2, lat = 6378137.0, 0.00669437999014, np.radians(48.1)
    w = np.sqrt(1 - e2 * np.sin(lat) ** 2)
    north, east = a * (1 - e2) / w**3, a * np.cos(lat) / w
    return np.column_stack([48.1, 11.5]) + np.degrees(place[:, ::-1] / [north, east])


def geodetic() -> tuple[str, str, str]:
    """Anchors and truth by latitude and longitude."""
    rows = zip(T, *fixes(TAG).T, strict=True)
    true = "t,lat,lon\n" + "".join(f"{t:.1f},{a:.9f},{b:.9f}\n" for t, a, b in rows)
    places = (f"{k}: {{lat: {a:.9f}, lon: {b:.9f}}}" for k, (a, b) in enumerate(fixes(ANCHORS)))
    return (
        long(lambda k, a: f"{T[k]:.1f},{a},{R[k, a]:.3f}", "t,anchor,r"),
        f"kind: uwb\ncolumns: {{time: t, anchor: anchor, distance: r, {STD}}}\n"
        f"anchors: {{{', '.join(places)}}}\n"
        "truth: {file: g.csv, columns: {time: t, device_lat: lat, device_lon: lon}}\n",
        true,
    )


CLOCK = ", clock: {offset: 1660556544 s}"
"""2022-08-15T09:42:24Z, at which the walk begins."""
LAYOUTS: dict[str, tuple[str, str, str]] = {
    "one column per anchor, no header, dates": (
        wide(lambda k: stamp(k, "%Y-%m-%d %H:%M:%S.%f")),
        'kind: uwb\nnames: [t, r0, r1, r2, r3]\n'
        f'columns: {{time: t, distance: {{pattern: "r{{anchor}}"}}, {STD}}}\n'
        + PLACES + told(CLOCK),
        truth(),
    ),
    "one column per anchor and tag": (
        wide(lambda k: f"{T[k]:.1f}", "t,a0-t0,a1-t0,a2-t0,a3-t0"),
        'kind: uwb\nrename: {device: {0: T0}}\n'
        f'columns: {{time: t, distance: {{pattern: "a{{anchor}}-t{{device}}"}}, {STD}}}\n'
        + PLACES + told(),
        truth(),
    ),
    "tabs, mm, HHMMSSmmm": (
        wide(lambda k: stamp(k, "%H%M%S.%f").replace(".", "") + "\t0", d="\t", unit=1000),
        'kind: uwb\ndelimiter: "\\t"\nnames: [t, tag, r0, r1, r2, r3]\nrename: {device: {0: T0}}\n'
        "columns:\n  time: {column: t, format: HHMMSSmmm, date: 2022-08-15}\n  device: tag\n"
        f'  distance: {{pattern: "r{{anchor}}", unit: mm}}\n  {STD}\n' + PLACES + told(CLOCK),
        truth(),
    ),
    "the time of day": (
        wide(lambda k: stamp(k, "%H:%M:%S.%f"), "clock,r0,r1,r2,r3"),
        'kind: uwb\ncolumns:\n  time: {column: clock, date: 2022-08-15}\n'
        f'  distance: {{pattern: "r{{anchor}}"}}\n  {STD}\n' + PLACES + told(CLOCK),
        truth(),
    ),
    "a date in six columns": (
        wide(lambda k: f"2022,8,15,9,42,{24 + T[k]:.3f}", "y,m,d,h,min,s,r0,r1,r2,r3"),
        "kind: uwb\ncolumns:\n  time: {columns: [y, m, d, h, min, s], "
        'format: "YYYY MM DD HH MM SS.f"}\n'
        f'  distance: {{pattern: "r{{anchor}}"}}\n  {STD}\n' + PLACES + told(CLOCK),
        truth(),
    ),
    "seconds and nanoseconds": (
        wide(lambda k: f"{k // 10},{k % 10 * 10**8}", "sec,nsec,r0,r1,r2,r3"),
        "kind: uwb\ncolumns:\n  time: {columns: [sec, nsec], unit: [s, ns]}\n"
        f'  distance: {{pattern: "r{{anchor}}"}}\n  {STD}\n' + PLACES + told(),
        truth(),
    ),
    "ticks that wrap at 2^40": (
        wide(lambda k: str(round(T[k] * 63.8976e9) % (1 << 40)), "ticks,r0,r1,r2,r3"),
        "kind: uwb\ncolumns:\n  time: {column: ticks, rate: 63.8976e9, bits: 40}\n"
        f'  distance: {{pattern: "r{{anchor}}"}}\n  {STD}\n' + PLACES + told(),
        truth(),
    ),
    "frame counters that restart": (
        wide(lambda k: str(k % 80), "frame,r0,r1,r2,r3"),
        "kind: uwb\nrestarts: wrap\ncolumns:\n  time: {column: frame, scale: 0.1}\n"
        f'  distance: {{pattern: "r{{anchor}}"}}\n  {STD}\n' + PLACES + told(", restarts: error"),
        truth(),
    ),
    "zeros, nan, dashes and negative values for no range": (
        long(
            lambda k, a: f"{T[k]:.1f},{a},"
            + ("0.0", "nan", "-", "-1.5", f"{R[k, a]:.3f}")[min((7 * k + a) % 9, 4)],
            "t,anchor,r",
        ),
        'kind: uwb\nmissing: [nan, "-"]\nskip: distance <= 0\n'
        f"columns: {{time: t, anchor: anchor, distance: r, {STD}}}\n" + PLACES + told(),
        truth(),
    ),
    "ids: a number that is anchor and tag, addresses": (
        long(
            lambda k, a: f"{T[k]:.1f},0,{('0', '12:AF', '00:1B', '7C:02')[a]},{R[k, a]:.3f}",
            "t,tag,anchor,r",
        ),
        "kind: uwb\nrename: {device: {0: T0}}\n"
        f"columns: {{time: t, device: tag, anchor: anchor, distance: r, {STD}}}\n"
        'anchors: {0: [0, 0], "12:AF": [6, 0], "00:1B": [6, 5], "7C:02": [0, 5]}\n' + told(),
        truth(),
    ),
    "truth turned, shifted, late and with doubled stamps": (
        long(lambda k, a: f"{T[k]:.1f},{a},{R[k, a]:.3f}", "t,anchor,r"),
        f"kind: uwb\ncolumns: {{time: t, anchor: anchor, distance: r, {STD}}}\n"
        + PLACES + told(", repeats: first, align: both"),
        truth(np.repeat(np.array([3, -2]) - TAG, 2, axis=0), np.repeat(T - 0.7, 2)),
    ),
    "a truth of marks seconds apart": (
        long(lambda k, a: f"{T[k]:.1f},{a},{R[k, a]:.3f}", "t,anchor,r"),
        f"kind: uwb\ncolumns: {{time: t, anchor: anchor, distance: r, {STD}}}\n"
        + PLACES + told(),
        truth(TAG[::40], T[::40]),
    ),
    "several tags on one body": (
        wide(lambda k: f"{T[k]:.1f}," + ",".join(f"{r + 1:.3f}" for r in R[k]),
             "t,a0-t1,a1-t1,a2-t1,a3-t1,a0-t0,a1-t0,a2-t0,a3-t0"),
        'kind: uwb\nrename: {device: {0: T0, 1: T1}}\nskip: device != \'T0\'\n'
        f'columns: {{time: t, distance: {{pattern: "a{{anchor}}-t{{device}}"}}, {STD}}}\n'
        + PLACES + told(),
        truth(),
    ),
    "semicolons and decimal commas": (
        wide(lambda k: f"{T[k]:.1f}", "t,r0,r1,r2,r3", d=";").replace(".", ",")
        .replace("t,r0,r1,r2,r3", "t;r0;r1;r2;r3"),
        'kind: uwb\ndelimiter: ";"\ndecimal: ","\n'
        f'columns: {{time: t, distance: {{pattern: "r{{anchor}}"}}, {STD}}}\n' + PLACES + told(),
        truth(),
    ),
}  # fmt: skip
LAYOUTS["latitude and longitude"] = geodetic()
SPARSE = {"a truth of marks seconds apart"}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_from_the_log_to_the_score(run, tmp_path: Path, monkeypatch, layout: str):
    log, mapping, true = LAYOUTS[layout]
    assert mapping.count("\n") <= 25
    if layout == "latitude and longitude":
        pytest.importorskip("pyproj", reason="the extra echoset[geo] is not installed")
    monkeypatch.chdir(tmp_path)
    for name, text in (("log.csv", log), ("log.yaml", mapping), ("g.csv", true)):
        Path(name).write_text(text)
    done = run("convert", "--from", "csv", "log.csv", "--mapping", "log.yaml", "-o", "log.h5")
    assert done.code == 0, done.err
    fast = ["--set", "learn=[]", "--set", "particles=300", "--set", "range_bias_std=0"]
    done = run("estimate", "-e", "position", *fast, "log.h5", "-o", "est.h5")
    assert done.code == 0, done.err
    done = run(
        "score", "est.h5", "--truth", "log.h5", "-m", "rmse", "--set", "skip=20", "-o", "s.csv"
    )
    assert done.code == 0, done.err
    scores = formats.scores.read(Path("s.csv"), "s.csv").where(metric="rmse", timed=False)
    # Four ranges of 3 cm a tenth of a second leave some centimetres; marks 4 s apart cut corners.
    assert scores.value[0] < (0.6 if layout in SPARSE else 0.12)
    assert scores.n[0] > 100
    # The picture: the truth and the estimates above the anchors, on time axes that start at 0.
    done = run("plot", "scene", "log.h5", "est.h5", "-o", "scene.svg")
    assert done.code == 0, done.err
    shown = set(re.findall(r"<text[^>]*>([^<]*)</text>", Path("scene.svg").read_text()))
    assert {"truth, device", "position, device", "anchor"} <= shown
    assert shown & {"0", "0.0"} and shown & {"15", "15.0"} and not any("e+" in t for t in shown)

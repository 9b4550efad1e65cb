"""Logs whose meaning was changed by one slip: refused, or taken with a warning, never in silence.

The slips are those of people and programs: a sign is lost, a unit taken for another, a row doubled,
a counter wraps, columns change places, a decimal point moves, digits are cut, a row goes elsewhere.
A slip is of a cell, or of a column from top to bottom. What it changes by less than half a metre
(ten for radar points, 1 m/s for their Doppler), or than two intervals, nobody can tell from noise,
and is not counted; nor are single points of radars, which look as clutter does, nor a whole column
of times that is stretched by less than units are where nothing else tells the time.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from echoset.formats.importers.csv import importer as csv
from echoset.models.errors import EchosetError
from echoset.models.records import Recording

ANCHORS = {"A": [0.0, 0.0], "B": [8.0, 0.5], "C": [7.0, 6.0], "D": [-1.0, 5.0], "E": [3.5, 8.0]}
PLACES = np.array(list(ANCHORS.values()))
N, STEP = 240, 0.1
T = np.arange(N) * STEP
START = datetime(2024, 5, 1, 12, 0, tzinfo=UTC)


def walked(t: np.ndarray) -> np.ndarray:
    """A walk of 24 s with both signs in both coordinates."""
    return np.column_stack([3 + 5 * np.sin(0.5 * t), 3 + 4.5 * np.cos(0.37 * t + 0.4)])


NOISE = np.random.default_rng(8).standard_normal((N, len(PLACES)))
RANGES = np.linalg.norm(walked(T)[:, None] - PLACES, axis=2) + 0.04 * NOISE


@dataclass
class Log:
    """Files of cells, the mapping, and by file and column what a slip may change.

    ``cells`` are columns of which a single cell counts; ``columns`` are those that only count from
    top to bottom; ``ids`` are names.
    """

    files: dict[str, list[list[str]]]
    said: dict[str, Any]
    cells: list[tuple[str, int]]
    columns: list[tuple[str, int]] = field(default_factory=list)
    times: list[tuple[str, int]] = field(default_factory=list)
    delimiter: str = ","

    def write(self, folder: Path) -> None:
        for name, rows in self.files.items():
            text = "\n".join(self.delimiter.join(row) for row in rows) + "\n"
            (folder / name).write_text(text)

    def read(self, folder: Path) -> Recording:
        self.write(folder)
        return csv.read([folder / "log.csv"], csv.Params(self.said))


def truth_rows() -> list[list[str]]:
    rows = [[f"{t:.1f}", f"{x:.3f}", f"{y:.3f}"] for t, (x, y) in zip(T, walked(T), strict=True)]
    return [["t", "x", "y"], *rows]


def truth(**more: Any) -> dict[str, Any]:
    columns = {"time": "t", "device_x": "x", "device_y": "y"}
    return {"truth": {"file": "g.csv", "columns": columns} | more}


def long(with_truth: bool) -> Log:
    """One range a row."""
    rows = [["t", "id", "r"]]
    rows += [
        [f"{T[k]:.1f}", name, f"{RANGES[k, a]:.3f}"]
        for k in range(N)
        for a, name in enumerate("ABCDE")
    ]
    said = {
        "kind": "uwb",
        "columns": {"time": "t", "anchor": "id", "distance": "r"},
        "anchors": ANCHORS,
    }
    log = Log({"log.csv": rows}, said, [("log.csv", 2)], times=[("log.csv", 0)])
    if with_truth:
        log.said |= truth()
        log.files["g.csv"] = truth_rows()
        log.cells += [("g.csv", 1), ("g.csv", 2)]
        log.times += [("g.csv", 0)]
    return log


def wide(unit: float, stamp: Callable[[int], str], time: Any, d: str, **more: Any) -> Log:
    """A column for each anchor."""
    digits = 0 if unit == 1000 else 3
    body = [[stamp(k), *(f"{unit * r:.{digits}f}" for r in RANGES[k])] for k in range(N)]
    if more.get("decimal") == ",":
        body = [[row[0], *(f.replace(".", ",") for f in row[1:])] for row in body]
    said = {
        "kind": "uwb",
        "delimiter": d,
        "columns": {
            "time": time,
            "distance": {"pattern": "r{anchor}", "unit": "mm" if unit == 1000 else "m"},
        },
        "anchors": ANCHORS,
    } | more
    rows = [["t", *(f"r{name}" for name in ANCHORS)], *body]
    cells = [("log.csv", k) for k in range(1, 6)]
    return Log({"log.csv": rows}, said, cells, times=[("log.csv", 0)], delimiter=d)


def clock(k: int, form: str) -> str:
    return (START + timedelta(milliseconds=100 * k)).strftime(form)[:-3]


def anchored() -> Log:
    """Anchors in a file of their own."""
    log = long(True)
    log.files["a.csv"] = [["id", "x", "y"], *([n, *map(str, p)] for n, p in ANCHORS.items())]
    log.said["anchors"] = {"file": "a.csv", "columns": {"id": "id", "x": "x", "y": "y"}}
    log.cells += [("a.csv", 1), ("a.csv", 2)] * 2
    return log


def radar(bearing: bool) -> Log:
    """Two vehicles seen once a second from the origin, with speeds and some clutter."""
    rng = np.random.default_rng(9)
    rows, true = [], [["t", "x", "y", "id"]]
    for k in range(100):
        p = np.array([[110 - 1.5 * k, 40.0 - 0.8 * k], [-118 + 0.1 * k, -80 + 0.4 * k]])
        v = np.array([[-1.5, -0.8], [0.1, 0.4]])
        true += [[str(k), f"{x:.2f}", f"{y:.2f}", str(i)] for i, (x, y) in enumerate(p)]
        rate = np.sum(p * v, axis=1) / np.linalg.norm(p, axis=1)
        p = np.concatenate([p + rng.normal(0, 0.3, p.shape), rng.uniform(-90, 90, (2, 2))])
        for (x, y), s in zip(p, [*rate, *rng.normal(0, 1, 2)], strict=True):
            angle = np.degrees(np.arctan2(y, x))
            place = (
                [f"{np.hypot(x, y):.2f}", f"{angle:.2f}"] if bearing else [f"{x:.2f}", f"{y:.2f}"]
            )
            rows.append([str(k), *place, f"{s:.3f}"])
    model = {"max_range": 180.0} if bearing else {"clutter_region": [-130, 130, -130, 130]}
    columns = {"range": "a", "azimuth": {"column": "b", "unit": "deg"}}
    said = {
        "kind": "range_bearing" if bearing else "position",
        "columns": {"time": "t", "doppler": "v"} | (columns if bearing else {"x": "a", "y": "b"}),
        "model": model,
        "truth": {"file": "g.csv", "columns": {"time": "t", "x": "x", "y": "y", "label": "id"}},
    }
    files = {"log.csv": [["t", "a", "b", "v"], *rows], "g.csv": true}
    columns_only = [("log.csv", k) for k in (1, 2, 3)]
    cells, times = [("g.csv", 1), ("g.csv", 2)], [("log.csv", 0), ("g.csv", 0)]
    return Log(files, said, cells, columns_only, times)


BASES: dict[str, Callable[[], Log]] = {
    "long": lambda: long(False),
    "long with truth": lambda: long(True),
    "anchors in a file": anchored,
    "wide, dates": lambda: wide(1.0, lambda k: clock(k, "%Y-%m-%d %H:%M:%S.%f"), "t", ","),
    "wide, digits, mm, tabs": lambda: wide(
        1000, lambda k: clock(k, "%H%M%S%f"), {"column": "t", "format": "HHMMSSmmm"}, "\t"
    ),
    "wide, commas": lambda: wide(
        1.0, lambda k: f"{T[k]:.1f}".replace(".", ","), "t", ";", decimal=","
    ),
    "wide, ticks that wrap": lambda: wide(
        1.0, lambda k: str(k * 100_000 % (1 << 22)), {"column": "t", "rate": 1e6, "bits": 22}, ","
    ),
    "wide, ms": lambda: wide(1.0, lambda k: str(100 * k), {"column": "t", "unit": "ms"}, ","),
    "radar, bearings": lambda: radar(True),
    "radar, points": lambda: radar(False),
}


def number(text: str) -> float:
    return float(text.replace(",", "."))


def like(value: float, text: str) -> str:
    """A number as the log writes it."""
    made = f"{value:.6g}" if abs(value) < 1e6 else f"{value:.0f}"
    return made.replace(".", ",") if "," in text else made


def slip(log: Log, rng: np.random.Generator) -> str:
    """Change the log in one way, and say which."""
    kind = rng.choice(
        ["sign", "unit", "double", "wrap", "columns", "decimal", "cut", "move", "point", "name"]
    )
    whole = bool(rng.random() < 0.5)
    fields = log.cells + log.times + (log.columns * 2 if whole else [])
    name, k = fields[rng.integers(len(fields))]
    rows = log.files[name]
    i = int(rng.integers(1, len(rows)))
    among = range(1, len(rows)) if whole else [i]
    if kind == "double":
        name = rng.choice([n for n in log.files if n != "a.csv"])
        i = int(rng.integers(1, len(log.files[name])))
        log.files[name].insert(i, list(log.files[name][i]))
    elif kind == "move":
        row = rows.pop(i)
        rows.insert(int(rng.integers(1, len(rows))), row)
    elif kind == "wrap":
        name, k = log.times[rng.integers(len(log.times))]
        rows = log.files[name]
        try:
            values = [number(row[k]) for row in rows[1:]]
        except ValueError:
            return "none"
        top = values[len(rows) // 2]
        for row, value in zip(rows[1:], values, strict=True):
            row[k] = like(value % max(top, 1), row[k])
    elif kind == "columns":
        others = [c for n, c in log.cells + log.columns + log.times if n == name and c != k]
        if not others:
            return "none"
        j = others[rng.integers(len(others))]
        for row in (rows[m] for m in among):
            row[k], row[j] = row[j], row[k]
    elif kind == "name":
        if rows[0][:2] != ["t", "id"]:
            return "none"
        rows[i][1] = str(rng.choice(list(ANCHORS)))
    else:
        units = [1e3, 1e-3] if (name, k) in log.times else [1e3, 1e-3, 1e2, 1e-2, 3.2808, 0.3048]
        units = (
            [57.29578, 0.01745329] if rows[0][k] == "b" and "azimuth" in str(log.said) else units
        )
        units = [3.6, 1 / 3.6] if rows[0][k] == "v" else units
        factor = rng.choice(units)
        if whole and (name, k) in log.times and kind != "unit" and "truth" not in log.said:
            return "none"  # a walk ten times slower, of which nothing else tells the time
        shift = 10.0 ** rng.choice([-1, 1])
        for row in (rows[m] for m in among):
            text = row[k]
            if kind == "sign":
                row[k] = text.lstrip("-") if text.startswith("-") else text
            elif kind == "cut":
                row[k] = text[: max(1, len(text) // 2)]
            elif kind == "point":
                row[k] = text.replace(".", "").replace(",", "")
            else:
                try:
                    row[k] = like(number(text) * (factor if kind == "unit" else shift), text)
                except ValueError:
                    return "none"
    return f"{kind} of {'column' if whole else 'cell'} {k} in {name}, row {i}"


def meaning(recording: Recording) -> list[tuple[np.ndarray, np.ndarray, float]]:
    """Times [s], values and what of their change counts, of streams and truth."""
    out = []
    for stream in recording.streams.values():
        t = stream.time_ns[np.repeat(np.arange(len(stream)), np.diff(stream.row_offset))] * 1e-9
        if stream.kind == "uwb":
            who = np.repeat(stream.scan["rx"], np.diff(stream.row_offset))
            who = np.array([ord(name[0]) for name in stream.nodes])[who]
            order = np.lexsort((who, t))
            values = np.column_stack([who * 1e3, stream.rows["distance"]])
            out.append((t[order], values[order], 0.5))
        else:
            rows = stream.rows
            if stream.kind == "range_bearing":
                r, azimuth = rows["range"], rows["azimuth"]
                rows = {"x": r * np.cos(azimuth), "y": r * np.sin(azimuth)} | rows
            out.append((t, np.column_stack([rows["x"], rows["y"]]), 10.0))
            out.append((t, rows["doppler"], 1.0))
    if recording.truth is not None:
        o = recording.truth.objects
        t = o.time_ns[np.repeat(np.arange(len(o.time_ns)), np.diff(o.row_offset))] * 1e-9
        out.append((t, o.state, 10.0 if "x" in o.state_names else 0.5))
    known = [recording.sensors[name] for name in sorted(recording.sensors)]
    places = np.array([s.position[0] for s in known if len(s.position)])
    out.append((np.zeros(len(places)), places, 0.5))
    return out


def changed(a: Recording, b: Recording, step: float) -> bool:
    if a.sensors.keys() != b.sensors.keys():
        return True
    for (t, x, least), (u, y, _) in zip(meaning(a), meaning(b), strict=True):
        if x.shape != y.shape or (np.abs(t - u) > 2 * step).any():
            return True
        if (np.abs(x - y) > least).any():
            return True
    return False


@pytest.mark.parametrize("count", [10, pytest.param(150, marks=pytest.mark.verification)])
@pytest.mark.parametrize("base", BASES)
def test_no_slip_is_taken_in_silence(
    tmp_path: Path, base: str, count: int, caplog: pytest.LogCaptureFixture
):
    rng = np.random.default_rng([17, list(BASES).index(base), count])
    caplog.set_level(logging.WARNING)
    good = BASES[base]().read(tmp_path)
    assert not caplog.messages, "the log itself is plausible"
    silent, counted = [], 0
    while counted < count:
        log = BASES[base]()
        what = slip(log, rng)
        caplog.clear()
        try:
            found = log.read(tmp_path)
        except EchosetError:
            counted += what != "none"
            continue
        if what == "none" or not changed(good, found, 1.0 if "radar" in base else STEP):
            continue
        counted += 1
        if not caplog.messages:
            silent.append(what)
    assert not silent, f"{len(silent)} of {counted}: {silent[:8]}"

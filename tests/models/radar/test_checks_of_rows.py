"""Scans twice, covariances that are none and detections out of sight are refused by name."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from typing import Any

import numpy as np
import pytest

from echoset.models.checks import check_stream
from echoset.models.errors import FormatError
from echoset.models.records import Sensor, Stream

SENSORS = {"r": Sensor.static("radar", np.zeros(2))}


def stream(kind: str, rows: dict[str, Any], **changes: Any) -> Stream:
    """Two scans with one and two detections."""
    columns = {key: np.array(values, float) for key, values in rows.items()}
    whole = Stream(kind, ("r",), {}, np.array([1, 2]), np.array([0, 1, 3]), {}, columns)
    return replace(whole, **changes)


def polar(distance: list[float], azimuth: list[float], **changes: Any) -> Stream:
    return stream("range_bearing", {"range": distance, "azimuth": azimuth}, **changes)


def view(**bounds: float) -> dict[str, np.ndarray]:
    return {f"view_{key}": np.array([bound, bound]) for key, bound in bounds.items()}


def refused(broken: Stream, message: str, after: int | None = None) -> None:
    with pytest.raises(FormatError, match=rf"^log.h5: streams/r[/:] ?{message}"):
        check_stream(broken, SENSORS, "r", "log.h5", after)


@pytest.mark.parametrize("kind", ["position", "range_bearing", "range_angle_map"])
def test_times_of_scans(kind: str):
    rows = {key: np.zeros(0) for key in ("x", "y", "range", "azimuth")}
    maps = {"map": np.zeros((3, 2, 2), np.float32)} if kind == "range_angle_map" else {}
    axes = {"range_axis": np.arange(2.0), "azimuth_axis": np.arange(2.0)} if maps else {}
    rows = {} if maps else rows
    sound = Stream(kind, ("r",), axes, np.array([1, 2, 3]), np.zeros(4, np.int64), maps, rows)
    check_stream(sound, SENSORS, "r", after=0)
    refused(sound, r"time_ns\[0\]: 1 is the time of a second scan", after=1)
    refused(sound, r"time_ns\[0\]: 1 is out of order after 2", after=2)
    twice = replace(sound, time_ns=np.array([1, 2, 2]))
    refused(twice, r"time_ns\[2\]: 2 is the time of a second scan")
    refused(replace(sound, time_ns=np.array([1, 3, 2])), r"time_ns\[2\]: 2 is out of order")


def covariance(matrices: np.ndarray) -> Stream:
    """A stream with three covariances (3, d, d)."""
    axes = "xyz"[: matrices.shape[1]]
    pairs = [(i, j) for i in range(len(axes)) for j in range(i, len(axes))]
    rows = {f"cov_{axes[i]}{axes[j]}": matrices[:, i, j] for i, j in pairs}
    return stream("position", {**{a: np.ones(3) for a in axes}, **rows})


@pytest.mark.parametrize("d", [2, 3])
def test_covariances_are_refused_by_the_sign_of_their_least_eigenvalue(d: int):
    rng = np.random.default_rng(d)
    negative = 0
    for _ in range(300):
        turn = np.linalg.qr(rng.normal(size=(d, d)))[0]
        value = 10.0 ** rng.uniform(-2, 2, d) * rng.choice([1, 1, 1, -1], d)
        matrices = np.tile(np.eye(d), (3, 1, 1))
        matrices[2] = turn * value @ turn.T
        if value.min() > 0:
            check_stream(covariance(matrices), SENSORS, "r")
        else:
            negative += 1
            refused(covariance(matrices), r"rows/cov_xx\[2\]: .* not positive definite")
    assert 50 < negative < 250


@pytest.mark.parametrize("scale", [1e-300, 1e-150, 1e150, 1e300])
def test_covariances_of_any_scale(scale: float):
    sound = np.tile(np.array([[2.0, 1.0], [1.0, 1.0]]), (3, 1, 1)) * scale
    check_stream(covariance(sound), SENSORS, "r")
    broken = sound.copy()
    broken[1, 0, 1] = 1.5 * scale
    refused(covariance(broken), r"rows/cov_xx\[1\]")
    broken[1] = 0.0
    refused(covariance(broken), r"rows/cov_xx\[1\]: 0.0 begins")


def test_covariances_have_all_their_entries():
    whole = covariance(np.tile(np.eye(3), (3, 1, 1)))
    for key in ("cov_xy", "cov_zz", "z"):
        rows = {k: v for k, v in whole.rows.items() if k != key}
        refused(replace(whole, rows=rows), f"column '{key}' is missing")


VIEWS = {
    "a sector": ((-0.5, 0.5), [0.0, 0.49, -0.49], [0.6, pi, -0.6]),
    "across the back": ((3.0, -3.0), [pi, 3.01, -3.01], [0.0, 2.9, -2.9]),
    "over the cut": ((3.0, 3.5), [3.1, -pi, 3.5 - 2 * pi], [2.9, 3.6 - 2 * pi, 0.0]),
    "all around": ((-pi, pi), [-pi, 0.0, pi], []),
    "no width": ((0.3, 0.3), [0.3, 0.3, 0.3 + 2 * pi], [0.31, 0.29, -0.3]),
}


@pytest.mark.parametrize("name", VIEWS)
def test_azimuths_of_a_view(name: str):
    (first, last), inside, outside = VIEWS[name]
    scan = view(azimuth_min=first, azimuth_max=last)
    far = [10.0, 20.0, 30.0]
    check_stream(polar(far, inside, scan=scan), SENSORS, "r")
    points = {"x": far * np.cos(inside), "y": far * np.sin(inside)}
    check_stream(stream("position", points, scan=scan), SENSORS, "r")
    for azimuth in outside:
        wrong = [inside[0], azimuth, inside[2]]
        refused(polar(far, wrong, scan=scan), r"rows/azimuth\[1\]: .* is beside the view")
        points = {"x": far * np.cos(wrong), "y": far * np.sin(wrong)}
        refused(stream("position", points, scan=scan), r"rows/y\[1\]: .* is beside the view")


def test_ranges_of_a_view():
    scan = view(range_min=5.0, range_max=10.0)
    check_stream(polar([5.0, 10.0, 7.0], [0.0] * 3, scan=scan), SENSORS, "r")
    for value in (4.99, 10.01):
        wrong = polar([7.0, 7.0, value], [0.0] * 3, scan=scan)
        refused(wrong, rf"rows/range\[2\]: {value} is out of range of the view")
    solid = {"x": [6.0, 6.0, 6.0], "y": [0.0] * 3, "z": [0.0, 0.0, 9.0]}
    refused(stream("position", solid, scan=scan), r"rows/x\[2\]: 6.0 is out of range")
    turned = {"view_range_min": np.full(2, 5.0), "view_range_max": np.array([9.0, 4.0])}
    refused(polar([6.0] * 3, [0.0] * 3, scan=turned), r"scan/view_range_max\[1\]: 4.0 is below")


def test_every_scan_has_its_own_view():
    scan = {"view_range_max": np.array([10.0, 100.0])}
    check_stream(polar([9.0, 99.0, 50.0], [0.0] * 3, scan=scan), SENSORS, "r")
    refused(polar([11.0, 99.0, 50.0], [0.0] * 3, scan=scan), r"rows/range\[0\]: 11.0")


def test_noise_carries_detections_out_of_the_view():
    scan = view(azimuth_min=-0.5, azimuth_max=0.5, range_max=100.0)
    wide = polar([103.0, 50.0, 50.0], [0.0, 0.53, -0.53], scan=scan)
    stated = {"std_range": 1.0, "std_azimuth": 0.01}
    check_stream(replace(wide, model=stated), SENSORS, "r")
    check_stream(
        replace(wide, rows={**wide.rows, **{k: np.full(3, v) for k, v in stated.items()}}),
        SENSORS, "r",
    )  # fmt: skip
    refused(replace(wide, model={"std_azimuth": 0.01}), r"rows/range\[0\]")
    refused(replace(wide, model={"std_range": 1.0}), r"rows/azimuth\[1\]")
    refused(replace(wide, model={"std_range": "1", "std_azimuth": [1.0]}), r"rows/range\[0\]")
    points = {"x": [103.0, 50.0, 50.0], "y": [0.0, 0.0, 0.0]}
    plane = stream("position", points, scan=scan)
    check_stream(replace(plane, model={"std_position": 1.0}), SENSORS, "r")
    noise = {"cov_xx": np.ones(3), "cov_xy": np.zeros(3), "cov_yy": np.ones(3)}
    check_stream(replace(plane, rows={**plane.rows, **noise}), SENSORS, "r")
    refused(plane, r"rows/x\[0\]: 103.0")


def maps(**changes: Any) -> Stream:
    """Two maps of three ranges and four azimuths."""
    axes = {"range_axis": np.array([0.0, 0.4, 0.8]), "azimuth_axis": np.linspace(-1, 1, 4)}
    power = np.ones((2, 3, 4), np.float32)
    none = np.zeros(3, np.int64)
    whole = Stream("range_angle_map", ("r",), axes, np.array([1, 2]), none, {"map": power}, {})
    return replace(whole, **changes)


@pytest.mark.parametrize(
    ("axis", "values", "message"),
    [
        ("range_axis", None, "model/range_axis: is missing"),
        ("azimuth_axis", None, "model/azimuth_axis: is missing"),
        ("range_axis", 1.0, "model/range_axis: must be a list of two or more numbers"),
        ("range_axis", [1.0], "model/range_axis: must be a list of two or more numbers"),
        ("range_axis", [0.0, 0.4, np.nan], r"model/range_axis\[2\]: nan is not finite"),
        ("range_axis", [0.0, 0.4, 0.4], r"model/range_axis\[2\]: 0.4 is out of order"),
        ("range_axis", [0.0, 0.4, 0.9], r"model/range_axis\[1\]: 0.4 breaks even steps"),
        ("range_axis", [-0.4, 0.0, 0.4], r"model/range_axis\[0\]: .*-0.4.* is negative"),
        ("range_axis", [0.0, 0.4, 0.8, 1.2], r"scan/map: is \(3, 4\) a scan, the axes \(4, 4\)"),
        ("azimuth_axis", [1.0, 0.0, -1.0, -2.0], r"model/azimuth_axis\[1\]: 0.0 is out of order"),
        ("azimuth_axis", [0.0, 3.0, 6.0, 9.0], "model/azimuth_axis: goes round more than once"),
    ],
)
def test_axes_of_maps(axis: str, values: Any, message: str):
    sound = maps()
    check_stream(sound, SENSORS, "r")
    model = {key: value for key, value in sound.model.items() if key != axis or values is not None}
    if values is not None:
        model[axis] = values
    refused(replace(sound, model=model), message)


def test_axes_may_have_been_rounded_and_may_go_round_once():
    axes = {
        "range_axis": (np.arange(3) * 0.4 + 30).astype(np.float32),
        "azimuth_axis": np.linspace(-pi, pi, 4),
    }
    check_stream(maps(model=axes), SENSORS, "r")


@pytest.mark.parametrize(("value", "message"), [(np.nan, "is not finite"), (-1.0, "is negative")])
def test_pixels_of_maps(value: float, message: str):
    power = np.ones((2, 3, 4), np.float32)
    power[1, 2, 3] = value
    refused(maps(scan={"map": power}), rf"scan/map\[1, 2, 3\]: .* {message}")


def tables(P: np.ndarray, **changes: Any) -> Stream:
    """A stream that states the covariance P (2, n, 3, 3) of each scan at n nodes."""
    upper = [(i, j) for i in range(3) for j in range(i, 3)]
    model = {f"cov_{'xyz'[i]}{'xyz'[j]}_table": P[..., i, j] for i, j in upper}
    return stream("position", {a: np.ones(3) for a in "xyz"}, model={**model, **changes})


def test_covariances_in_tables():
    """Semidefinite is what no weighted sum has a negative variance of."""
    line = np.array([1.0, 2.0, -3.0])
    P = np.tile(np.eye(3), (2, 4, 1, 1))
    P[0, 1], P[1, 2] = np.outer(line, line), np.zeros((3, 3))
    check_stream(tables(P), SENSORS, "r")
    bad = P.copy()
    bad[1, 3] = np.eye(3) - 0.1 * np.outer(line, line)
    assert line @ bad[1, 3] @ line < 0
    refused(tables(bad), r"model/cov_xx_table\[1, 3\]: .* not semidefinite")
    refused(tables(P, cov_zz_table=np.ones((2, 3))), r"model/cov_zz_table: must be numbers in the")
    whole = dict(tables(P).model)
    del whole["cov_yz_table"]
    lacking = replace(tables(P), model=whole)
    refused(lacking, r"model: 'cov_yz_table' is missing")
    plane = {k: v for k, v in whole.items() if "z" not in k}
    check_stream(replace(tables(P), model=plane), SENSORS, "r")


def test_radial_speeds_beyond_what_is_told_apart():
    """Speeds that differ by twice ``doppler_max`` are one to the radar; noise may carry over it."""
    rows = {"range": [5.0] * 3, "azimuth": [0.0] * 3, "doppler": [-10.0, 0.0, 10.0]}
    sound = stream("range_bearing", rows, model={"doppler_max": 10.0})
    check_stream(sound, SENSORS, "r")
    refused(
        replace(sound, model={"doppler_max": 9.0}),
        r"rows/doppler\[0\]: -10.0 is beyond doppler_max",
    )
    check_stream(replace(sound, model={"doppler_max": 9.0, "std_doppler": 0.2}), SENSORS, "r")
    refused(replace(sound, model={"doppler_max": 0.0}), "model/doppler_max: 0.0 is not positive")
    refused(replace(sound, model={"doppler_max": -1.0}), "model/doppler_max.*is negative")
    refused(replace(sound, model={"doppler_max": "9"}), "model/doppler_max: is not a number")
    refused(replace(sound, model={"std_doppler": [1.0]}), "model/std_doppler: is not a number")
    silent = stream("range_bearing", {k: rows[k] for k in ("range", "azimuth")})
    check_stream(replace(silent, model={"doppler_max": 9.0}), SENSORS, "r")
